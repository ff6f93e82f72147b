// What to do in FAULT and SAFE, and the newest dump of the black box as a file.
import { headers, send, sentence } from "./api.js";
import { byId, put } from "./dom.js";

const AGAIN_MS = 3000;
const STEPS = {
  FAULT: "Nothing is cued any more. Once the device has answered for a second without a fault where it was sent, the platform comes home and parks by itself. Remove the cause named above, then an operator presses Reset; until then engaging is not possible.",
  SAFE: "The emergency stop or an interlock is open: it is followed, nothing is sent against it. Close it, then an operator presses Reset.",
};

export class FaultHelp {
  constructor() {
    this.state = "";
    this.asked = 0;
    this.dump = null;
    byId("dump").addEventListener("click", () => this.download());
  }

  show(status) {
    const steps = STEPS[status.state];
    if (status.state !== this.state) {
      this.state = status.state;
      this.asked = 0;
      this.dump = null;
      put(byId("dump-answer"), "");
    }
    byId("help").hidden = !steps;
    if (!steps) return;
    put(byId("help-steps"), steps);
    // a dump is written some seconds after the fault
    if (performance.now() - this.asked > AGAIN_MS || !this.asked) {
      this.asked = performance.now();
      this.find();
    }
    byId("dump").hidden = !this.dump;
  }

  async find() {
    const answer = await send("GET", "/api/blackbox");
    if (!answer.ok) return;
    this.dump = answer.body.dumps[0] || null;
    if (this.dump) put(byId("dump"), `Download the newest black box dump (${this.dump.name}, ${(this.dump.bytes / 1e6).toFixed(1)} MB)`);
  }

  // with the token in the header: a plain link could not carry it
  async download() {
    try {
      const answer = await fetch(`/api/blackbox/${encodeURIComponent(this.dump.name)}`, { headers: headers(), cache: "no-store", credentials: "omit" });
      if (!answer.ok) return put(byId("dump-answer"), sentence(await answer.json()));
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await answer.blob());
      link.download = this.dump.name;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), AGAIN_MS);
      put(byId("dump-answer"), `Read it with: motionserver blackbox show ${this.dump.name}`);
    } catch {
      put(byId("dump-answer"), "The server does not answer: is it running?");
    }
  }
}
