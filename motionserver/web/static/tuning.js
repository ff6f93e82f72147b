// The tuning form: what is in force, what is pending, and what the server said about it.
import { send, sentence } from "./api.js";
import { byId, make, put } from "./dom.js";

const ORDER = ["Feel", "Perception", "Workspace", "Optimiser", "Six axes"];
const LASTING = 6; // looks, ten a second
const AGAIN = 30; // looks until the form is asked for again
const isNumber = (field) => !field.choices && !field.is_file;
const unit = (field) => field.unit.replace("s2", "s²").replace(/^deg/, "°");

export class Tuning {
  constructor() {
    this.version = null;
    this.values = {};
    this.rows = new Map();
    this.mayTune = false;
    this.busy = false;
    this.differing = 0;
    byId("tuning").addEventListener("submit", (e) => { e.preventDefault(); this.apply(); });
    byId("discard").addEventListener("click", () => this.fill(this.values));
    byId("undo").addEventListener("click", () => this.undo());
    byId("preset-load").addEventListener("click", () => this.loadPreset());
    byId("presets").addEventListener("submit", (e) => { e.preventDefault(); this.savePreset(); });
    byId("preset").addEventListener("change", () => this.aboutPreset());
  }

  async load() {
    const answer = await send("GET", "/api/tuning");
    if (!answer.ok) return this.say(sentence(answer.body), true);
    if (!this.rows.size) this.build(answer.body.fields);
    // what somebody has typed meanwhile stays
    if (this.version === null || Object.keys(this.changes()).length === 0) this.take(answer.body);
    await this.listPresets();
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
    wrong.hidden = true;
    box.append(name, input);
    if (isNumber(field)) box.append(make("span", "unit", unit(field)));
    box.append(help, wrong);
    input.addEventListener("input", () => { this.mark(field.name, ""); this.refresh(); });
    this.rows.set(field.name, { field, box, input, wrong });
    return box;
  }

  read(row) {
    if (row.field.is_file) return row.input.value.trim();
    if (!row.field.choices) return row.input.value.trim() === "" ? null : Number(row.input.value);
    return row.field.choices.find((word) => String(word) === row.input.value);
  }

  changes() {
    const out = {};
    for (const [name, row] of this.rows) if (this.read(row) !== this.values[name]) out[name] = this.read(row);
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
    this.fill(values);
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
  noticed(version) {
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
      for (const item of answer.body.details || []) {
        if (this.mark(item.field, `${item.message}; allowed ${item.allowed}`)) this.rows.get(item.field).box.parentNode.open = true;
      }
      const wrong = (answer.body.details || []).length;
      this.say(wrong ? `Nothing was changed: ${wrong} value${wrong > 1 ? "s are" : " is"} not allowed, see the marked fields. ${sentence(answer.body)}` : sentence(answer.body), true);
      if (answer.status === 412) this.values = (await send("GET", "/api/tuning")).body.values || this.values;
      if (answer.status === 412 && answer.body.version) this.version = answer.body.version;
      this.refresh();
    }
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
      this.rows.get("algorithm").input.value = name;
      this.refresh();
    }
    return `${name} drives.`;
  }

  undo() {
    return this.change("POST", "/api/tuning/undo", { ifMatch: this.version }, (body) => `Undone; now version ${body.version}.`);
  }

  async listPresets() {
    const answer = await send("GET", "/api/presets");
    if (!answer.ok) return;
    this.presets = answer.body.presets;
    const select = byId("preset");
    const chosen = select.value;
    select.replaceChildren(...this.presets.map((p) => {
      const option = make("option", "", p.built_in ? p.name : `${p.name} (yours)`);
      option.value = p.name;
      return option;
    }));
    if (chosen) select.value = chosen;
    this.aboutPreset();
  }

  aboutPreset() {
    put(byId("preset-about"), this.presets?.find((p) => p.name === byId("preset").value)?.about || "");
  }

  async loadPreset() {
    const name = byId("preset").value;
    const answer = await send("GET", `/api/presets/${encodeURIComponent(name)}`);
    if (!answer.ok) return this.say(sentence(answer.body), true);
    this.fill({ ...this.values, ...answer.body.values });
    const count = Object.keys(this.changes()).length;
    this.say(count ? `Preset ${name} is in the form: look at it, then apply.` : `Preset ${name} is what is in force.`);
  }

  async savePreset() {
    const name = byId("preset-name").value.trim();
    if (!/^[a-z0-9-]{1,40}$/.test(name)) return this.say("A preset's name is a-z, 0-9 and -, at most 40.", true);
    const answer = await send("PUT", `/api/presets/${encodeURIComponent(name)}`, { body: {} });
    this.say(answer.ok ? `Saved what is in force as ${name}.` : sentence(answer.body), !answer.ok);
    if (answer.ok) await this.listPresets();
  }
}
