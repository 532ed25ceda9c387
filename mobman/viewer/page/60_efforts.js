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
