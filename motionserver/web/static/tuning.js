// The tuning form: what is in force, what is pending, and what the server said about it.
import { send, sentence } from "./api.js";
import { byId, make, put } from "./dom.js";
import { Presets } from "./presets.js";

const ORDER = ["Feel", "Perception", "Workspace", "Optimiser", "Six axes"];
const LASTING = 6; // looks, ten a second
const AGAIN = 30; // looks until the form is asked for again
const isNumber = (field) => !field.choices && !field.is_file;
const word = (value, field) => {
  if (typeof value === "boolean") return value ? "on" : "off";
  return `${typeof value === "number" ? Number(value.toPrecision(4)) : value} ${unit(field)}`.trim();
};
const unit = (field) => field.unit.replace("s2", "s²").replace(/^deg/, "°");

export class Tuning {
  constructor() {
    this.version = null;
    this.values = {};
    this.rows = new Map();
    this.mayTune = false;
    this.busy = false;
    this.differing = 0;
    this.loaded = null;
    this.presets = new Presets(this);
    byId("tuning").addEventListener("submit", (e) => { e.preventDefault(); this.apply(); });
    byId("discard").addEventListener("click", () => { this.loaded = this.presets.picked = null; this.fill(this.values); this.presets.show(); });
    byId("undo").addEventListener("click", () => this.undo());
  }

  async load() {
    const answer = await send("GET", "/api/tuning");
    if (!answer.ok) return this.say(sentence(answer.body), true);
    if (!this.rows.size) this.build(answer.body.fields);
    // what somebody has typed meanwhile stays
    if (this.version === null || Object.keys(this.changes()).length === 0) this.take(answer.body);
    await this.presets.list();
  }

  // Tunables belong to algorithms: the form has those of the one chosen in it.
  isLive(field) {
    return !field.algorithms || field.algorithms.includes(this.rows.get("algorithm").input.value);
  }

  showLive() {
    for (const row of this.rows.values()) row.box.hidden = !this.isLive(row.field);
    for (const group of byId("fields").children) group.hidden = ![...group.querySelectorAll(".field")].some((box) => !box.hidden);
  }

  build(fields) {
    const groups = [...new Set([...ORDER, ...fields.map((f) => f.group)])];
    for (const group of groups) {
      const column = make("details", "group");
      column.open = innerWidth > 720;
      column.append(make("summary", "", group));
      for (const field of fields.filter((f) => f.group === group)) column.append(this.row(field));
      byId("fields").append(column);
    }
  }

  row(field) {
    const box = make("div", "field");
    const name = make("label", "", field.label);
    const input = make(field.choices ? "select" : "input");
    input.id = `tune-${field.name}`;
    name.htmlFor = input.id;
    if (field.choices) {
      for (const word of field.choices) {
        const option = make("option", "", word === true ? "on" : word === false ? "off" : String(word));
        option.value = String(word);
        input.append(option);
      }
    } else if (field.is_file) {
      input.type = "text";
      input.maxLength = 1024;
    } else {
      input.type = "number";
      input.step = "any";
      input.inputMode = "decimal";
    }
    const help = make("p", "help", `${field.meaning} `);
    if (isNumber(field)) help.append(make("span", "range", `${field.min} to ${field.max} ${unit(field)}`.trim()));
    const wrong = make("p", "wrong-text");
    const force = make("p", "force-text");
    wrong.hidden = force.hidden = true;
    box.append(name, input);
    if (isNumber(field)) box.append(make("span", "unit", unit(field)));
    box.append(force, help, wrong);
    input.addEventListener("input", () => { this.mark(field.name, ""); this.refresh(); });
    this.rows.set(field.name, { field, box, input, wrong, force });
    return box;
  }

  read(row) {
    if (row.field.is_file) return row.input.value.trim();
    if (!row.field.choices) return row.input.value.trim() === "" ? null : Number(row.input.value);
    return row.field.choices.find((word) => String(word) === row.input.value);
  }

  changes() {
    const out = {};
    for (const [name, row] of this.rows) {
      const value = this.read(row);
      if (value === this.values[name]) continue;
      // what is hidden changes only with a preset, which is a whole state
      if (this.isLive(row.field) || (this.loaded && this.loaded.values[name] === value)) out[name] = value;
    }
    return out;
  }

  fill(values) {
    for (const [name, row] of this.rows) {
      if (name in values) row.input.value = String(values[name]);
      this.mark(name, "");
    }
    this.refresh();
  }

  take({ version, values }) {
    this.version = version;
    this.values = values;
    // it is in force now, or was already
    if (this.loaded) this.presets.last = this.loaded.name;
    this.loaded = this.presets.picked = null;
    this.fill(values);
    this.presets.show();
  }

  // What is asked for against what the engine itself has; both are shown where they differ.
  showForce(told) {
    if (!told || !this.rows.size || told.version !== this.version) return;
    const now = told.in_force, text = [told.fallback, told.retune_error && `The last change did not come into force: ${told.retune_error}.`];
    byId("ramp").hidden = !told.is_ramping;
    let apart = 0;
    for (const [name, row] of this.rows) {
      const differs = Boolean(now) && this.isLive(row.field) && now[name] !== this.values[name];
      row.force.hidden = !differs;
      if (!differs) continue;
      apart += 1;
      put(row.force, `in force: ${word(now[name], row.field)}, asked for: ${word(this.values[name], row.field)}`);
    }
    if (apart && !told.is_ramping) text.push(`${apart} value${apart > 1 ? "s are" : " is"} not in force as asked for, see the marked fields.`);
    const notice = text.filter(Boolean).join(" ");
    byId("tuning-notice").hidden = notice === "";
    put(byId("tuning-notice"), notice);
  }

  mark(name, text) {
    const row = this.rows.get(name);
    if (!row) return false;
    row.box.classList.toggle("wrong", text !== "");
    row.wrong.hidden = text === "";
    put(row.wrong, text);
    return true;
  }

  refresh() {
    if (this.rows.size) this.showLive();
    const changes = this.changes();
    const count = Object.keys(changes).length;
    for (const [name, row] of this.rows) row.box.classList.toggle("changed", name in changes);
    put(byId("version"), this.version === null ? "–" : `version ${this.version}`);
    put(byId("apply"), count ? `Apply ${count} change${count > 1 ? "s" : ""}` : "Apply");
    byId("apply").disabled = !count || !this.mayTune || this.busy;
    byId("discard").disabled = !count;
    document.querySelector(".apply").classList.toggle("pending", count > 0);
    byId("undo").disabled = !this.mayTune || this.version === null || this.busy;
    byId("preset-save").disabled = !this.mayTune;
    byId("apply").title = this.mayTune ? "" : "needs the tuner's or operator's token";
  }

  // Somebody else changed the tuning: show it, unless changes are pending here. The status may be
  // older than an answer just received, so a difference counts only once it has lasted.
  noticed(told) {
    const version = told?.version;
    this.showForce(told);
    const differs = version !== undefined && version !== this.version && !this.busy;
    this.differing = differs ? this.differing + 1 : 0;
    // a planner that came after this page: there is no form yet
    if (this.version === null && this.differing % AGAIN === LASTING) return void this.load();
    if (this.differing !== LASTING) return;
    if (Object.keys(this.changes()).length === 0) this.load();
    else this.say(`The tuning is at version ${version} by now; apply will be refused until you discard.`, true);
  }

  say(text, bad = false) {
    put(byId("tuning-answer"), text);
    byId("tuning-answer").classList.toggle("warn", bad);
  }

  async change(method, path, options, done) {
    this.busy = true;
    this.refresh();
    const answer = await send(method, path, options);
    this.busy = false;
    if (answer.ok) {
      this.take(answer.body);
      this.say(done(answer.body));
    } else {
      this.explain(answer.body, "Nothing was changed");
      if (answer.status === 412) this.values = (await send("GET", "/api/tuning")).body.values || this.values;
      if (answer.status === 412 && answer.body.version) this.version = answer.body.version;
      this.refresh();
    }
  }

  // Refusals of values stand at their fields as well, where the form shows them.
  explain(body, what) {
    let marked = 0;
    for (const item of body.details || []) {
      const row = this.rows.get(item.field);
      this.mark(item.field, `${item.message}; allowed ${item.allowed}`);
      if (!row || !this.isLive(row.field)) continue;
      row.box.parentNode.open = true;
      marked += 1;
    }
    const seen = marked ? `${marked} value${marked > 1 ? "s are" : " is"} not allowed, see the marked fields. ` : "";
    this.say(`${what}: ${seen}${sentence(body)}`, true);
  }

  apply() {
    return this.change("PATCH", "/api/tuning", { body: this.changes(), ifMatch: this.version },
      (body) => `Applied as version ${body.version}; takes full effect within a second.`);
  }

  // Another algorithm takes over; what is pending in the form stays pending.
  async driveWith(name) {
    const options = { body: { algorithm: name }, ifMatch: this.version };
    let answer = await send("PATCH", "/api/tuning", options);
    if (answer.status === 412 && answer.body.version) answer = await send("PATCH", "/api/tuning", { ...options, ifMatch: answer.body.version });
    if (!answer.ok) return answer;
    if (Object.keys(this.changes()).length === 0) this.take(answer.body);
    else {
      Object.assign(this, { version: answer.body.version, values: answer.body.values });
      this.presets.show();
      this.rows.get("algorithm").input.value = name;
      this.refresh();
    }
    return `${name} drives.`;
  }

  undo() {
    return this.change("POST", "/api/tuning/undo", { ifMatch: this.version }, (body) => `Undone; now version ${body.version}.`);
  }
}
