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
