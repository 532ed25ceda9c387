const TRACKS = ["t", "q", "q_dot", "tip", "desired", "error", "platform", "effort"];

// A run's samples, and where it is between them.
class Motion {
  constructor(description) {
    for (const name of TRACKS) this[name] = unpack(description[name]);
    // where it will go, for a run that has only begun
    this.path = unpack(description.path) || this.desired;
    this.measure();
  }

  measure() {
    this.frames = this.t.length;
    this.end = this.t[this.frames - 1];
    if (this.effort) this.peaks = columnPeaks(this.effort);
  }

  // Later samples of the same run.
  extend(later) {
    for (const name of TRACKS) {
      const [now, more] = [this[name], later[name]];
      if (!now || !more) continue;
      const both = new now.constructor(now.length + more.length);
      both.set(now);
      both.set(more, now.length);
      this[name] = Object.assign(both, { columns: now.columns, rows: now.rows + more.rows });
    }
    this.measure();
  }

  // The last frame at or before a time, and how far it is to the next, 0 to 1.
  at(time) {
    let low = 0, high = this.frames - 1;
    if (time >= this.t[high]) return { frame: high, share: 0 };
    if (time <= this.t[0]) return { frame: 0, share: 0 };
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.t[middle] <= time) low = middle;
      else high = middle;
    }
    return { frame: low, share: (time - this.t[low]) / (this.t[high] - this.t[low]) };
  }

  // Along the cubic that has the recorded configurations and rates at both frames.
  configuration({ frame, share }, q) {
    const n = this.q.columns;
    const a = frame * n;
    if (share === 0) {
      for (let i = 0; i < n; i++) q[i] = this.q[a + i];
      return q;
    }
    const b = a + n;
    const h = this.t[frame + 1] - this.t[frame];
    const s = share, r = 1 - share;
    for (let i = 0; i < n; i++)
      q[i] = r * r * (1 + 2 * s) * this.q[a + i] + s * s * (3 - 2 * s) * this.q[b + i] +
        h * s * r * (r * this.q_dot[a + i] - s * this.q_dot[b + i]);
    return q;
  }

  point(array, { frame, share }, result) {
    const next = Math.min(frame + 1, this.frames - 1);
    return result.set(...[0, 1, 2].map((i) => (1 - share) * array[3 * frame + i] + share * array[3 * next + i]));
  }
}

function columnPeaks(matrix) {
  const peaks = new Float64Array(matrix.columns);
  for (let i = 0; i < matrix.length; i++) {
    const size = Math.abs(matrix[i]);
    if (Number.isFinite(size) && size > peaks[i % matrix.columns]) peaks[i % matrix.columns] = size;
  }
  return peaks;
}
// Lines with a width: tubes, that can be shown up to a point.
const SIDES = 6;
const CIRCLE = Array.from({ length: SIDES }, (_, k) => [Math.cos((2 * Math.PI * k) / SIDES), Math.sin((2 * Math.PI * k) / SIDES)]);

// points: x, y, z one after the other; colours: the same of red, green and blue, or null.
function tube(points, radius, colours, material) {
  const n = points.length / 3;
  const position = new Float32Array(3 * SIDES * n);
  const normal = new Float32Array(3 * SIDES * n);
  const colour = colours ? new Float32Array(3 * SIDES * n) : null;
  const tangent = new THREE.Vector3(1, 0, 0), step = new THREE.Vector3();
  const side = new THREE.Vector3(0, 0, 1), other = new THREE.Vector3();
  for (let i = 0; i < n; i++) {
    const [a, b] = [Math.max(i - 1, 0), Math.min(i + 1, n - 1)];
    step.set(points[3 * b] - points[3 * a], points[3 * b + 1] - points[3 * a + 1], points[3 * b + 2] - points[3 * a + 2]);
    if (step.lengthSq() > 1e-18) tangent.copy(step).normalize();
    side.addScaledVector(tangent, -side.dot(tangent)); // carried along, so that it does not twist
    if (side.lengthSq() < 1e-6) side.set(tangent.y, tangent.z, tangent.x).addScaledVector(tangent, -(tangent.y * tangent.x + tangent.z * tangent.y + tangent.x * tangent.z));
    side.normalize();
    other.crossVectors(tangent, side);
    for (let k = 0; k < SIDES; k++) {
      const c = CIRCLE[k][0], d = CIRCLE[k][1];
      const place = 3 * (SIDES * i + k);
      normal[place] = c * side.x + d * other.x;
      normal[place + 1] = c * side.y + d * other.y;
      normal[place + 2] = c * side.z + d * other.z;
      for (let j = 0; j < 3; j++) {
        position[place + j] = points[3 * i + j] + radius * normal[place + j];
        if (colour) colour[place + j] = colours[3 * i + j];
      }
    }
  }
  const index = new Uint32Array(6 * SIDES * Math.max(n - 1, 0));
  let w = 0;
  for (let i = 0; i + 1 < n; i++)
    for (let k = 0; k < SIDES; k++) {
      const a = SIDES * i + k, b = SIDES * i + ((k + 1) % SIDES);
      index[w++] = a;
      index[w++] = b;
      index[w++] = a + SIDES;
      index[w++] = b;
      index[w++] = b + SIDES;
      index[w++] = a + SIDES;
    }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
  if (colour) geometry.setAttribute("color", new THREE.BufferAttribute(colour, 3));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false; // parts of it may be far away or not finite
  return mesh;
}

// Show a tube up to its frame; one without end where frame is its last.
function showUpTo(mesh, frame) {
  mesh.geometry.setDrawRange(0, 6 * SIDES * frame);
}

// Errors as colours, from small to large.
const SCALE = ["#2b3a92", "#1c86c0", "#2fae7a", "#e9b92f", "#e2572b", "#9e0b23"];

function errorColour(error, [low, high]) {
  const place = error > 0 ? (Math.log10(error) - low) / (high - low) : 0;
  const x = Math.min(Math.max(Number.isNaN(place) ? 1 : place, 0), 1) * (SCALE.length - 1);
  const i = Math.min(Math.floor(x), SCALE.length - 2);
  return colourOf(SCALE[i]).lerp(colourOf(SCALE[i + 1]), x - i);
}

function errorColours(errors, decades) {
  const colours = new Float32Array(3 * errors.length);
  errors.forEach((error, i) => errorColour(error, decades).toArray(colours, 3 * i));
  return colours;
}
// Torques and forces on joints: arcs about their axes and arrows along them. Their size goes with the
// square root of the effort over its peak in the run, so that small ones are seen beside large ones.
const FULL_TURN = (300 * Math.PI) / 180;
const STEPS = 40;

class Effort {
  constructor(joint, size) {
    this.joint = joint;
    this.size = size;
    this.group = new THREE.Group();
    this.group.name = `torque on ${joint.name}`;
    const z = new THREE.Vector3(0, 0, 1);
    this.along = new THREE.Quaternion().setFromUnitVectors(z, joint.direction.clone().normalize());
    this.back = this.along.clone().multiply(new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI));
    const material = over(new THREE.MeshBasicMaterial({ color: colourOf("#7048e8"), opacity: 0.85 }));
    const width = 0.09 * size;
    if (joint.turns) {
      const points = [];
      for (let i = 0; i <= STEPS; i++) points.push(size * Math.cos((FULL_TURN * i) / STEPS), size * Math.sin((FULL_TURN * i) / STEPS), 0);
      this.shaft = tube(points, width, null, material);
    } else {
      this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(width, width, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5), material);
    }
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * width, 6 * width, 16), material);
    for (const mesh of [this.shaft, this.head]) {
      mesh.renderOrder = 5;
      this.group.add(mesh);
    }
    joint.group.add(this.group);
  }

  // relative: effort over its peak, -1 to 1
  set(relative, visible) {
    const amount = Math.sqrt(Math.abs(relative));
    this.group.visible = visible && amount > 0.02;
    if (!this.group.visible) return;
    this.group.quaternion.copy(relative < 0 ? this.back : this.along);
    if (this.joint.turns) {
      const steps = Math.max(1, Math.round(amount * STEPS));
      const angle = (FULL_TURN * steps) / STEPS;
      showUpTo(this.shaft, steps);
      this.head.position.set(this.size * Math.cos(angle), this.size * Math.sin(angle), 0);
      this.head.rotation.set(0, 0, angle);
    } else {
      const length = 3 * this.size * amount;
      this.shaft.scale.set(1, 1, length);
      this.head.position.set(0, 0, length);
      this.head.rotation.set(Math.PI / 2, 0, 0);
    }
  }
}
// A run: its robot, its paths and where they are in the scene. A robot alone is a run without motion.
class Run {
  constructor(description, scene, style) {
    this.description = description;
    this.label = description.label;
    this.colour = description.colour;
    this.group = new THREE.Group();
    this.group.name = this.label;
    this.shown = { trails: true, efforts: false };
    this.place = { frame: 0, share: 0 };
    this.robot = null;
    this.motion = description.motion ? new Motion(description.motion) : null;
    this.efforts = [];
    if (description.robot !== null) {
      const tint = style.compared ? this.colour : null;
      this.robot = new Robot(scene.robots[description.robot], scene.geometries, tint);
      this.group.add(this.robot.root);
    }
    if (this.motion) this.addPaths(scene, style);
  }

  get info() {
    return this.description.info;
  }

  addPaths(scene, style) {
    const motion = this.motion;
    const width = style.width;
    const plain = (colour) => new THREE.MeshPhongMaterial({ color: colourOf(colour) });
    this.width = width;
    this.materials = {
      error: new THREE.MeshPhongMaterial({ vertexColors: true }),
      run: plain(this.colour),
      platform: plain(style.compared ? this.colour : "#8a94a3"),
    };
    this.path = tube(motion.path, 0.55 * width, null, plain("#4a5361"));
    this.path.name = "desired path";
    const ball = new THREE.SphereGeometry(1, 24, 16);
    this.target = new THREE.Mesh(ball, new THREE.MeshPhongMaterial({ color: colourOf("#111827") }));
    this.target.name = "desired point";
    this.target.scale.setScalar(2.6 * width);
    this.actual = new THREE.Mesh(ball, new THREE.MeshPhongMaterial({ color: colourOf(this.colour) }));
    this.actual.name = "tip point";
    this.actual.scale.setScalar(2.0 * width);
    this.actual.visible = this.robot === null;
    this.group.add(this.path, this.target, this.actual);
    this.byError = !style.compared;
    this.drawMotion(scene.error_decades);
  }

  // Everything that the samples make; again, when there are more of them.
  drawMotion(decades) {
    const { motion, width, materials } = this;
    for (const line of [this.trail, this.plainTrail, this.track])
      if (line) {
        this.group.remove(line);
        line.geometry.dispose();
      }
    this.trail = tube(motion.tip, width, errorColours(motion.error, decades), materials.error);
    this.trail.name = "tip trail";
    this.plainTrail = new THREE.Mesh(this.trail.geometry, materials.run);
    this.plainTrail.frustumCulled = false;
    this.plainTrail.name = "tip trail in the run's colour";
    const ground = Float64Array.from(motion.platform);
    for (let i = 2; i < ground.length; i += 3) ground[i] += 0.3 * width;
    this.track = tube(ground, 0.5 * width, null, materials.platform);
    this.track.name = "platform trail";
    this.track.scale.z = 0.4;
    this.group.add(this.trail, this.plainTrail, this.track);
    if (this.robot) this.addEfforts();
    this.update();
  }

  addEfforts() {
    const has = new Set(this.efforts.map((effort) => effort.joint));
    const radii = new Map(this.robot.description.wheels.map((wheel) => [wheel.joint, wheel.radius]));
    for (const joint of this.robot.joints)
      if (this.motion.peaks[joint.q] > 0 && !has.has(joint)) {
        const radius = radii.has(joint.name) ? 1.25 * radii.get(joint.name) : 0.07 * this.robot.extent;
        this.efforts.push(new Effort(joint, radius));
      }
  }

  colourTrailByError(byError) {
    this.byError = byError;
    this.update();
  }

  show(layer, visible) {
    if (layer in this.shown) this.shown[layer] = visible;
    else if (this.robot) this.robot.show(layer, visible);
    this.update();
  }

  setTime(time) {
    if (!this.motion) return;
    this.time = time;
    this.place = this.motion.at(time);
    if (this.robot) this.robot.setConfiguration(this.motion.configuration(this.place, this.robot.q));
    this.update();
  }

  update() {
    if (!this.motion || !this.trail) return;
    const motion = this.motion;
    const { frame } = this.place;
    for (const line of [this.trail, this.track]) showUpTo(line, frame);
    this.trail.visible = this.shown.trails && this.byError;
    this.plainTrail.visible = this.shown.trails && !this.byError;
    this.track.visible = this.shown.trails;
    motion.point(motion.desired, this.place, this.target.position);
    motion.point(motion.tip, this.place, this.actual.position);
    const n = motion.effort ? motion.effort.columns : 0;
    for (const effort of this.efforts) {
      const q = effort.joint.q;
      effort.set(motion.effort[frame * n + q] / motion.peaks[q], this.shown.efforts);
    }
  }

  get error() {
    return this.motion.error[this.place.frame];
  }

  get ended() {
    return this.motion !== null && this.time > this.motion.end + 1e-9;
  }

  // Where its label goes: over its platform, or over its tip.
  labelPoint(result) {
    if (this.motion) this.motion.point(this.robot ? this.motion.platform : this.motion.tip, this.place, result);
    else result.set(0, 0, 0);
    if (this.robot) result.z = 1.08 * this.robot.height;
    return this.group.localToWorld(result);
  }

  // The corners of everything that the robot is drawn with, in the run's own world.
  corners(add) {
    this.group.updateWorldMatrix(true, true);
    const point = new THREE.Vector3();
    for (const mesh of this.robot.layers.visual) {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      for (let i = 0; i < 8; i++) {
        point.set(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z);
        this.group.worldToLocal(mesh.localToWorld(point));
        add(point.x, point.y, point.z);
      }
    }
  }

  // The pose of a joint, a link, a part or the tip, in the run's own world.
  pose(name) {
    const object = name === undefined ? null : this.robot && this.robot.named.get(name);
    if (!object) throw new Error(`run ${this.label} has no ${name}`);
    this.group.updateWorldMatrix(true, true);
    return new THREE.Matrix4().copy(this.group.matrixWorld).invert().multiply(object.matrixWorld);
  }
}
