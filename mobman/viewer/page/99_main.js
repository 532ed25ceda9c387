// Start, and what can be asked of the page from outside: window.mobman.
async function start() {
  const scene = JSON.parse(byId("scene").textContent);
  const app = new App(scene);
  await Promise.all(waited);
  app.stage.viewer.set_3d_pane_size();
  app.look();
  app.render();
  if (app.live) follow(app);
  const run = (index) => app.runs[index || 0];
  Object.assign(window.mobman, {
    app,
    // seconds; drawn at once
    setTime(time) {
      app.pause();
      app.setTime(time);
      app.render();
    },
    time: () => app.time,
    duration: () => scene.duration,
    play: () => app.play(),
    pause: () => app.pause(),
    playing: () => app.playing,
    // whether it follows a run that still goes
    live: () => app.live,
    // of a joint, a link, a part or "tip": four rows of four numbers, in the run's world
    pose: (name, index) => rowsOf(run(index).pose(name)),
    poses: (names, index) => Object.fromEntries(names.map((name) => [name, rowsOf(run(index).pose(name))])),
    joints: (index) => run(index).robot.joints.map((joint) => joint.name),
    configuration: (index) => Array.from(run(index).robot.q),
    setConfiguration(q, index) {
      app.pause();
      run(index).robot.setConfiguration(q);
      app.changed();
      app.render();
    },
    // what is in the scene: name, role, whether it is shown
    objects: (index) =>
      run(index).description.robot === null
        ? []
        : ["visual", "collision"].flatMap((layer) =>
            run(index).robot.layers[layer].map((mesh) => ({ name: mesh.name, layer, visible: mesh.visible, role: mesh.userData.role, joint: mesh.userData.joint }))
          ),
    // the tip trail's points up to now, as they are drawn: the middles of the tube's rings
    trail(index) {
      const { trail, place } = run(index);
      const position = trail.geometry.attributes.position.array;
      const points = [];
      for (let i = 0; i <= place.frame; i++) {
        const sum = [0, 0, 0];
        for (let k = 0; k < SIDES; k++) for (let j = 0; j < 3; j++) sum[j] += position[3 * (SIDES * i + k) + j] / SIDES;
        points.push(sum);
      }
      return points;
    },
    frameTimes: (index) => Array.from(run(index).motion.t),
    show: (layer, visible) => {
      app.show(layer, visible);
      app.render();
    },
    setLayout: (layout) => {
      app.setLayout(layout);
      app.render();
    },
    colourTrails: (byError) => {
      app.colourTrails(byError);
      app.render();
    },
    look: (direction) => {
      app.look(direction);
      app.render();
    },
    // without controls and with everything that looks good, for pictures
    picture() {
      app.stage.setShadows(true);
      document.body.classList.add("picture");
      app.look();
      app.render();
    },
  });
  return true;
}

window.mobman = {};
window.mobman.ready = start().catch((error) => {
  const failure = byId("failure");
  failure.hidden = false;
  failure.textContent = `This page cannot be shown: ${error.message || error}`;
  console.error(error);
  throw error;
});
