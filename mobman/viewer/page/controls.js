// What is written over the scene, and the controls.
function element(tag, attributes, ...children) {
  const node = Object.assign(document.createElement(tag), attributes);
  node.append(...children);
  return node;
}

const byId = (id) => document.getElementById(id);

function metres(value) {
  if (!Number.isFinite(value)) return "not finite";
  if (value === 0) return "0 m";
  return value >= 0.01 && value < 1e4 ? `${value.toPrecision(3)} m` : `${value.toExponential(1)} m`;
}

// Who runs, the error now, the colours' meaning, the runs' labels.
class Overlay {
  constructor(scene, runs) {
    Object.assign(this, { scene, runs, labels: [] });
    const box = byId("info");
    const values = (key) => [...new Set(runs.map((run) => run.info[key]))];
    box.append(element("h1", {}, values("robot").join(", ")));
    if (!runs[0].motion) {
      this.tip = element("div", { id: "tip" });
      box.append(element("div", { className: "what" }, runs[0].info.description || ""), this.tip);
      return;
    }
    const same = ["controller", "task", "scenario"].filter((key) => values(key).length === 1 && runs[0].info[key]);
    box.append(element("div", { className: "what" }, same.map((key) => `${key} ${runs[0].info[key]}`).join(" · ")));
    const several = runs.length > 1;
    this.cells = runs.map(() => ({ error: element("td", { className: "number" }), status: element("td") }));
    const rows = runs.map(({ label, colour }, i) => {
      const mark = several ? [element("span", { className: "swatch", style: `background:${colour}` }), label] : ["|error|"];
      return element("tr", {}, element("td", {}, ...mark), this.cells[i].error, this.cells[i].status);
    });
    box.append(element("table", {}, ...rows));
    for (const { info, label } of runs)
      if (info.problem) box.append(element("div", { className: "bad" }, `${label}: the robot is not drawn`));
    this.addLegend();
    if (several) this.labels = runs.map(({ label, colour }) => element("div", { style: `background:${colour}` }, label));
    byId("labels").append(...this.labels);
  }

  addLegend() {
    const stroke = (colour, text) =>
      element("div", { className: "entry" }, element("span", { className: "stroke", style: `border-color:${colour}` }), text);
    const [low, high] = this.scene.error_decades;
    const bar = element("div", { className: "bar", style: `background:linear-gradient(90deg,${SCALE.join(",")})` });
    const powers = [low, Math.round((low + high) / 2), high];
    const ticks = element("div", { className: "ticks" }, ...powers.map((power) => element("span", { innerHTML: `10<sup>${power}</sup>` })));
    const point = element("div", { className: "entry" }, element("span", { className: "dot" }), "desired point now");
    this.scale = element("div", { id: "scale" }, "tip trail, |error| (m)", bar, ticks);
    this.plain = element("div", {}, ...this.runs.map((run) => stroke(run.colour, `tip, ${run.label}`)));
    this.efforts = stroke("#7048e8", "torque (size: √ of its share of the peak)");
    const platform = this.runs.length === 1 ? [stroke("#8a94a3", "platform")] : [];
    byId("legend").replaceChildren(this.scale, this.plain, stroke("#4a5361", "desired path"), point, ...platform, this.efforts);
    byId("legend").hidden = false;
  }

  update(time, { byError, efforts }) {
    if (this.tip) {
      const point = new THREE.Vector3().setFromMatrixPosition(this.runs[0].pose("tip"));
      this.tip.textContent = `tip ${point.toArray().map((value) => value.toFixed(3)).join("  ")} m`;
      return;
    }
    byId("now").textContent = `${time.toFixed(2)} / ${this.scene.duration.toFixed(2)} s`;
    this.runs.forEach((run, i) => {
      const { error, status } = this.cells[i];
      const failed = run.info.status !== "ok";
      const over = run.ended || (failed && time >= run.motion.end - 1e-9);
      error.textContent = metres(run.error);
      if (over) status.textContent = failed ? `${run.info.status} ${run.info.message}` : "ended";
      else status.textContent = this.runs.length > 1 ? "" : `t = ${time.toFixed(2)} s`;
      status.className = over && failed ? "bad" : "";
    });
    this.scale.hidden = !byError;
    this.plain.hidden = byError;
    this.efforts.hidden = !efforts;
  }

  placeLabels(stage) {
    const taken = [];
    this.labels.forEach((label, i) => {
      const at = stage.project(this.runs[i].labelPoint());
      label.hidden = at === null;
      if (at === null) return;
      // labels of robots at one place stand on each other
      while (taken.some(([x, y]) => Math.abs(x - at[0]) < 110 && Math.abs(y - at[1]) < 22)) at[1] -= 23;
      taken.push(at);
      Object.assign(label.style, { left: `${at[0]}px`, top: `${at[1]}px` });
    });
  }
}

// Layer, label, whether it is shown at first, and what a page must have for it.
const LAYERS = [
  ["trails", "Trails", true, "motion"],
  ["efforts", "Torques", false, "efforts"],
  ["visual", "Robot", true, "robot"],
  ["collision", "Collision geometry", false, "robot"],
  ["masses", "Centres of mass", false, "robot"],
  ["frames", "Frames", false, "robot"],
  ["tip", "Tip frame", true, "robot"],
  ["ground", "Grid and axes", true, "ground"],
];
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

// What is shown, how runs are laid out, the clock, and a slider for every coordinate.
class Panel {
  constructor(app) {
    this.app = app;
    this.switches = {};
    const { runs } = app;
    const drawn = runs.filter((run) => run.robot);
    const has = { ground: true, robot: drawn.length, motion: runs[0].motion };
    has.efforts = app.live ? has.robot : runs.some((run) => run.efforts.length);
    const title = (text) => element("h2", {}, text);
    const shown = [title("Show")];
    for (const [layer, label, checked, needs] of LAYERS) {
      if (!has[needs]) continue;
      const onchange = (event) => app.show(layer, event.target.checked);
      this.switches[layer] = element("input", { type: "checkbox", checked, id: `show-${layer}`, onchange });
      shown.push(element("label", { className: "switch" }, this.switches[layer], label));
    }
    if (runs.length > 1) {
      const layouts = [["overlay", "overlay"], ["side-by-side", "side by side"]];
      shown.push(title("Compare"), this.choice("layout", "Layout", layouts, app.layout, (value) => app.setLayout(value)));
    }
    if (has.motion) {
      const colours = [["error", "error"], ["run", "run"]];
      const chosen = app.options.byError ? "error" : "run";
      shown.push(this.choice("trail", "Trail's colour", colours, chosen, (value) => app.colourTrails(value === "error")));
      this.addClock();
    }
    shown.push(element("button", { id: "view", type: "button", onclick: () => app.look() }, "Everything in view"));
    this.joints = element("div", { id: "joints" });
    if (drawn.length) shown.push(title("Joints"));
    const labels = drawn.map((run, i) => [i, run.label]);
    if (drawn.length > 1) shown.push(this.choice("posed", "Of", labels, 0, (value) => this.addSliders(drawn[value])));
    byId("panel").append(...shown, this.joints);
    if (drawn.length) this.addSliders(drawn[0]);
    byId("menu").onclick = () => document.body.classList.toggle("closed");
    if (has.motion && window.innerWidth < 720) document.body.classList.add("closed");
  }

  choice(id, label, values, chosen, act) {
    const select = element("select", { id, onchange: () => act(select.value) });
    for (const [value, text] of values) select.add(new Option(text, value, false, value === chosen));
    return element("label", { className: "choice" }, label, select);
  }

  addClock() {
    const { app } = this;
    byId("clock").hidden = false;
    for (const speed of SPEEDS) byId("speed").add(new Option(`${speed}×`, speed, false, speed === app.speed));
    byId("speed").onchange = (event) => (app.speed = Number(event.target.value));
    byId("play").onclick = () => app.toggle();
    byId("time").oninput = (event) => {
      const wanted = Number(event.target.value); // pausing sets it to what it was
      app.pause();
      app.setTime(wanted);
    };
    this.setDuration(app.scene.duration);
    const keys = { " ": () => app.toggle(), ArrowRight: () => app.setTime(app.time + 0.1), ArrowLeft: () => app.setTime(app.time - 0.1) };
    window.addEventListener("keydown", (event) => {
      const typing = ["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName) && event.target.type !== "checkbox";
      if (app.live || typing || !keys[event.key]) return;
      keys[event.key]();
      event.preventDefault();
    });
  }

  // The clock is the run's own while it goes.
  setDuration(duration) {
    byId("time").max = duration;
    for (const id of ["time", "play", "speed"]) byId(id).disabled = this.app.live;
  }

  addSliders(run) {
    const { app } = this;
    const { robot } = run;
    this.sliders = robot.joints.map((joint) => {
      const { name: title, lower: min, upper: max } = joint;
      const input = element("input", { type: "range", step: "any", min, max, title });
      input.dataset.joint = title;
      input.oninput = () => {
        const value = Number(input.value); // pausing sets it to what it was
        app.pause();
        robot.setConfiguration(robot.q.map((now, i) => (i === joint.q ? value : now)));
        app.changed();
      };
      return { robot, joint, input, output: element("output") };
    });
    const rows = this.sliders.map(({ input, output }) =>
      element("div", { className: "slider" }, element("div", {}, element("span", { title: input.title }, input.title), output), input)
    );
    const rest = element("button", { id: "rest", type: "button", onclick: () => app.rest(run) }, "Back to rest");
    this.joints.replaceChildren(...rows, ...(run.motion ? [] : [rest]));
    this.update();
  }

  update() {
    byId("time").value = this.app.time;
    byId("play").textContent = this.app.playing ? "\u23f8" : "\u25b6";
    const { classList } = document.body;
    if (!this.sliders || classList.contains("closed") || classList.contains("picture")) return;
    for (const { robot, joint, input, output } of this.sliders) {
      const value = robot.q[joint.q];
      // a run goes beyond where a slider would
      if (value < Number(input.min)) input.min = value;
      if (value > Number(input.max)) input.max = value;
      if (document.activeElement !== input) input.value = value;
      output.textContent = `${value.toFixed(3)} ${joint.turns ? "rad" : "m"}`;
    }
  }
}
