// Presets: whole states under a name. Which one is asked for, loading into the form, saving the form.
import { send, sentence } from "./api.js";
import { byId, make, put } from "./dom.js";

export class Presets {
  constructor(form) {
    this.form = form;
    this.all = [];
    this.last = null;
    this.picked = null; // chosen in the list, not loaded yet
    byId("preset-load").addEventListener("click", () => this.load());
    byId("presets").addEventListener("submit", (e) => { e.preventDefault(); this.save(); });
    byId("preset").addEventListener("change", () => { this.picked = byId("preset").value; this.about(); });
  }

  async list() {
    const answer = await send("GET", "/api/presets");
    if (!answer.ok) return;
    this.all = answer.body.presets;
    this.show();
  }

  // Live values in which a preset differs from what is asked for; another algorithm differs in all.
  apart(preset) {
    if (preset.values.algorithm !== this.form.values.algorithm) return Infinity;
    return [...this.form.rows.values()].filter(({ field }) => (!field.algorithms || field.algorithms.includes(this.form.values.algorithm))
      && preset.values[field.name] !== this.form.values[field.name]).length;
  }

  // The list names the preset that is asked for only while all its values are.
  show() {
    const select = byId("preset");
    if (!this.all.length || !this.form.rows.size) return;
    const near = this.all.filter((p) => this.apart(p) < Infinity).sort((a, b) => this.apart(a) - this.apart(b));
    const last = near.find((p) => p.name === this.last) || near[0];
    const exact = last && this.apart(last) === 0 ? last : near.find((p) => this.apart(p) === 0);
    this.last = (exact || last)?.name || null;
    const options = this.all.map((p) => {
      const option = make("option", "", p.built_in ? p.name : `${p.name} (yours)`);
      option.value = p.name;
      return option;
    });
    if (!exact) {
      const option = make("option", "", this.last ? `modified from ${this.last}` : "none");
      option.value = "";
      options.unshift(option);
    }
    select.replaceChildren(...options);
    select.value = this.all.some((p) => p.name === this.picked) ? this.picked : exact ? exact.name : "";
    this.about();
  }

  about() {
    const chosen = this.all.find((p) => p.name === byId("preset").value);
    const left = chosen?.warnings?.length ? ` Left out of its file: ${chosen.warnings.join("; ")}.` : "";
    put(byId("preset-about"), chosen ? chosen.about + left : "The values asked for are no preset; choose one to load it.");
    byId("preset-load").disabled = !chosen;
  }

  async load() {
    const name = byId("preset").value;
    const answer = await send("GET", `/api/presets/${encodeURIComponent(name)}`);
    if (!answer.ok) return this.form.say(sentence(answer.body), true);
    this.form.loaded = answer.body;
    this.form.fill({ ...this.form.values, ...answer.body.values });
    const count = Object.keys(this.form.changes()).length;
    this.form.say(count ? `Preset ${name} is in the form: look at it, then apply.` : `Preset ${name} is what is asked for already.`);
  }

  async save() {
    const name = byId("preset-name").value.trim();
    if (!/^[a-z0-9-]{1,40}$/.test(name)) return this.form.say("A preset's name is a-z, 0-9 and -, at most 40.", true);
    const body = {};
    for (const [key, row] of this.form.rows) if (this.form.isLive(row.field)) body[key] = this.form.read(row);
    const pending = Object.keys(this.form.changes()).length;
    const answer = await send("PUT", `/api/presets/${encodeURIComponent(name)}`, { body });
    if (!answer.ok) return this.form.explain(answer.body, "Nothing was saved");
    this.form.say(`Saved the form as ${name}${pending ? `, ${pending} value${pending > 1 ? "s" : ""} of it not applied yet` : ""}.`);
    if (!pending) this.last = name;
    await this.list();
  }
}
