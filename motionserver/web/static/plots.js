// Rolling plots of the last twenty seconds.
import { POSE, byId, fixed, isNumber, list, make } from "./dom.js";

const SPAN = 20;
const AXIS = { stroke: "#8b99a6", font: "11px system-ui, sans-serif", grid: { stroke: "#222c36", width: 1 }, ticks: { show: false } };
const FORCE = ["x  surge", "y  sway", "z  heave"];

function symmetric(least) {
  return (_, low, high) => {
    const top = Math.max(Math.abs(low || 0), Math.abs(high || 0), least) * 1.12;
    return [-top, top];
  };
}

class Plot {
  constructor(parent, height, series, { bands, range, lastRow, size }) {
    this.box = make("div", "plot");
    this.title = make("p");
    this.box.append(this.title);
    parent.append(this.box);
    this.height = height + (lastRow ? 18 : 0);
    const x = { ...AXIS, size: lastRow ? 26 : 8, values: (_, ticks) => ticks.map((t) => (lastRow ? `${t} s` : "")) };
    const y = { ...AXIS, size: size || 44, splits: (u) => { const top = nice(u.scales.y.max * 0.8); return [-top, 0, top]; },
      values: (_, ticks) => ticks.map((t) => String(Number(t.toPrecision(3))).replace("-", "−")) };
    this.plot = new uPlot({
      width: 300, height: this.height, legend: { show: false }, cursor: { show: false }, padding: [4, 8, 0, 0],
      scales: { x: { time: false, range: [-SPAN, 0] }, y: { range } }, axes: [x, y],
      series: [{}, ...series.map((s) => ({ points: { show: false }, spanGaps: false, ...s }))], bands,
    }, [[], ...series.map(() => [])], this.box);
    new ResizeObserver(() => this.fit()).observe(this.box);
    this.fit();
  }

  fit() {
    if (this.box.clientWidth) this.plot.setSize({ width: this.box.clientWidth, height: this.height });
  }
}

function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((k) => k * power).find((k) => k <= value) || power;
}

export class Plots {
  constructor() {
    this.rows = [];
    const wanted = { stroke: "#e8edf2", width: 1.6, dash: [6, 4] };
    const felt = { stroke: "#56b4e9", width: 2.2 };
    const measured = { stroke: "#e69f00", width: 1.3, dash: [2, 3] };
    this.forces = FORCE.map((_, i) => new Plot(byId("forces"), 118, [wanted, measured, felt], { range: symmetric(1), lastRow: i === 2 }));
    this.sides = [];
    const edge = { stroke: "#35c9a3", width: 1.4 };
    const box = { stroke: "#8fa1b3", width: 1.2, dash: [5, 4] };
    this.axes = POSE.map((p, i) => new Plot(byId("xmax"), 104, [edge, edge, box, box, felt],
      { bands: [{ series: [1, 2], fill: "rgba(53,201,163,.13)" }], range: symmetric(1), lastRow: i > 3, size: 40 }));
  }

  // Thin lines of the engines beside; a plot's series are changed only when the engines are.
  beside(names, colour) {
    if (names.join() === this.sides.join()) return;
    for (const { plot } of this.forces) {
      plot.setData([[], [], [], []], false);
      while (plot.series.length > 4) plot.delSeries(plot.series.length - 1);
      for (const name of names) plot.addSeries({ stroke: colour(name), width: 1.3, points: { show: false }, spanGaps: false });
    }
    this.sides = [...names];
    byId("side-keys").replaceChildren(...names.map((name) => {
      const key = make("span", "key side", name);
      key.style.setProperty("--line-colour", colour(name));
      return key;
    }));
  }

  add(status) {
    const time = status.t_ns / 1e9;
    if (this.rows.length && time <= this.rows.at(-1).time) this.rows = [];
    const alive = status.processes.planner.alive;
    const planner = (alive && status.planner) || {};
    const guard = (status.processes.guard.alive && status.guard) || {};
    const three = (values) => [0, 1, 2].map((i) => (isNumber(list(values)[i]) ? values[i] : null));
    this.rows.push({
      time, wanted: three(planner.wanted_force), felt: three(planner.felt_force), measured: three(planner.measured_force),
      sides: new Map(list(planner.side?.engines).map((engine) => [engine.name, three(engine.felt_force)])),
      x_max: list(planner.x_max), pose: list(guard.pose),
      // the box is drawn only where it is a limit: elsewhere the legs decide
      box: list(status.machine?.box).map((size, i) => (isNumber(list(planner.x_max)[i]) ? size : null)),
    });
    while (this.rows.length && this.rows[0].time < time - SPAN - 1) this.rows.shift();
  }

  draw() {
    const rows = this.rows;
    if (!rows.length) return;
    const now = rows.at(-1).time;
    const times = rows.map((r) => r.time - now);
    const last = rows.at(-1);
    this.forces.forEach((plot, i) => {
      plot.plot.setData([times, rows.map((r) => r.wanted[i]), rows.map((r) => r.measured[i]), rows.map((r) => r.felt[i]),
        ...this.sides.map((name) => rows.map((r) => r.sides.get(name)?.[i] ?? null))]);
      caption(plot.title, FORCE[i], `felt ${fixed(last.felt[i], 2)}, wanted ${fixed(last.wanted[i], 2)} m/s²`);
    });
    this.axes.forEach((plot, i) => {
      const [name, unit, k, digits] = POSE[i];
      const column = (key, sign = 1) => rows.map((r) => (isNumber(r[key][i]) ? sign * r[key][i] * k : null));
      plot.plot.setData([times, column("x_max"), column("x_max", -1), column("box"), column("box", -1), column("pose")]);
      const limit = last.x_max[i], share = limit / last.box[i], now = `${fixed(last.pose[i] * k, digits)} ${unit}`;
      caption(plot.title, name, isNumber(limit) ? `${now} of ±${fixed(limit * k, digits)} ${unit}${isNumber(share) ? ` (${Math.round(100 * share)} %)` : ""}` : `${now}, legs decide`);
    });
  }
}

function caption(node, name, text) {
  if (!node.firstChild) node.append(make("b"), document.createTextNode(""));
  node.firstChild.textContent = `${name}  `;
  node.lastChild.data = text;
}
