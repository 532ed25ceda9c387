// A run: its robot, its samples, its lines and its torques. A robot alone is a run without motion.
const TRACKS = ["t", "q", "q_dot", "tip", "desired", "error", "platform", "effort", "turn", "angle", "margins"];

// The last of rising times that is not after one, or the first.
function lastAt(times, time) {
  let [low, high] = [0, times.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return low;
}

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
    const frame = lastAt(this.t, time);
    const next = Math.min(frame + 1, this.frames - 1);
    const share = (time - this.t[frame]) / (this.t[next] - this.t[frame]);
    return { frame, next, share: next > frame && share > 0 ? share : 0 };
  }

  // Along the cubic that has the recorded configurations and rates at both frames.
  configuration({ frame, next, share: s }) {
    const n = this.q.columns;
    const [a, b, h, r] = [n * frame, n * next, this.t[next] - this.t[frame], 1 - s];
    return Float64Array.from({ length: n }, (_, i) =>
      r * r * (1 + 2 * s) * this.q[a + i] + s * s * (3 - 2 * s) * this.q[b + i] +
      h * s * r * (r * this.q_dot[a + i] - s * this.q_dot[b + i])
    );
  }

  // The desired frame, or a frame whose z axis has the desired direction.
  turned({ frame }) {
    const { columns } = this.turn;
    const part = Array.from(this.turn.subarray(columns * frame, columns * (frame + 1)));
    if (columns === 4) return new THREE.Quaternion(...part);
    return new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...part));
  }

  point(track, { frame, next, share }) {
    const [before, after] = [frame, next].map((i) => new THREE.Vector3().fromArray(track, 3 * i));
    return before.lerp(after, share);
  }
}

// A curve through samples, for a tube that has a ring at each; it keeps its direction where it stands.
class Track extends THREE.Curve {
  constructor(points) {
    super();
    Object.assign(this, { points, last: points.length / 3 - 1, direction: new THREE.Vector3(1, 0, 0) });
  }

  getPointAt(share, point = new THREE.Vector3()) {
    return point.fromArray(this.points, 3 * Math.round(share * this.last));
  }

  getTangentAt(share, tangent) {
    const i = Math.round(share * this.last);
    const [before, after] = [Math.max(i - 1, 0), Math.min(i + 1, this.last)];
    tangent.subVectors(this.getPointAt(after / this.last), this.getPointAt(before / this.last));
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
  return Array.from(errors).flatMap((error) => {
    const share = error === 0 ? 0 : (Math.log10(error) - low) / (high - low);
    const x = (scale.length - 1) * (Number.isNaN(share) ? 1 : Math.min(Math.max(share, 0), 1));
    const step = Math.min(Math.floor(x), scale.length - 2);
    return scale[step].clone().lerp(scale[step + 1], x - step).toArray();
  });
}

// The torque or force on a joint: an arc about its axis or an arrow along it. Its size goes with the
// square root of the effort over its peak in the run, so that small ones are seen next to large ones.
const TURN = (300 * Math.PI) / 180;

class Effort {
  constructor(joint, size) {
    Object.assign(this, { joint, size, group: new THREE.Group() });
    const material = over(colourOf(styled("torque")), 0.85);
    const rod = new THREE.CylinderGeometry(0.09, 0.09, 3, 12).rotateX(Math.PI / 2).translate(0, 0, 1.5);
    const shaft = new THREE.Mesh(joint.turns ? new THREE.TorusGeometry(1, 0.09, 8, 40, TURN) : rod, material);
    const head = new THREE.Mesh(new THREE.ConeGeometry(0.234, 0.54, 16), material);
    if (joint.turns) head.position.set(Math.cos(TURN), Math.sin(TURN), 0);
    else head.position.z = 3;
    head.rotation.set(joint.turns ? 0 : Math.PI / 2, 0, joint.turns ? TURN : 0);
    shaft.renderOrder = head.renderOrder = 5;
    joint.group.add(this.group.add(shaft, head));
    this.material = material;
  }

  // relative: effort over its peak, -1 to 1
  set(relative, visible) {
    const amount = Math.sqrt(Math.abs(relative));
    this.group.visible = visible && amount > 0.02;
    if (!this.group.visible) return;
    this.group.scale.setScalar(this.size * amount);
    const direction = this.joint.direction.clone().multiplyScalar(Math.sign(relative));
    this.group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), direction);
  }
}

const SNAPSHOTS = 6; // of the robot along its way
const plain = (colour) => new THREE.MeshPhongMaterial({ color: colourOf(colour) });

// A desired frame, or an arrow for a direction alone.
function desiredAxes(columns, length, colour) {
  if (columns === 4) return new THREE.AxesHelper(length);
  return new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), length, colour);
}

class Run {
  // width: of the lines (m); compared: whether there are others
  constructor(description, scene, width, compared) {
    const { label, colour, info, motion, robot } = description;
    const place = { frame: 0, next: 0, share: 0 };
    Object.assign(this, { description, width, several: compared, label, colour, info, efforts: [], place });
    this.group = new THREE.Group();
    this.shown = { trails: true, efforts: false };
    this.byError = !compared;
    this.robot = robot === null ? null : new Robot(scene.robots[robot], scene.geometries, compared ? colour : null);
    if (this.robot) this.group.add(this.robot.root);
    this.motion = motion ? new Motion(motion) : null;
    if (!motion) return;
    this.materials = { error: new THREE.MeshPhongMaterial({ vertexColors: true }) };
    for (const name of ["run", "platform", "path", "target"]) this.materials[name] = plain(colour);
    const ball = (radius, material) => new THREE.Mesh(new THREE.SphereGeometry(radius, 24, 16), material);
    this.path = tube(this.motion.path, 0.55 * width, this.materials.path);
    this.target = ball(2.6 * width, this.materials.target);
    this.actual = ball(2 * width, this.materials.run);
    this.actual.visible = this.robot === null;
    this.lines = new THREE.Group();
    this.group.add(this.path, this.target, this.actual, this.lines);
    this.drawMotion(scene.error_decades);
    this.setColours();
  }

  // Colours that are not a run's own are those of the style sheet.
  setColours() {
    if (!this.motion) return;
    const own = ["path", "target", ...(this.several ? [] : ["platform"])];
    for (const name of own) this.materials[name].color.copy(colourOf(styled(name)));
    if (this.axes instanceof THREE.ArrowHelper) this.axes.setColor(colourOf(styled("target")));
    for (const { material } of this.efforts) material.color.copy(colourOf(styled("torque")));
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
    const wheels = robot ? robot.description.wheels : [];
    for (const joint of robot ? robot.joints : []) {
      if (!(motion.peaks[joint.q] > 0) || this.efforts.some((effort) => effort.joint === joint)) continue;
      const wheel = wheels.find((one) => one.joint === joint.name);
      this.efforts.push(new Effort(joint, wheel ? 1.25 * wheel.radius : 0.07 * robot.extent));
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
    if (this.robot) this.robot.setConfiguration(this.motion.configuration(this.place));
    this.update();
  }

  update() {
    const { motion, place } = this;
    if (!motion) return;
    for (const line of this.lines.children) showUpTo(line, place.frame);
    this.lines.visible = this.shown.trails;
    this.trail.material = this.byError ? this.materials.error : this.materials.run;
    this.target.position.copy(motion.point(motion.desired, place));
    if (motion.turn) {
      if (!this.axes) this.target.add((this.axes = desiredAxes(motion.turn.columns, 24 * this.width, this.materials.target.color)));
      this.axes.quaternion.copy(motion.turned(place));
    }
    this.actual.position.copy(motion.point(motion.tip, place));
    for (const effort of this.efforts) {
      const q = effort.joint.q;
      effort.set(motion.effort[place.frame * motion.effort.columns + q] / motion.peaks[q], this.shown.efforts);
    }
  }

  // How far another run's tip or platform is (m), whichever is farther.
  distanceTo(other) {
    const offset = this.group.position.clone().sub(other.group.position);
    const apart = ["tip", "platform"].map((track) => {
      const [here, there] = [this, other].map(({ motion, place }) => motion.point(motion[track], place));
      return here.sub(there).add(offset).length();
    });
    return Math.max(...apart);
  }

  // The place of its label: over its platform, or over its tip.
  labelPoint() {
    const point = this.motion.point(this.robot ? this.motion.platform : this.motion.tip, this.place);
    if (this.robot) point.z = 1.08 * this.robot.height;
    return this.group.localToWorld(point);
  }

  // Points to have in view: of its lines, and of the robot along its way, near a box on the ground.
  outline({ min, max }) {
    const near = ({ x, y }) => x >= min.x - 1e-6 && x <= max.x + 1e-6 && y >= min.y - 1e-6 && y <= max.y + 1e-6;
    const { motion, robot, group } = this;
    if (!motion) return [...robot.corners(group), new THREE.Vector3().setFromMatrixPosition(this.pose("tip"))];
    const point = (track, frame) => new THREE.Vector3().fromArray(track, 3 * frame);
    const points = [motion.path, motion.tip, motion.platform].flatMap((track) =>
      Array.from({ length: Math.ceil(track.rows / 10) }, (_, i) => point(track, 10 * i)).filter(near)
    );
    const now = robot && Float64Array.from(robot.q);
    for (let i = 0; robot && i <= SNAPSHOTS; i++) {
      const frame = Math.round((i / SNAPSHOTS) * (motion.frames - 1));
      if (!near(point(motion.platform, frame))) continue;
      robot.setConfiguration(motion.configuration({ frame, next: frame, share: 0 }));
      points.push(...robot.corners(group));
    }
    if (robot) robot.setConfiguration(now);
    return points;
  }

  // The pose of a joint, a link, a part or the tip, in the run's own world.
  pose(name) {
    const object = this.robot && this.robot.named.get(name);
    if (!object) throw new Error(`run ${this.label} has no ${name}`);
    this.group.updateWorldMatrix(true, true);
    return new THREE.Matrix4().copy(this.group.matrixWorld).invert().multiply(object.matrixWorld);
  }
}
