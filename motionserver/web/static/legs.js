// Six bars: where each leg is in its stroke, and how fast it moves, against the limits.
import { byId, fixed, isNumber, list, make, put } from "./dom.js";
import { strokeColour } from "./hexapod.js";

export class Legs {
  constructor() {
    const parent = byId("legs");
    const ends = make("div", "stroke-ends");
    this.ends = [make("span"), make("span")];
    ends.append(...this.ends);
    parent.append(ends);
    this.rows = Array.from({ length: 6 }, (_, i) => {
      const row = make("div", "leg");
      const [bars, track, speed, value] = [make("div"), make("div", "track"), make("div", "speed"), make("div", "value")];
      const parts = { fill: make("i"), measured: make("b"), rate: make("i"), length: make("span"), pace: make("span", "dim") };
      parts.measured.title = "measured";
      track.append(parts.fill, make("u"), parts.measured);
      speed.append(parts.rate, make("u"));
      bars.append(track, speed);
      value.append(parts.length, parts.pace);
      row.append(make("span", "name", String(i + 1)), bars, value);
      parent.append(row);
      return parts;
    });
  }

  show(guard) {
    const limits = guard?.limits || {};
    const { leg_min: low, leg_max: high, leg_speed: fastest } = limits;
    put(this.ends[0], fixed(low, 4, "m"));
    put(this.ends[1], fixed(high, 4, "m"));
    this.rows.forEach((row, i) => {
      const length = list(guard?.legs)[i], rate = list(guard?.leg_speed)[i], seen = list(guard?.feedback?.legs)[i];
      const share = clip((length - low) / (high - low));
      row.fill.style.width = `${100 * share}%`;
      row.fill.style.background = strokeColour(share);
      row.measured.hidden = !isNumber(seen);
      row.measured.style.left = `calc(${100 * clip((seen - low) / (high - low))}% - 1px)`;
      const pace = Math.max(-1, Math.min(1, (rate || 0) / fastest)) || 0;
      row.rate.style.left = `${50 + 50 * Math.min(pace, 0)}%`;
      row.rate.style.width = `${50 * Math.abs(pace)}%`;
      row.rate.style.background = Math.abs(pace) > 0.9 ? "#ff7a45" : "#8ba0b5";
      put(row.length, fixed(length, 3, "m"));
      put(row.pace, isNumber(rate) ? `${rate >= 0.005 ? "+" : ""}${fixed(rate, 2)} m/s` : "–");
    });
    this.limits(limits);
  }

  limits({ leg_min: low, leg_max: high, leg_speed, leg_acceleration, leg_jerk, unchecked }) {
    const jerk = isNumber(leg_jerk) ? `, ${leg_jerk} m/s³` : "";
    put(byId("limits"), isNumber(low)
      ? `Limits of every leg: ${low} to ${high} m, ${leg_speed} m/s, ${leg_acceleration} m/s²${jerk}. Read once from the machine's file.` : "");
    const missing = list(unchecked).slice();
    if (low !== undefined && !isNumber(leg_jerk) && !missing.some((m) => String(m).includes("jerk"))) missing.push("leg jerk");
    byId("unchecked").hidden = missing.length === 0;
    put(byId("unchecked"), `Not checked, because the file gives no limit: ${missing.join(", ")}.`);
  }
}

const clip = (share) => (isNumber(share) ? Math.max(0, Math.min(1, share)) : 0);
