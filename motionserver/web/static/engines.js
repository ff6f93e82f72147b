// All engines side by side: what drives, what thinks beside it, what could.
import { send, sentence } from "./api.js";
import { byId, fixed, isNumber, list, make, put } from "./dom.js";

export const COLOURS = ["#d79ac0", "#f0d442", "#9be564", "#ff8f6b", "#9fadba", "#35c9a3"];
const LASTING = 4000;
const AGAIN_MS = 3000; // until the names are asked for again, when the planner came after this page
const percent = (share, digits = 0) => (isNumber(share) ? `${fixed(100 * share, digits)} %` : "–");

export class Engines {
  constructor() {
    this.allowed = [];
    this.asked = 0;
    this.rows = new Map();
    this.mayTune = this.mayRun = false;
    this.busy = false;
    this.hidden = new Set();
    this.onDrive = async () => {};
  }

  // Colours belong to names, so that a line keeps its colour whatever else runs.
  colour(name) {
    return COLOURS[Math.max(0, this.allowed.indexOf(name)) % COLOURS.length];
  }

  async load() {
    this.asked = performance.now();
    const answer = await send("GET", "/api/side");
    if (answer.ok) this.allowed = answer.body.allowed;
  }

  lines(status) {
    return list(status?.planner?.side?.engines).map((e) => e.name).filter((name) => this.rows.has(name) && !this.hidden.has(name));
  }

  show(status) {
    const side = status.planner?.side;
    if (side && !this.allowed.length && performance.now() - this.asked > AGAIN_MS) this.load();
    if (!side || !this.allowed.length) return;
    this.wanted = list(side.wanted);
    const driving = { ...side.driving, drives: true };
    const beside = new Map(list(side.engines).map((engine) => [engine.name, engine]));
    for (const name of this.allowed) {
      const row = this.rows.get(name) || this.row(name);
      this.fill(row, name, name === driving.name ? driving : beside.get(name));
    }
  }

  row(name) {
    const row = { box: make("li", "engine"), cells: {} };
    const title = make("div", "who");
    row.line = make("button", "swatch");
    row.line.type = "button";
    row.line.style.setProperty("--line-colour", this.colour(name));
    row.line.addEventListener("click", () => { this.hidden.has(name) ? this.hidden.delete(name) : this.hidden.add(name); });
    row.badge = make("span", "pill");
    title.append(row.line, make("b", "", name), row.badge);
    const figures = make("dl");
    for (const [key, label, about] of CELLS) {
      const pair = make("div");
      pair.title = about;
      row.cells[key] = make("dd", "", "–");
      pair.append(make("dt", "", label), row.cells[key]);
      figures.append(pair);
    }
    row.bar = make("i");
    const bar = make("div", "bar");
    bar.append(row.bar);
    row.cells.nrmse.parentNode.append(bar);
    row.drive = make("button", "", "Drive with this");
    row.run = make("button", "quiet", "Run beside");
    for (const button of [row.drive, row.run]) button.type = "button";
    row.drive.addEventListener("click", () => this.act(() => this.onDrive(name)));
    row.run.addEventListener("click", () => this.act(() => this.toggle(name)));
    const actions = make("div", "acts");
    actions.append(row.drive, row.run);
    row.trouble = make("p", "trouble small warn");
    row.box.append(title, figures, actions, row.trouble);
    byId("engines").append(row.box);
    this.rows.set(name, row);
    return row;
  }

  fill(row, name, engine) {
    const drives = Boolean(engine?.drives);
    const runs = Boolean(engine);
    row.box.classList.toggle("drives", drives);
    row.box.classList.toggle("idle", !runs);
    put(row.badge, drives ? "drives" : runs ? "beside" : "off");
    row.badge.className = `pill ${drives ? "good" : ""}`;
    row.line.classList.toggle("off", this.hidden.has(name));
    row.line.disabled = drives || !runs;
    row.line.style.setProperty("--line-colour", drives ? "var(--blue)" : this.colour(name));
    row.line.title = drives ? "felt: the thick line" : runs ? `${this.hidden.has(name) ? "show" : "hide"} its line in the force plot` : "";
    row.line.setAttribute("aria-label", `line of ${name} in the force plot`);
    for (const [key, , , text] of CELLS) put(row.cells[key], runs ? text(engine) : "–");
    row.bar.style.width = `${Math.min(100, 100 * (engine?.nrmse ?? 0))}%`;
    const skipping = engine?.periods > 0 && engine.skipped > 0.2 * engine.periods;
    row.cells.think.classList.toggle("bad", skipping);
    row.cells.share.classList.toggle("bad", engine?.kappa_refused + engine?.no_candidate > 0.02);
    const told = [engine?.trouble, engine?.raised ? `raised ${engine.raised} times` : "",
      engine?.skipped ? `${engine.skipped} of ${engine.periods} periods skipped: no time left` : ""].filter(Boolean).join("; ");
    row.trouble.hidden = told === "";
    put(row.trouble, told);
    row.drive.hidden = drives;
    put(row.run, this.wanted.includes(name) ? "Stop" : "Run beside");
    row.run.hidden = drives;
    row.drive.disabled = this.busy || !this.mayTune;
    row.drive.title = this.mayTune ? "takes over at once, smoothly; the other goes on beside" : "needs the tuner's or operator's token";
    row.run.disabled = this.busy || !this.mayRun;
    row.run.title = this.mayRun ? "" : "needs the operator's token";
  }

  async toggle(name) {
    const wanted = this.wanted.includes(name) ? this.wanted.filter((n) => n !== name) : [...this.wanted, name];
    const answer = await send("POST", "/api/side", { body: { engines: wanted } });
    return answer.ok ? `${name} ${wanted.includes(name) ? "runs beside" : "stopped"}.` : answer;
  }

  async act(what) {
    this.busy = true;
    const result = await what();
    this.busy = false;
    const text = typeof result === "string" ? result : sentence(result.body);
    put(byId("engines-answer"), text);
    byId("engines-answer").classList.toggle("warn", typeof result !== "string");
    clearTimeout(this.timer);
    if (typeof result === "string") this.timer = setTimeout(() => put(byId("engines-answer"), ""), LASTING);
  }
}

const CELLS = [
  ["nrmse", "Force error (nRMSE)", "rms of felt minus wanted force over rms of wanted, x and y, last 30 s: 0 % is perfect, 100 % is no motion", (e) => percent(e.nrmse, 1)],
  ["kappa", "κ now", "share of its candidate in its plan", (e) => fixed(e.kappa, 2)],
  ["share", "κ = 1 / less / 0", "share of periods: whole candidate, part of it, nothing of it", (e) => `${percent(e.kappa_whole)} / ${percent(e.kappa_part)} / ${percent(isNumber(e.kappa_refused) ? e.kappa_refused + e.no_candidate : null)}`],
  ["think", "Thinks p50 / p99", "time of one plan", (e) => `${fixed(e.think_p50_ms, 1)} / ${fixed(e.think_p99_ms, 1)} ms`],
  ["legs", "Leg use", "largest distance of a leg from the middle of its stroke, last 30 s", (e) => percent(e.leg_use)],
];
