const GHOST = 0.62;
const LAG = 0.1; // s, of a run that is followed
const SNAPSHOTS = 6; // of the robot along its way, for the camera to have in view

// The page: stage, runs, clock and controls.
class App {
  constructor(scene) {
    this.scene = scene;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.live = scene.live === true;
    this.stage = new Stage(byId("pane"), scene.bounds);
    const compared = scene.runs.length > 1;
    this.options = { byError: !compared, efforts: false };
    const paths = [];
    this.runs = scene.runs.map((description) => {
      const key = description.motion ? description.motion.desired.data : "";
      const style = {
        compared,
        width: 0.0036 * this.stage.radius,
      };
      const run = new Run(description, scene, style);
      run.pathIsShownElsewhere = paths.includes(key);
      paths.push(key);
      this.stage.root.add(run.group);
      return run;
    });
    this.overlay = new Overlay(scene, this.runs);
    this.setLayout(scene.layout);
    this.panel = new Panel(this);
    this.setTime(scene.start);
    this.look();
    window.addEventListener("resize", () => this.changed());
    this.last = null;
    requestAnimationFrame((now) => this.step(now));
  }

  step(now) {
    const passed = this.last === null ? 0 : (now - this.last) / 1000;
    this.last = now;
    if (this.live) {
      // smoothly, though frames come a few at a time
      const late = this.runs[0].motion.end - this.time;
      if (late > 0) this.setTime(late < 1e-3 ? this.runs[0].motion.end : this.time + late * (1 - Math.exp(-passed / LAG)));
    } else if (this.playing) {
      const time = this.time + passed * this.speed;
      if (time >= this.scene.duration) this.pause();
      this.setTime(time);
    }
    if (this.stage.viewer.needs_render) this.render();
    requestAnimationFrame((then) => this.step(then));
  }

  render() {
    const pane = byId("pane");
    this.stage.render();
    this.overlay.placeLabels(this.stage, { width: pane.clientWidth, height: pane.clientHeight });
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
    if (layer === "ground") {
      for (const object of this.stage.root.children) if (["grid", "world axes"].includes(object.name)) object.visible = visible;
    } else {
      for (const run of this.runs) run.show(layer, visible);
      if (layer === "efforts") this.options.efforts = visible;
    }
    const input = this.panel.switches.get(layer);
    if (input) input.checked = visible;
    this.changed();
  }

  colourTrails(byError) {
    this.options.byError = byError;
    for (const run of this.runs) run.colourTrailByError(byError);
    this.changed();
  }

  setLayout(layout) {
    this.layout = layout;
    const beside = layout === "side-by-side";
    for (const run of this.runs) {
      const [x, y] = beside ? run.description.offset : [0, 0];
      run.group.position.set(x, y, 0);
      run.group.updateMatrixWorld(true);
      if (run.robot && this.runs.length > 1) run.robot.setOpacity(beside ? 1 : GHOST);
      // runs of one task have one path
      if (run.path) run.path.visible = beside || !run.pathIsShownElsewhere;
      if (run.target) run.target.visible = beside || !run.pathIsShownElsewhere;
    }
    if (this.panel) {
      this.look();
      this.changed();
    }
  }

  rest(run) {
    run.robot.setConfiguration(Float64Array.from(run.robot.description.rest));
    this.changed();
  }

  look(direction) {
    const beside = this.layout === "side-by-side";
    const points = [];
    const box = this.stage.box;
    for (const run of this.runs) {
      const { x, y } = run.group.position;
      const add = (px, py, pz) => points.push(new THREE.Vector3(px + x, py + y, pz));
      if (run.motion) {
        for (const track of [run.motion.path, run.motion.tip, run.motion.platform])
          for (let i = 0; i < track.length; i += 3)
            if (i % 30 === 0 && inside(box, track[i], track[i + 1])) add(track[i], track[i + 1], track[i + 2]);
        if (run.robot) {
          const now = Float64Array.from(run.robot.q);
          for (let i = 0; i <= SNAPSHOTS; i++) {
            const frame = Math.round((i / SNAPSHOTS) * (run.motion.frames - 1));
            if (!inside(box, run.motion.platform[3 * frame], run.motion.platform[3 * frame + 1])) continue;
            run.robot.setConfiguration(run.motion.configuration({ frame, share: 0 }, new Float64Array(now.length)));
            run.corners(add);
          }
          run.robot.setConfiguration(now);
        }
      } else {
        run.corners(add);
        const tip = new THREE.Vector3().setFromMatrixPosition(run.pose("tip"));
        add(tip.x, tip.y, tip.z);
      }
    }
    if (!points.length) points.push(box.min.clone(), box.max.clone());
    this.stage.viewer.set_3d_pane_size();
    this.stage.look(points, direction || (beside ? [0.1, -1, 0.55] : [0.55, -1, 0.55]), this.free());
    this.changed();
  }

  // What the panels leave of the picture, -1 to 1.
  free() {
    const { innerWidth: width, innerHeight: height } = window;
    const picture = document.body.classList.contains("picture");
    const panel = !picture && !document.body.classList.contains("closed") && width > 900;
    const clock = !picture && !byId("clock").hidden;
    const alone = !this.runs[0].motion; // a robot needs more room about it than a path
    return {
      left: alone ? -0.8 : -0.94,
      right: (alone ? 0.8 : 0.94) - (panel ? (2 * 282) / width : 0),
      top: alone || this.runs.length > 1 ? 0.76 : 0.88, // labels stand above the robots
      bottom: (alone ? -0.78 : -0.9) + (clock ? (2 * 64) / height : 0),
    };
  }
}

function inside(box, x, y) {
  const slack = 1e-6;
  return x >= box.min.x - slack && x <= box.max.x + slack && y >= box.min.y - slack && y <= box.max.y + slack;
}
// Following a run while it goes: its frames are asked for from the server that the page came from.
const PAUSE = 60; // ms between two questions

async function follow(app) {
  while (app.live) {
    let news = null;
    try {
      const answer = await fetch(`frames?after=${app.runs[0].motion.end}`, { cache: "no-store" });
      if (answer.ok) news = await answer.json();
    } catch (error) {
      // the process is gone; what it sent remains
    }
    if (news === null) news = { ended: true, info: { ...app.runs[0].info, status: "interrupted", message: "" } };
    take(app, news);
    if (app.live) await new Promise((resolve) => setTimeout(resolve, PAUSE));
  }
}

// More frames; or, when it has ended, all of the run.
function take(app, news) {
  const run = app.runs[0];
  const { scene } = app;
  if (news.motion) {
    const motion = new Motion(news.motion);
    if (news.ended) run.motion = motion;
    else run.motion.extend(motion);
  }
  if (news.error_decades) scene.error_decades = news.error_decades;
  if (news.info) run.description.info = news.info;
  if (news.motion) run.drawMotion(scene.error_decades);
  if (!news.ended) return;
  app.live = false;
  scene.duration = run.motion.end;
  app.overlay.addLegend();
  app.panel.setDuration(scene.duration);
  app.setTime(scene.duration);
}
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
