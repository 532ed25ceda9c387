// The page: stage, runs, clock and controls; following a run while it goes; and window.mobman.
const GHOST = 0.62;
const LAG = 0.1; // s, of a run that is followed
const PAUSE = 60; // ms between two questions for its frames

class App {
  constructor(scene) {
    Object.assign(this, { scene, time: 0, speed: 1, playing: false, live: scene.live === true });
    this.stage = new Stage(byId("pane"), scene.bounds);
    const compared = scene.runs.length > 1;
    this.options = { byError: !compared, efforts: false };
    this.runs = scene.runs.map((description) => new Run(description, scene, 0.0036 * this.stage.radius, compared));
    this.stage.root.add(...this.runs.map((run) => run.group));
    this.overlay = new Overlay(scene, this.runs);
    this.layout = scene.layout;
    this.panel = new Panel(this);
    this.setLayout(scene.layout);
    this.setTime(scene.start);
    window.addEventListener("resize", () => this.changed());
    requestAnimationFrame((now) => this.step(now, 0));
  }

  // now: ms; passed: s since the last step
  step(now, passed) {
    if (this.live) {
      // smoothly, though frames come a few at a time
      const { end } = this.runs[0].motion;
      const late = end - this.time;
      if (late > 0) this.setTime(late < 1e-3 ? end : this.time + late * (1 - Math.exp(-passed / LAG)));
    } else if (this.playing) {
      const time = this.time + passed * this.speed;
      if (time >= this.scene.duration) this.pause();
      this.setTime(time);
    }
    if (this.stage.viewer.needs_render) this.render();
    requestAnimationFrame((then) => this.step(then, (then - now) / 1000));
  }

  render() {
    this.stage.viewer.render();
    this.overlay.placeLabels(this.stage);
  }

  changed() {
    this.overlay.update(this.time, this.options);
    this.panel.update();
    this.stage.viewer.set_dirty();
  }

  setTime(time) {
    this.time = Math.min(Math.max(time, 0), this.scene.duration);
    for (const run of this.runs) run.setTime(this.time);
    this.changed();
  }

  play() {
    if (this.live || !(this.scene.duration > 0)) return;
    if (this.time >= this.scene.duration) this.setTime(0);
    this.playing = true;
    this.changed();
  }

  pause() {
    this.playing = false;
    this.changed();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  show(layer, visible) {
    if (layer === "ground") for (const object of this.stage.ground) object.visible = visible;
    else for (const run of this.runs) run.show(layer, visible);
    if (layer === "efforts") this.options.efforts = visible;
    if (this.panel.switches[layer]) this.panel.switches[layer].checked = visible;
    this.changed();
  }

  colourTrails(byError) {
    this.options.byError = byError;
    for (const run of this.runs) {
      run.byError = byError;
      run.update();
    }
    this.changed();
  }

  setLayout(layout) {
    this.layout = layout;
    const beside = layout === "side-by-side";
    const paths = new Set();
    for (const run of this.runs) {
      run.group.position.set(...(beside ? run.description.offset : [0, 0]), 0);
      run.group.updateMatrixWorld(true);
      if (run.robot && this.runs.length > 1) run.robot.setOpacity(beside ? 1 : GHOST);
      if (!run.motion) continue;
      // runs of one task have one path
      const path = run.description.motion.desired.data;
      run.path.visible = run.target.visible = beside || !paths.has(path);
      paths.add(path);
    }
    this.look();
  }

  rest(run) {
    run.robot.setConfiguration(run.robot.description.rest);
    this.changed();
  }

  look(direction) {
    const beside = this.layout === "side-by-side";
    const { box } = this.stage;
    const points = this.runs.flatMap((run) => run.outline(box).map((point) => point.add(run.group.position)));
    if (!points.length) points.push(box.min.clone(), box.max.clone());
    this.stage.look(points, direction || (beside ? [0.1, -1, 0.55] : [0.55, -1, 0.55]), this.free());
    this.changed();
  }

  // What the panels leave of the picture, -1 to 1.
  free() {
    const { innerWidth: width, innerHeight: height } = window;
    const { classList } = document.body;
    const picture = classList.contains("picture");
    const panel = !picture && !classList.contains("closed") && width > 900;
    const clock = !picture && !byId("clock").hidden;
    const alone = !this.runs[0].motion; // a robot needs more room about it than a path
    return {
      left: alone ? -0.8 : -0.94,
      right: (alone ? 0.8 : 0.94) - (panel ? (2 * 282) / width : 0),
      top: alone || this.runs.length > 1 ? 0.76 : 0.88, // labels stand above the robots
      bottom: (alone ? -0.78 : -0.9) + (clock ? (2 * 64) / height : 0),
    };
  }

  // Follow a run while it goes: its frames are asked for from the server that the page came from.
  async follow() {
    while (this.live) {
      let news = { ended: true, info: { ...this.runs[0].info, status: "interrupted", message: "" } };
      try {
        const answer = await fetch(`frames?after=${this.runs[0].motion.end}`, { cache: "no-store" });
        if (answer.ok) news = await answer.json();
      } catch (error) {
        // the process is gone; what it sent remains
      }
      this.take(news);
      if (this.live) await new Promise((resolve) => setTimeout(resolve, PAUSE));
    }
  }

  // More frames; or, when it has ended, all of the run.
  take({ motion, ended, info, error_decades: decades }) {
    const [run] = this.runs;
    const { scene } = this;
    scene.error_decades = decades || scene.error_decades;
    run.description.info = info || run.info;
    if (motion) {
      if (ended) run.motion = new Motion(motion);
      else run.motion.extend(new Motion(motion));
      run.drawMotion(scene.error_decades);
    }
    if (!ended) return;
    this.live = false;
    scene.duration = run.motion.end;
    this.overlay.addLegend();
    this.panel.setDuration(scene.duration);
    this.setTime(scene.duration);
  }
}

// A rigid placement as rows of numbers, for whoever asks from outside.
const rowsOf = ({ elements }) => [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => elements[4 * column + row]));

async function start() {
  const scene = JSON.parse(byId("scene").textContent);
  const app = new App(scene);
  await Promise.all(waited);
  app.look();
  app.render();
  if (app.live) app.follow();
  const run = (index = 0) => app.runs[index];
  // drawn at once
  const drawn = (name, before = () => {}) => (...values) => {
    before();
    app[name](...values);
    app.render();
  };
  Object.assign(window.mobman, {
    app,
    setTime: drawn("setTime", () => app.pause()), // s
    show: drawn("show"),
    setLayout: drawn("setLayout"),
    colourTrails: drawn("colourTrails"),
    look: drawn("look"),
    play: () => app.play(),
    pause: () => app.pause(),
    time: () => app.time,
    duration: () => scene.duration,
    playing: () => app.playing,
    live: () => app.live, // whether it follows a run that still goes
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
      ["visual", "collision"].flatMap((layer) =>
        (run(index).robot ? run(index).robot.layers[layer] : []).map(({ name, visible, userData: { role, joint } }) => ({ name, layer, visible, role, joint }))
      ),
    // the tip trail's points up to now, as they are drawn: the middles of the tube's rings
    trail(index) {
      const { trail, place } = run(index);
      const corner = (i) => new THREE.Vector3().fromBufferAttribute(trail.geometry.attributes.position, i);
      return Array.from({ length: place.frame + 1 }, (_, frame) => {
        const middle = new THREE.Vector3();
        for (let side = 0; side < SIDES; side++) middle.addScaledVector(corner(RING * frame + side), 1 / SIDES);
        return middle.toArray();
      });
    },
    frameTimes: (index) => Array.from(run(index).motion.t),
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
