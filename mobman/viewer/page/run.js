// A run: its robot, its samples, its lines and its torques. A robot alone is a run without motion.
const TRACKS = ["t", "q", "q_dot", "tip", "desired", "error", "platform", "effort"];

// A run's samples, and the states between them.
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
    if (!this.effort) return;
    this.peaks = new Float64Array(this.effort.columns);
    this.effort.forEach((effort, i) => {
      const [size, column] = [Math.abs(effort), i % this.peaks.length];
      if (size > this.peaks[column] && size < Infinity) this.peaks[column] = size;
    });
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

  // The last frame at or before a time, the one after it, and the share of the way to that.
  at(time) {
    const frame = Math.max(this.t.findLastIndex((t) => t <= time), 0);
    const next = Math.min(frame + 1, this.frames - 1);
    const share = (time - this.t[frame]) / (this.t[next] - this.t[frame]);
    return { frame, next, share: next > frame && share > 0 ? share : 0 };
  }

  // Along the cubic that has the recorded configurations and rates at both frames.
  configuration({ frame, next, share: s }, q) {
    const n = this.q.columns;
    const [a, b, h, r] = [n * frame, n * next, this.t[next] - this.t[frame], 1 - s];
    for (let i = 0; i < n; i++)
      q[i] = r * r * (1 + 2 * s) * this.q[a + i] + s * s * (3 - 2 * s) * this.q[b + i] +
        h * s * r * (r * this.q_dot[a + i] - s * this.q_dot[b + i]);
    return q;
  }

  point(array, { frame, next, share }, result) {
    return result.fromArray(array, 3 * frame).lerp(new THREE.Vector3().fromArray(array, 3 * next), share);
  }
}

// A curve through samples, for a tube that has a ring at each; it keeps its direction where it stands.
class Track extends THREE.Curve {
  constructor(points) {
    super();
    this.points = points;
    this.last = points.length / 3 - 1;
    this.direction = new THREE.Vector3(1, 0, 0);
  }

  getPointAt(share, point) {
    return point.fromArray(this.points, 3 * Math.round(share * this.last));
  }

  getTangentAt(share, tangent) {
    const i = Math.round(share * this.last);
    const [before, after] = [Math.max(i - 1, 0), Math.min(i + 1, this.last)];
    tangent.fromArray(this.points, 3 * after).sub(new THREE.Vector3().fromArray(this.points, 3 * before));
    if (tangent.lengthSq() > 1e-18) this.direction.copy(tangent).normalize();
    return tangent.copy(this.direction);
  }
}

const SIDES = 6;
const RING = SIDES + 1; // vertices: the last is where the first is

// A line with a width; colours: red, green and blue of each point, or null.
function tube(points, radius, material, colours = null) {
  const rings = Math.max(points.length / 3, 2);
  const geometry = new THREE.TubeGeometry(new Track(points), rings - 1, radius, SIDES);
  if (colours) {
    const all = Float32Array.from({ length: 3 * RING * rings }, (_, i) => colours[3 * Math.floor(i / 3 / RING) + (i % 3)]);
    geometry.setAttribute("color", new THREE.BufferAttribute(all, 3));
  }
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false; // parts of it may be far away or not finite
  return mesh;
}

const showUpTo = (mesh, frame) => mesh.geometry.setDrawRange(0, 6 * SIDES * frame);

// Errors as colours, from small to large.
const SCALE = ["#2b3a92", "#1c86c0", "#2fae7a", "#e9b92f", "#e2572b", "#9e0b23"];

function errorColours(errors, [low, high]) {
  const scale = SCALE.map((colour) => colourOf(colour));
  const colours = new Float32Array(3 * errors.length);
  const colour = new THREE.Color();
  errors.forEach((error, i) => {
    const share = error === 0 ? 0 : (Math.log10(error) - low) / (high - low);
    const x = (scale.length - 1) * (Number.isNaN(share) ? 1 : Math.min(Math.max(share, 0), 1));
    const step = Math.min(Math.floor(x), scale.length - 2);
    colour.lerpColors(scale[step], scale[step + 1], x - step).toArray(colours, 3 * i);
  });
  return colours;
}

// Torques and forces on joints: arcs about their axes and arrows along them. Their size goes with the
// square root of the effort over its peak in the run, so that small ones are seen next to large ones.
const FULL_TURN = (300 * Math.PI) / 180;
const STEPS = 40;

class Effort {
  constructor(joint, size) {
    this.joint = joint;
    this.size = size;
    this.group = new THREE.Group();
    this.along = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), joint.direction);
    this.back = this.along.clone().multiply(new THREE.Quaternion(1, 0, 0, 0));
    const material = over(colourOf("#7048e8"), 0.85);
    const width = 0.09 * size;
    const arc = Array.from({ length: STEPS + 1 }, (_, i) => this.point((FULL_TURN * i) / STEPS)).flat();
    const rod = new THREE.CylinderGeometry(width, width, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    this.shaft = joint.turns ? tube(arc, width, material) : new THREE.Mesh(rod, material);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * width, 6 * width, 16), material);
    this.shaft.renderOrder = this.head.renderOrder = 5;
    joint.group.add(this.group.add(this.shaft, this.head));
  }

  point(angle) {
    return [this.size * Math.cos(angle), this.size * Math.sin(angle), 0];
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
      this.head.position.set(...this.point(angle));
      this.head.rotation.set(0, 0, angle);
    } else {
      const length = 3 * this.size * amount;
      this.shaft.scale.z = length;
      this.head.position.z = length;
      this.head.rotation.x = Math.PI / 2;
    }
  }
}

const SNAPSHOTS = 6; // of the robot along its way
const plain = (colour) => new THREE.MeshPhongMaterial({ color: colourOf(colour) });

class Run {
  // width: of the lines (m); compared: whether there are others
  constructor(description, scene, width, compared) {
    Object.assign(this, { description, width, compared, label: description.label, colour: description.colour });
    this.group = new THREE.Group();
    this.shown = { trails: true, efforts: false };
    this.place = { frame: 0, next: 0, share: 0 };
    this.byError = !compared;
    this.efforts = [];
    this.robot = null;
    this.motion = description.motion ? new Motion(description.motion) : null;
    if (description.robot !== null) {
      this.robot = new Robot(scene.robots[description.robot], scene.geometries, compared ? this.colour : null);
      this.group.add(this.robot.root);
    }
    if (this.motion) this.addPaths(scene.error_decades);
  }

  get info() {
    return this.description.info;
  }

  addPaths(decades) {
    const { width, colour } = this;
    this.materials = {
      error: new THREE.MeshPhongMaterial({ vertexColors: true }),
      run: plain(colour),
      platform: plain(this.compared ? colour : "#8a94a3"),
    };
    const ball = (radius, colour) => new THREE.Mesh(new THREE.SphereGeometry(radius, 24, 16), plain(colour));
    this.path = tube(this.motion.path, 0.55 * width, plain("#4a5361"));
    this.target = ball(2.6 * width, "#111827");
    this.actual = ball(2 * width, colour);
    this.actual.visible = this.robot === null;
    this.lines = new THREE.Group();
    this.group.add(this.path, this.target, this.actual, this.lines);
    this.drawMotion(decades);
  }

  // Everything that the samples make; again, when there are more of them.
  drawMotion(decades) {
    const { motion, width, materials, lines, robot } = this;
    for (const line of lines.children) line.geometry.dispose();
    lines.clear();
    this.trail = tube(motion.tip, width, materials.error, errorColours(motion.error, decades));
    this.track = tube(motion.platform, 0.5 * width, materials.platform);
    this.track.scale.z = 0.4;
    this.track.position.z = 0.12 * width; // above the ground's grid
    lines.add(this.trail, this.track);
    if (robot) {
      const has = new Set(this.efforts.map((effort) => effort.joint));
      const radii = new Map(robot.description.wheels.map((wheel) => [wheel.joint, 1.25 * wheel.radius]));
      for (const joint of robot.joints)
        if (motion.peaks[joint.q] > 0 && !has.has(joint))
          this.efforts.push(new Effort(joint, radii.get(joint.name) || 0.07 * robot.extent));
    }
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
    const { motion, place } = this;
    if (!motion) return;
    for (const line of this.lines.children) showUpTo(line, place.frame);
    this.lines.visible = this.shown.trails;
    this.trail.material = this.byError ? this.materials.error : this.materials.run;
    motion.point(motion.desired, place, this.target.position);
    motion.point(motion.tip, place, this.actual.position);
    for (const effort of this.efforts) {
      const q = effort.joint.q;
      effort.set(motion.effort[place.frame * motion.effort.columns + q] / motion.peaks[q], this.shown.efforts);
    }
  }

  get error() {
    return this.motion.error[this.place.frame];
  }

  get ended() {
    return this.time > this.motion.end + 1e-9;
  }

  // Where its label goes: over its platform, or over its tip.
  labelPoint() {
    const point = this.motion.point(this.robot ? this.motion.platform : this.motion.tip, this.place, new THREE.Vector3());
    if (this.robot) point.z = 1.08 * this.robot.height;
    return this.group.localToWorld(point);
  }

  // Points to have in view: of its lines, and of the robot along its way, near a box on the ground.
  outline({ min, max }) {
    const near = ({ x, y }) => x >= min.x - 1e-6 && x <= max.x + 1e-6 && y >= min.y - 1e-6 && y <= max.y + 1e-6;
    const { motion, robot } = this;
    if (!motion) return [...this.corners(), new THREE.Vector3().setFromMatrixPosition(this.pose("tip"))];
    const point = (track, frame) => new THREE.Vector3().fromArray(track, 3 * frame);
    const points = [motion.path, motion.tip, motion.platform].flatMap((track) =>
      Array.from({ length: Math.ceil(track.rows / 10) }, (_, i) => point(track, 10 * i)).filter(near)
    );
    const now = robot && Float64Array.from(robot.q);
    for (let i = 0; robot && i <= SNAPSHOTS; i++) {
      const frame = Math.round((i / SNAPSHOTS) * (motion.frames - 1));
      if (!near(point(motion.platform, frame))) continue;
      robot.setConfiguration(motion.q.subarray(frame * now.length, (frame + 1) * now.length));
      points.push(...this.corners());
    }
    if (robot) robot.setConfiguration(now);
    return points;
  }

  // The corners of everything that the robot is drawn with, in the run's own world.
  corners() {
    this.group.updateWorldMatrix(true, true);
    return this.robot.layers.visual.flatMap((mesh) => {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      return Array.from({ length: 8 }, (_, i) => {
        const corner = new THREE.Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z);
        return this.group.worldToLocal(mesh.localToWorld(corner));
      });
    });
  }

  // The pose of a joint, a link, a part or the tip, in the run's own world.
  pose(name) {
    const object = this.robot && this.robot.named.get(name);
    if (!object) throw new Error(`run ${this.label} has no ${name}`);
    this.group.updateWorldMatrix(true, true);
    return new THREE.Matrix4().copy(this.group.matrixWorld).invert().multiply(object.matrixWorld);
  }
}
