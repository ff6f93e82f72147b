// Reads the event stream with fetch (EventSource cannot send a token) and comes back by itself.
import { headers } from "./api.js";

const SILENCE_MS = 3000;
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

export class Stream {
  constructor(onStatus, onLink) {
    this.onStatus = onStatus;
    this.onLink = onLink;
    this.abort = null;
    this.run();
  }

  restart() {
    this.abort?.abort();
  }

  async run() {
    let wait = 250;
    for (;;) {
      try {
        await this.read();
        wait = 250;
      } catch (error) {
        this.onLink(error.refused ? "refused" : "lost");
      }
      await pause(wait);
      wait = Math.min(wait * 2, 3000);
    }
  }

  async read() {
    this.abort = new AbortController();
    let watch = setTimeout(() => this.abort.abort(), SILENCE_MS);
    try {
      const answer = await fetch("/api/stream", {
        headers: headers(), signal: this.abort.signal, cache: "no-store", credentials: "omit",
      });
      if (!answer.ok) throw Object.assign(new Error("refused"), { refused: answer.status === 401 });
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) return;
        clearTimeout(watch);
        watch = setTimeout(() => this.abort.abort(), SILENCE_MS);
        const events = (rest + value).split("\n\n");
        rest = events.pop();
        for (const event of events) {
          if (event.startsWith("data: ")) this.onStatus(JSON.parse(event.slice(6)));
        }
      }
    } finally {
      clearTimeout(watch);
    }
  }
}
