// The page: stage, runs, clock, controls and what is written; following a run while it goes; window.mobman.
const GHOST = 0.62;
const LAG = 0.1; // s, of a run that is followed
const PAUSE = 60; // ms between two questions for its frames
const STRIPE = 7; // px
const TOGETHER = 0.15; // distance of robots that would hide one another, of their size
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

const byId = (id) => document.getElementById(id);

function element(tag, attributes, ...children) {
  const node = Object.assign(document.createElement(tag), attributes);
  node.append(...children);
  return node;
}

// Black or white, whichever is easier to read on a colour (WCAG 2, relative luminance).
function inkOn(colour) {
  const { r, g, b } = colourOf(colour);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.179 ? "#000" : "#fff";
}

function metres(value) {
  if (!Number.isFinite(value)) return "not finite";
  if (value === 0) return "0 m";
  return value >= 0.01 && value < 1e4 ? `${value.toPrecision(3)} m` : `${value.toExponential(1)} m`;
}

class App {
  constructor(scene) {
    Object.assign(this, { scene, layout: scene.layout, time: 0, speed: 1, playing: false, held: null, moved: true, plots: [], live: scene.live === true });
    this.stage = new Stage(byId("pane"), scene.bounds);
    this.several = scene.runs.length > 1;
    this.runs = scene.runs.map((run) => new Run(run, scene, 0.0036 * this.stage.radius, this.several));
    this.stage.root.add(...this.runs.map((run) => run.group));
    this.writeInfo();
    this.addControls();
    this.stage.viewer.controls.addEventListener("start", () => (this.moved = true));
    this.system = window.matchMedia("(prefers-color-scheme: dark)");
    this.system.onchange = () => this.setTheme(byId("theme").value);
    this.setTheme("");
    this.drawPlots();
    this.setLayout(scene.layout);
    this.setTime(scene.start);
    window.addEventListener("resize", () => {
      this.arrange();
      this.changed();
    });
    requestAnimationFrame((now) => this.step(now, 0));
  }

  // now: ms; passed: s since the last step
  step(now, passed) {
    if (this.live) {
      // smoothly, though frames come a few at a time
      const { end } = this.runs[0].motion;
      const late = end - this.time;
      if (late > 0) this.setTime(late < 1e-3 ? end : this.time + late * (1 - Math.exp(-passed / LAG)));
    } else if (this.playing && this.held === null) {
      const time = this.time + passed * this.speed;
      if (time >= this.scene.duration) this.pause();
      this.setTime(time);
    }
    if (this.stage.viewer.needs_render) this.render();
    requestAnimationFrame((then) => this.step(then, (then - now) / 1000));
  }

  render() {
    this.stage.viewer.render();
    const taken = [];
    this.labels.forEach((label, i) => {
      const at = this.stage.project(this.runs[i].labelPoint());
      label.hidden = at === null;
      if (at === null) return;
      const half = label.offsetWidth / 2 + 4;
      at[0] = Math.max(half, Math.min(at[0], window.innerWidth - half));
      // labels of robots at one place stand on each other
      while (taken.some(([x, y]) => Math.abs(x - at[0]) < 110 && Math.abs(y - at[1]) < 22)) at[1] -= 23;
      taken.push(at);
      Object.assign(label.style, { left: `${at[0]}px`, top: `${at[1]}px` });
    });
  }

  changed() {
    this.writeState();
    this.stage.viewer.set_dirty();
  }

  // Robots at one place, as at the start of a comparison, share it in stripes.
  share() {
    const robots = this.runs.filter((run) => run.robot && run.motion);
    for (const run of robots) {
      const near = robots.filter((other) => run.distanceTo(other) < TOGETHER * run.robot.extent);
      run.robot.stripe.value.set(near.indexOf(run), near.length, STRIPE * window.devicePixelRatio);
    }
  }

  // Look at another time for as long as the pointer is there; null: back to the clock's.
  preview(time) {
    if (this.live || (time === null && this.held === null)) return;
    const held = this.held ?? this.time;
    this.setTime(time ?? held, time === null ? null : held);
  }

  // held: the clock's time, where another is only looked at
  setTime(time, held = null) {
    this.held = held;
    this.time = Math.min(Math.max(time, 0), this.scene.duration);
    for (const run of this.runs) run.setTime(this.time);
    this.share();
    this.changed();
  }

  play() {
    if (this.live || !(this.scene.duration > 0)) return;
    this.playing = true;
    this.setTime(this.time >= this.scene.duration ? 0 : this.time);
  }

  pause() {
    this.playing = false;
    this.changed();
  }

  show(layer, visible) {
    const layers = [...document.querySelectorAll("#panel input[type=checkbox]")].map(({ id }) => id.replace("show-", ""));
    if (!layers.includes(layer)) throw new Error(`no layer ${layer}: allowed: ${layers.join(", ")}`);
    if (layer === "ground") for (const object of this.stage.ground) object.visible = visible;
    else for (const run of this.runs) run.show(layer, visible);
    byId(`show-${layer}`).checked = visible;
    this.changed();
  }

  colourTrails(byError) {
    for (const run of this.runs) {
      run.byError = byError;
      run.update();
    }
    this.changed();
  }

  setLayout(layout) {
    this.layout = layout;
    const apart = layout === "side-by-side";
    const paths = new Set();
    for (const run of this.runs) {
      run.group.position.set(...(apart ? run.description.offset : [0, 0]), 0);
      run.group.updateMatrixWorld(true);
      if (run.robot && this.several) run.robot.setOpacity(apart ? 1 : GHOST);
      if (!run.motion) continue;
      // runs of one task have one path
      const path = run.description.motion.desired.data;
      run.path.visible = run.target.visible = apart || !paths.has(path);
      paths.add(path);
    }
    this.share();
    this.look();
  }

  // "light", "dark", or "" for the system's.
  setTheme(theme) {
    byId("theme").value = theme;
    document.documentElement.dataset.theme = theme || (this.system.matches ? "dark" : "light");
    this.stage.setColours();
    for (const run of this.runs) run.setColours();
    this.changed();
  }

  drawPlots() {
    if (!this.runs[0].motion) return;
    this.plots = plotsOf(this);
    byId("plots").replaceChildren(...this.plots.map((plot) => plot.root));
    this.arrange();
  }

  // What depends on the window's size: the plots, and the place of what stands above the clock.
  arrange() {
    for (const plot of this.plots) plot.draw();
    document.body.style.setProperty("--below", `${byId("clock").offsetHeight + 26}px`);
    if (!this.moved) this.look(); // the first view still
  }

  fold(folded) {
    document.body.classList.toggle("folded", folded);
    byId("fold").setAttribute("aria-expanded", !folded);
    this.arrange();
  }

  configure(run, q) {
    this.pause();
    run.robot.setConfiguration(q);
    this.changed();
  }

  // From a direction: three numbers, the name of a preset, or as the scene and the layout have it.
  look(direction = byId("camera").value || this.scene.camera) {
    const presets = this.scene.cameras;
    if (typeof direction === "string" && !presets[direction])
      throw new Error(`no camera ${direction}: allowed: ${Object.keys(presets).join(", ")}`);
    const from = presets[direction] || direction || (this.layout === "side-by-side" ? [0.1, -1, 0.55] : [0.55, -1, 0.55]);
    this.stage.look(this.outline(), from, this.freeParts());
    this.moved = false;
    this.changed();
  }

  // What is to be in view (m).
  outline() {
    const { box } = this.stage;
    const points = this.runs.flatMap((run) => run.outline(box).map((point) => point.add(run.group.position)));
    return points.length ? points : [box.min.clone(), box.max.clone()];
  }

  // The parts of the picture that what is written leaves free.
  freeParts() {
    const taken = ["info", "legend", "menu", "panel", "clock"].map(byId).filter((node) => node.offsetWidth);
    // a robot alone needs more room about it than a path, and labels stand above the robots
    const side = (this.runs[0].motion ? 0.02 : 0.08) * Math.min(window.innerWidth, window.innerHeight);
    const top = side + (this.several ? 23 * this.runs.length : 0);
    return this.stage.freeParts(taken.map((node) => node.getBoundingClientRect()), { side, top });
  }

  // The text that stays: the runs, the colours' meaning, the runs' labels.
  writeInfo() {
    const { runs, several } = this;
    const { motion, info } = runs[0];
    const values = (key) => [...new Set(runs.map((run) => run.info[key]))];
    const same = ["controller", "task", "scenario"].filter((key) => values(key).length === 1 && info[key]);
    document.querySelector("#info h1").append(values("robot").join(", "));
    byId("what").append(motion ? same.map((key) => `${key} ${info[key]}`).join(" · ") : info.description || "");
    this.labels = [];
    if (!motion) return byId("info").append(element("div", { id: "tip" }));
    const swatch = ({ colour }) => element("span", { className: "swatch", style: `background:${colour}` });
    this.cells = runs.map((run) => {
      const cells = { error: element("td", { className: "number" }), status: element("td") };
      const name = element("td", {}, ...(several ? [swatch(run), run.label] : ["|error|"]));
      document.querySelector("#info table").append(element("tr", {}, name, cells.error, cells.status));
      return cells;
    });
    for (const run of runs) {
      if (run.info.problem) byId("info").append(element("div", { className: "bad" }, `${run.label}: the robot is not drawn`));
      const stroke = element("span", { className: "stroke", style: `border-color:${run.colour}` });
      byId("plain").append(element("div", { className: "entry" }, stroke, `tip, ${run.label}`));
    }
    if (several) this.labels = runs.map((run) => element("div", { style: `background:${run.colour};color:${inkOn(run.colour)}` }, run.label));
    byId("labels").append(...this.labels);
    byId("bar").style.background = `linear-gradient(90deg,${SCALE.join(",")})`;
    this.writeScale();
  }

  writeScale() {
    const [low, high] = this.scene.error_decades;
    const powers = [low, Math.round((low + high) / 2), high];
    byId("ticks").replaceChildren(...powers.map((power) => element("span", {}, "10", element("sup", {}, power))));
  }

  // The text and the controls that change with time.
  writeState() {
    const { runs, scene, time } = this;
    byId("time").value = time;
    for (const plot of this.plots) plot.setTime();
    byId("play").textContent = this.playing ? "\u23f8" : "\u25b6";
    byId("now").textContent = `${time.toFixed(2)} / ${scene.duration.toFixed(2)} s`;
    byId("scale").hidden = !runs[0].byError;
    byId("plain").hidden = runs[0].byError;
    byId("efforts").hidden = !runs[0].shown.efforts;
    runs.forEach(({ motion, place, info, robot }, i) => {
      if (!motion) return;
      const { error, status } = this.cells[i];
      const failed = info.status !== "ok";
      const over = time > motion.end + 1e-9 || (failed && time >= motion.end - 1e-9);
      error.textContent = metres(motion.error[place.frame]);
      if (motion.angle) error.textContent += `, ${motion.angle[place.frame].toExponential(1)} rad`;
      status.textContent = this.several ? "" : `t = ${time.toFixed(2)} s`;
      if (over) status.textContent = failed ? `${info.status} ${info.message}` : "ended";
      const beyond = robot ? robot.joints.filter((joint) => joint.beyond).map((joint) => joint.name) : [];
      if (beyond.length) status.textContent += ` beyond limits: ${beyond.join(", ")}`;
      status.className = (over && failed) || beyond.length ? "bad" : "";
    });
    if (!runs[0].motion) {
      const point = new THREE.Vector3().setFromMatrixPosition(runs[0].pose("tip"));
      byId("tip").textContent = `tip ${point.toArray().map((value) => value.toFixed(3)).join("  ")} m`;
    }
    if (!byId("panel").offsetWidth) return;
    for (const { robot, joint, input, output } of this.sliders) {
      const value = robot.q[joint.q];
      // a run goes beyond where a slider would
      if (value < Number(input.min)) input.min = value;
      if (value > Number(input.max)) input.max = value;
      if (document.activeElement !== input) input.value = value;
      output.textContent = `${value.toFixed(3)} ${joint.turns ? "rad" : "m"}`;
    }
  }

  addControls() {
    const { runs, several } = this;
    const { motion } = runs[0];
    const drawn = runs.filter((run) => run.robot);
    const efforts = this.live ? drawn.length : runs.some((run) => run.efforts.length);
    const has = { motion, several, efforts, single: !several, still: !motion, robot: drawn.length };
    for (const node of document.querySelectorAll("[data-needs]"))
      node.hidden = !node.dataset.needs.split(" ").every((need) => has[need]);
    for (const box of document.querySelectorAll("#panel input[type=checkbox]"))
      box.onchange = () => this.show(box.id.replace("show-", ""), box.checked);
    drawn.forEach((run, i) => byId("posed").add(new Option(run.label, i)));
    for (const speed of SPEEDS) byId("speed").add(new Option(`${speed}×`, speed, false, speed === this.speed));
    byId("layout").value = this.layout;
    byId("trail").value = several ? "run" : "error";
    byId("layout").onchange = (event) => this.setLayout(event.target.value);
    byId("trail").onchange = (event) => this.colourTrails(event.target.value === "error");
    byId("posed").onchange = (event) => this.addSliders(drawn[event.target.value]);
    byId("speed").onchange = (event) => (this.speed = Number(event.target.value));
    byId("theme").onchange = (event) => this.setTheme(event.target.value);
    for (const name of Object.keys(this.scene.cameras)) byId("camera").add(new Option(name, name));
    byId("camera").onchange = () => this.look();
    byId("view").onclick = () => this.look();
    byId("rest").onclick = () => this.configure(runs[0], runs[0].robot.description.rest);
    byId("fold").onclick = () => this.fold(!document.body.classList.contains("folded"));
    byId("menu").onclick = () => document.body.classList.toggle("closed");
    const toggle = (byId("play").onclick = () => (this.playing ? this.pause() : this.play()));
    byId("time").oninput = (event) => {
      const wanted = Number(event.target.value); // pausing sets it to what it was
      this.pause();
      this.setTime(wanted);
    };
    const keys = { " ": toggle, ArrowRight: () => this.setTime(this.time + 0.1), ArrowLeft: () => this.setTime(this.time - 0.1) };
    window.addEventListener("keydown", (event) => {
      const typing = event.target.closest("input:not([type=checkbox]), select, button");
      if (this.live || typing || !motion || !keys[event.key]) return;
      keys[event.key]();
      event.preventDefault();
    });
    // there is little room beside or below them
    const narrow = window.matchMedia("(max-width: 719px)");
    const clear = () => {
      if (narrow.matches && (motion || window.innerHeight < 640)) document.body.classList.add("closed");
      this.fold(narrow.matches || window.innerHeight < 640);
    };
    narrow.onchange = clear;
    clear();
    this.setDuration();
    this.sliders = [];
    if (drawn.length) this.addSliders(drawn[0]);
  }

  // The clock is the run's own while it goes.
  setDuration() {
    byId("time").max = this.scene.duration;
    for (const id of ["time", "play"]) byId(id).disabled = this.live;
    byId("speed").hidden = this.live;
    byId("rate").hidden = !this.live;
  }

  addSliders(run) {
    const { robot } = run;
    byId("joints").replaceChildren();
    this.sliders = robot.joints.map((joint) => {
      const { name: title, lower: min, upper: max } = joint;
      const input = element("input", { type: "range", step: "any", min, max, title });
      const output = element("output");
      input.dataset.joint = title;
      input.oninput = () => this.configure(run, robot.q.map((now, i) => (i === joint.q ? Number(input.value) : now)));
      const head = element("div", {}, element("span", { title }, title), output);
      byId("joints").append(element("div", { className: "slider" }, head, input));
      return { robot, joint, input, output };
    });
    this.writeState();
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
  take({ motion, ended, info, rate, error_decades: decades }) {
    const { scene, runs: [run] } = this;
    scene.error_decades = decades || scene.error_decades;
    run.info = info || run.info;
    if (rate) {
      // simulated seconds a second, and their share of those that were asked for
      const [meter, output] = byId("rate").children;
      meter.hidden = !scene.live_speed;
      if (scene.live_speed) meter.value = rate / scene.live_speed;
      output.textContent = `${Number(rate.toPrecision(2))}× real time`;
    }
    if (motion) {
      if (ended) run.motion = new Motion(motion);
      else run.motion.extend(new Motion(motion));
      run.drawMotion(scene.error_decades);
    }
    if (ended) scene.duration = run.motion.end;
    if (motion || ended) this.drawPlots();
    if (!ended) return;
    this.live = false;
    this.writeScale();
    this.setDuration();
    this.setTime(scene.duration);
  }
}

async function start() {
  const scene = JSON.parse(byId("scene").textContent);
  const app = new App(scene);
  await Promise.all(waited);
  app.look();
  app.render();
  if (app.live) app.follow();
  // drawn at once
  const drawn = (act) => (...values) => {
    act(...values);
    app.render();
  };
  Object.assign(window.mobman, {
    app,
    setTime: drawn((time) => (app.pause(), app.setTime(time))), // s
    show: drawn((layer, visible) => app.show(layer, visible)),
    setLayout: drawn((layout) => app.setLayout(layout)),
    setTheme: drawn((theme) => app.setTheme(theme)),
    look: drawn((direction) => (app.look(direction), (app.moved = true))),
    setConfiguration: drawn((q, index = 0) => app.configure(app.runs[index], q)),
    play: () => app.play(),
    pause: () => app.pause(),
    // of a joint, a link, a part or "tip": four rows of four numbers, in the run's world
    pose(name, index = 0) {
      const { elements } = app.runs[index].pose(name).transpose();
      return [0, 4, 8, 12].map((at) => elements.slice(at, at + 4));
    },
    // without controls and with everything that looks good, for pictures; or the robots and lines alone
    picture: drawn((transparent = false) => {
      app.stage.setShadows(true);
      document.body.classList.add("picture");
      document.documentElement.classList.toggle("transparent", transparent);
      if (transparent) app.stage.clear();
      app.look();
    }),
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
