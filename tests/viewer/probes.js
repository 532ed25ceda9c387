// What tests ask of a page, besides what it offers to scripts.
() => {
  const run = (index = 0) => mobman.app.runs[index];
  const { Vector3 } = MeshCat.THREE;
  Object.assign(mobman, {
    time: () => mobman.app.time,
    duration: () => mobman.app.scene.duration,
    playing: () => mobman.app.playing,
    live: () => mobman.app.live,
    poses: (names, index) => Object.fromEntries(names.map((name) => [name, mobman.pose(name, index)])),
    joints: (index) => run(index).robot.joints.map(({ name }) => name),
    beyond: (index) => run(index).robot.joints.filter(({ beyond }) => beyond).map(({ name }) => name),
    configuration: (index) => Array.from(run(index).robot.q),
    frameTimes: (index) => Array.from(run(index).motion.t),
    objects: (index) => ["visual", "collision"].flatMap((layer) =>
      (run(index).robot ? run(index).robot.layers[layer] : []).map(
        ({ name, visible, userData: { role, joint } }) => ({ name, layer, visible, role, joint }))),
    // the tip trail's points up to now, as they are drawn: the middles of the tube's rings
    trail: (index) => {
      const { trail, place } = run(index);
      const corner = (i) => new Vector3().fromBufferAttribute(trail.geometry.attributes.position, i);
      return Array.from({ length: place.frame + 1 }, (_, frame) => {
        const middle = new Vector3();
        for (let side = 0; side < 6; side++) middle.addScaledVector(corner(7 * frame + side), 1 / 6);
        return middle.toArray();
      });
    },
  });
}
