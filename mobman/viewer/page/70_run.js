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
