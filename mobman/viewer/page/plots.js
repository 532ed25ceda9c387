// Plots under the time line: errors on a logarithmic scale, and torques. Hovering scrubs, a click seeks.
const EDGE = { left: 48, right: 10, top: 22, bottom: 16 }; // px, of a plot
const PLOT_HEIGHT = 96; // px

function svg(tag, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

// A curve as a path: of each column of pixels its first, lowest, highest and last point, so that no peak
// is lost; broken where a value is not finite.
function curvePath({ t, values }, x, y) {
  const columns = new Map();
  values.forEach((value, i) => {
    const column = Math.round(x(t[i]));
    if (!columns.has(column)) columns.set(column, []);
    columns.get(column).push(Number.isFinite(value) ? y(value) : NaN);
  });
  let [path, pen] = ["", "M"];
  for (const [column, heights] of columns) {
    const found = heights.filter(Number.isFinite);
    for (const height of found.length ? new Set([found[0], Math.min(...found), Math.max(...found), found.at(-1)]) : []) {
      path += `${pen}${column} ${height.toFixed(1)}`;
      pen = "L";
    }
    if (!found.length) pen = "M";
  }
  return path;
}

class Plot {
  // curves: label, colour, t and values of each; logarithmic: the decades that it shows, or null; least: it
  // is about what is below 1
  constructor(app, title, curves, logarithmic = null, least = false) {
    Object.assign(this, { app, title, curves, logarithmic, least, pointer: null });
    this.root = svg("svg", { height: PLOT_HEIGHT, role: "img", "aria-label": title });
    this.root.onpointermove = this.root.onpointerdown = (event) => this.point(event);
    this.root.onpointerleave = () => {
      this.pointer = null;
      app.preview(null);
    };
  }

  point(event) {
    const { left, top } = this.root.getBoundingClientRect();
    const share = (event.clientX - left - EDGE.left) / (this.width - EDGE.left - EDGE.right);
    const time = Math.min(Math.max(share, 0), 1) * this.app.scene.duration;
    this.pointer = event.clientY - top;
    if (event.type !== "pointerdown" && event.pointerType !== "touch") this.app.preview(time);
    else if (!this.app.live) this.app.setTime(time);
  }

  draw() {
    this.width = this.root.clientWidth;
    if (!this.width) return; // folded
    const [right, bottom] = [this.width - EDGE.right, PLOT_HEIGHT - EDGE.bottom];
    const duration = this.app.scene.duration || 1;
    const [low, high] = this.logarithmic || this.range();
    this.x = (time) => EDGE.left + (time / duration) * (right - EDGE.left);
    const at = (level) => bottom - ((Math.min(Math.max(level, low), high) - low) / (high - low)) * (bottom - EDGE.top);
    this.y = this.logarithmic ? (value) => at(value === 0 ? low : Math.log10(Math.abs(value))) : at;
    const levels = this.logarithmic ? [low, this.least ? 0 : Math.round((low + high) / 2), high] : [low, 0, high];
    const nodes = [...new Set(levels)].flatMap((level) => {
      const name = this.logarithmic ? `1e${level}` : Number(level.toPrecision(2)).toString();
      const attributes = { x: EDGE.left - 6, y: at(level) + 4, "text-anchor": "end" };
      const rule = svg("line", { class: "rule", x1: EDGE.left, x2: right, y1: at(level), y2: at(level) });
      const crowded = levels.some((other) => other !== level && level === levels[1] && Math.abs(at(other) - at(level)) < 12);
      return crowded ? [rule] : [rule, svg("text", attributes, name.replace("-", "\u2212"))];
    });
    nodes.push(...[0, 0.5, 1].map((share) => {
      const anchor = ["start", "middle", "end"][2 * share];
      const attributes = { x: this.x(share * duration), y: PLOT_HEIGHT - 3, "text-anchor": anchor };
      return svg("text", attributes, `${Number((share * duration).toPrecision(3))} s`);
    }));
    nodes.push(...this.curves.map((curve) =>
      svg("path", { class: "curve", d: curvePath(curve, this.x, this.y), stroke: curve.colour })
    ));
    this.cursor = svg("line", { class: "cursor", y1: EDGE.top, y2: bottom });
    this.value = svg("text", { class: "value", x: right, y: 12, "text-anchor": "end" });
    const title = svg("text", { x: EDGE.left, y: 12 }, this.title);
    this.root.replaceChildren(...nodes, title, this.cursor, this.value);
    this.room = right - EDGE.left - title.getComputedTextLength() - 8;
    this.setTime();
  }

  // The range of what is finite, with 0 in it.
  range() {
    let [low, high] = [0, 0];
    for (const { values } of this.curves)
      for (const value of values) if (Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
    return low < high ? [low, high] : [-1, 1];
  }

  // The time now, and the value of the curve next to the pointer, or else of the largest (or least).
  setTime() {
    if (!this.cursor) return;
    const x = this.x(this.app.time);
    for (const end of ["x1", "x2"]) this.cursor.setAttribute(end, x);
    const now = this.curves.map(({ label, t, values }) => ({ label, value: values[lastAt(t, this.app.time)] }));
    const off = ({ value }) => {
      if (!Number.isFinite(value)) return Infinity;
      return this.pointer === null ? (this.least ? 1 : -1) * Math.abs(value) : Math.abs(this.y(value) - this.pointer);
    };
    const nearest = now.reduce((best, one) => (off(one) < off(best) ? one : best), now[0]);
    const number = Number(nearest.value.toPrecision(3));
    this.value.textContent = `${nearest.label} ${number}`;
    if (this.value.getComputedTextLength() > this.room) this.value.textContent = number; // the name is above
  }
}

const column = (table, i) => Float32Array.from({ length: table.rows }, (_, row) => table[table.columns * row + i]);
const ofRows = (table, pick) =>
  Float32Array.from({ length: table.rows }, (_, row) => pick(...table.subarray(table.columns * row, table.columns * (row + 1))));
const largest = (...row) => Math.max(...row.map(Math.abs));
const least = (...row) => Math.min(...row.map((value) => (Number.isFinite(value) ? value : Infinity)));

// The decades of some curves, with 1 inside.
function decadesAround(curves) {
  let [low, high] = [-1, 1];
  for (const { values } of curves)
    for (const value of values)
      if (value > 0 && value < Infinity) [low, high] = [Math.min(low, Math.floor(Math.log10(value))), Math.max(high, Math.ceil(Math.log10(value)))];
  return [Math.max(low, -6), Math.min(high, 6)];
}

// Of one run the torque on every joint, and the margins of both stages; of several the largest, and the
// least, of each.
function plotsOf(app) {
  const { runs, several, scene } = app;
  const curve = (run, values) => ({ label: several ? run.label : "", colour: run.colour, t: run.motion.t, values });
  const each = (run, table, columns, pick) => {
    if (several) return curve(run, ofRows(table, pick));
    const colour = (i) => scene.palette[i % scene.palette.length];
    return columns.map(([label, index], i) => ({ ...curve(run, column(table, index)), label, colour: colour(i) }));
  };
  const errors = runs.map((run) => curve(run, run.motion.error));
  const plots = [new Plot(app, "|error| (m)", errors, scene.error_decades)];
  const driven = runs.filter((run) => run.efforts.length);
  if (driven.length) {
    const slides = driven.some((run) => run.efforts.some(({ joint }) => !joint.turns));
    const unit = slides ? "(N m; N where it slides)" : "(N m)";
    const joints = (run) => run.efforts.map(({ joint }) => [joint.name, joint.q]);
    const torques = driven.flatMap((run) => each(run, run.motion.effort, joints(run), largest));
    plots.push(new Plot(app, `${several ? "largest |torque|" : "torque"} ${unit}`, torques));
  }
  const monitored = runs.filter((run) => run.motion.margins);
  if (monitored.length) {
    const stages = [["kinematic", 0], ["dynamic", 1]];
    const margins = monitored.flatMap((run) => each(run, run.motion.margins, stages, least));
    plots.push(new Plot(app, "margin of the gains, enough from 1 on", margins, decadesAround(margins), true));
  }
  return plots;
}
