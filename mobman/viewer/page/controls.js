// What is written over the scene: who runs, the error now, the colours' meaning, the runs' labels.
function element(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name in node && name !== "style") node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

const byId = (id) => document.getElementById(id);

function metres(value) {
  if (!Number.isFinite(value)) return "not finite";
  if (value === 0) return "0 m";
  return value >= 0.01 && value < 1e4 ? `${value.toPrecision(3)} m` : `${value.toExponential(1)} m`;
}

class Overlay {
  constructor(scene, runs) {
    this.scene = scene;
    this.runs = runs;
    this.cells = [];
    const box = byId("info");
    const infos = runs.map((run) => run.info);
    const same = (key) => (new Set(infos.map((info) => info[key])).size === 1 ? infos[0][key] : null);
    const title = same("robot") || [...new Set(infos.map((info) => info.robot))].join(", ");
    box.append(element("h1", {}, title));
    if (!runs[0].motion) {
      box.append(element("div", { className: "what" }, infos[0].description || ""));
      this.tip = element("div", { id: "tip" });
      box.append(this.tip);
      return;
    }
    const what = [["controller", same("controller")], ["task", same("task")], ["scenario", same("scenario")]];
    box.append(element("div", { className: "what" }, what.filter((entry) => entry[1]).map((entry) => entry.join(" ")).join(" · ")));
    const table = element("table", {});
    for (const run of runs) {
      const cell = { error: element("td", { className: "number" }), status: element("td", {}) };
      const name = runs.length > 1 ? run.label : "|error|";
      const mark = runs.length > 1 ? [element("span", { className: "swatch", style: `background:${run.colour}` })] : [];
      table.append(element("tr", {}, element("td", {}, ...mark, name), cell.error, cell.status));
      this.cells.push(cell);
    }
    box.append(table);
    for (const run of runs)
      if (run.info.problem) box.append(element("div", { className: "bad" }, `${run.label}: the robot is not drawn`));
    this.addLegend();
    if (runs.length > 1)
      this.labels = runs.map((run) => {
        const label = element("div", { style: `background:${run.colour}` }, run.label);
        byId("labels").append(label);
        return label;
      });
  }

  addLegend() {
    const legend = byId("legend");
    legend.hidden = false;
    legend.replaceChildren();
    const stroke = (colour, text) =>
      element("div", { className: "entry" }, element("span", { className: "stroke", style: `border-color:${colour}` }), text);
    const [low, high] = this.scene.error_decades;
    const bar = element("div", { className: "bar", style: `background:linear-gradient(90deg,${SCALE.join(",")})` });
    const middle = Math.round((low + high) / 2);
    const ticks = element("div", { className: "ticks" }, ...[low, middle, high].map((power) => element("span", { innerHTML: `10<sup>${power}</sup>` })));
    this.scale = element("div", { id: "scale" }, "tip trail, |error| (m)", bar, ticks);
    this.plain = element("div", { id: "plain" }, ...this.runs.map((run) => stroke(run.colour, `tip, ${run.label}`)));
    const point = element("div", { className: "entry" }, element("span", { className: "dot", style: "background:#111827" }), "desired point now");
    legend.append(this.scale, this.plain, stroke("#4a5361", "desired path"), point);
    if (this.runs.length === 1) legend.append(stroke("#8a94a3", "platform"));
    this.efforts = stroke("#7048e8", "torque (size: √ of its share of the peak)");
    legend.append(this.efforts);
  }

  update(time, options) {
    if (this.tip) {
      const point = new THREE.Vector3().setFromMatrixPosition(this.runs[0].pose("tip"));
      this.tip.textContent = `tip ${point.toArray().map((value) => value.toFixed(3)).join("  ")} m`;
      return;
    }
    byId("now").textContent = `${time.toFixed(2)} / ${this.scene.duration.toFixed(2)} s`;
    this.runs.forEach((run, i) => {
      this.cells[i].error.textContent = metres(run.error);
      const failed = run.info.status !== "ok";
      const over = run.ended || (failed && time >= run.motion.end - 1e-9);
      const ending = failed ? `${run.info.status} ${run.info.message}` : "ended";
      this.cells[i].status.textContent = over ? ending : this.runs.length > 1 ? "" : `t = ${time.toFixed(2)} s`;
      this.cells[i].status.className = over && failed ? "bad" : "";
    });
    this.scale.hidden = !options.byError;
    this.plain.hidden = options.byError;
    this.efforts.hidden = !options.efforts;
  }

  placeLabels(stage, size) {
    if (!this.labels) return;
    const point = new THREE.Vector3();
    const taken = [];
    this.runs.forEach((run, i) => {
      const at = stage.project(run.labelPoint(point), size);
      this.labels[i].hidden = at === null;
      if (at === null) return;
      // labels of robots at one place stand on each other
      while (taken.some(([x, y]) => Math.abs(x - at[0]) < 110 && Math.abs(y - at[1]) < 22)) at[1] -= 23;
      taken.push(at);
      this.labels[i].style.left = `${at[0]}px`;
      this.labels[i].style.top = `${at[1]}px`;
    });
  }
}
// The controls: what is shown, how runs are laid out, and a slider for every coordinate.
const LAYERS = [
  ["trails", "Trails", true, "motion"],
  ["efforts", "Torques", false, "efforts"],
  ["visual", "Robot", true, "robot"],
  ["collision", "Collision geometry", false, "robot"],
  ["masses", "Centres of mass", false, "robot"],
  ["frames", "Frames", false, "robot"],
  ["tip", "Tip frame", true, "robot"],
];
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

class Panel {
  constructor(app) {
    this.app = app;
    this.sliders = [];
    this.switches = new Map();
    const panel = byId("panel");
    const runs = app.runs;
    const has = {
      motion: runs.some((run) => run.motion),
      robot: runs.some((run) => run.robot),
      efforts: runs.some((run) => run.efforts.length || (app.live && run.robot)),
    };
    panel.append(element("h2", {}, "Show"));
    for (const [layer, label, on, needs] of LAYERS)
      if (has[needs]) panel.append(this.addSwitch(layer, label, on));
    panel.append(this.addSwitch("ground", "Grid and axes", true));
    if (runs.length > 1) {
      panel.append(element("h2", {}, "Compare"));
      panel.append(this.addChoice("layout", "Layout", [["overlay", "overlay"], ["side-by-side", "side by side"]], app.layout, (value) => app.setLayout(value)));
    }
    if (has.motion) {
      const colours = [["error", "error"], ["run", "run"]];
      panel.append(this.addChoice("trail", "Trail's colour", colours, app.options.byError ? "error" : "run", (value) => app.colourTrails(value === "error")));
      this.addClock();
    }
    panel.append(element("button", { id: "view", type: "button", onclick: () => app.look() }, "Everything in view"));
    this.joints = element("div", { id: "joints" });
    if (has.robot) {
      panel.append(element("h2", {}, "Joints"));
      const drawn = runs.map((run, i) => [i, run]).filter(([, run]) => run.robot);
      if (drawn.length > 1)
        panel.append(this.addChoice("posed", "Of", drawn.map(([i, run]) => [String(i), run.label]), String(drawn[0][0]), (value) => this.addSliders(Number(value))));
      panel.append(this.joints);
      this.addSliders(drawn[0][0]);
    }
    byId("menu").onclick = () => document.body.classList.toggle("closed");
    if (has.motion && window.innerWidth < 720) document.body.classList.add("closed");
  }

  addSwitch(layer, label, on) {
    const input = element("input", { type: "checkbox", checked: on, id: `show-${layer}` });
    input.onchange = () => this.app.show(layer, input.checked);
    this.switches.set(layer, input);
    return element("label", { className: "switch" }, input, label);
  }

  addChoice(id, label, values, chosen, act) {
    const select = element("select", { id });
    for (const [value, text] of values) select.append(element("option", { value, selected: value === chosen }, text));
    select.onchange = () => act(select.value);
    return element("label", { className: "choice" }, label, select);
  }

  addClock() {
    const app = this.app;
    byId("clock").hidden = false;
    const speed = byId("speed");
    const speeds = [...new Set([...SPEEDS, app.speed])].sort((a, b) => a - b);
    for (const value of speeds) speed.append(element("option", { value, selected: value === app.speed }, `${value}×`));
    speed.onchange = () => (app.speed = Number(speed.value));
    byId("play").onclick = () => app.toggle();
    const time = byId("time");
    this.setDuration(app.scene.duration);
    time.oninput = () => {
      const wanted = Number(time.value); // pausing sets it to what it was
      app.pause();
      app.setTime(wanted);
    };
    window.addEventListener("keydown", (event) => {
      if (app.live) return;
      if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName) && event.target.type !== "checkbox") return;
      if (event.key === " ") app.toggle();
      else if (event.key === "ArrowRight") app.setTime(app.time + 0.1);
      else if (event.key === "ArrowLeft") app.setTime(app.time - 0.1);
      else return;
      event.preventDefault();
    });
  }

  // The clock is the run's own while it goes.
  setDuration(duration) {
    byId("time").max = duration;
    for (const id of ["time", "play", "speed"]) byId(id).disabled = this.app.live;
  }

  addSliders(index) {
    this.posed = this.app.runs[index];
    this.joints.replaceChildren();
    this.sliders = this.posed.robot.joints.map((joint) => {
      const output = element("output", {});
      const input = element("input", { type: "range", step: "any", min: joint.lower, max: joint.upper, title: joint.name });
      input.dataset.joint = joint.name;
      input.oninput = () => {
        const value = Number(input.value); // pausing sets it to what it was
        this.app.pause();
        this.posed.robot.q[joint.q] = value;
        this.posed.robot.setConfiguration(Float64Array.from(this.posed.robot.q));
        this.app.changed();
      };
      const row = element("div", { className: "slider" }, element("div", {}, element("span", { title: joint.name }, joint.name), output), input);
      this.joints.append(row);
      return { joint, input, output };
    });
    if (!this.posed.motion) {
      const rest = element("button", { id: "rest", type: "button", onclick: () => this.app.rest(this.posed) }, "Back to rest");
      this.joints.append(rest);
    }
    this.update();
  }

  update() {
    byId("time").value = this.app.time;
    byId("play").textContent = this.app.playing ? "\u23f8" : "\u25b6";
    if (!this.posed || document.body.classList.contains("closed") || document.body.classList.contains("picture")) return;
    for (const { joint, input, output } of this.sliders) {
      const value = this.posed.robot.q[joint.q];
      // a run goes beyond where a slider would
      if (value < Number(input.min)) input.min = value;
      if (value > Number(input.max)) input.max = value;
      if (document.activeElement !== input) input.value = value;
      output.textContent = joint.turns ? `${value.toFixed(3)} rad` : `${value.toFixed(3)} m`;
    }
  }
}
