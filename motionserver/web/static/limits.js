// How much of each limit the motion uses: the largest share is what binds.
import { byId, fixed, isNumber, list, make, put } from "./dom.js";

const CUED = ["READY", "RUN", "HOLD"];
const BINDS = 0.97, AXES = ["surge", "sway", "heave", "roll", "pitch", "yaw"];

// Of the newest plan where the algorithm tells it; else of the legs as they are now.
function sharesOf(status) {
  const told = status.planner?.limit_shares || {};
  const used = Object.entries(told).filter(([, share]) => isNumber(share) && share > 0);
  if (used.length && CUED.includes(status.state)) return { used, of: "the newest plan" };
  const guard = status.guard || {}, limits = guard.limits || {};
  const middle = (limits.leg_max + limits.leg_min) / 2, half = (limits.leg_max - limits.leg_min) / 2;
  const most = (values, share) => Math.max(...list(values).map((v) => Math.abs(share(v))));
  const now = [["leg length", most(guard.legs, (v) => (v - middle) / half)], ["leg speed", most(guard.leg_speed, (v) => v / limits.leg_speed)]];
  return { used: now.filter(([, share]) => isNumber(share)), of: "the legs now" };
}

export function showShares(status) {
  const { used, of } = sharesOf(status);
  const parent = byId("shares");
  const binding = used.filter(([, share]) => share >= BINDS).map(([name]) => (AXES.includes(name) ? `box in ${name}` : name));
  put(byId("binds"), !used.length ? "–" : binding.length ? `Binding: ${binding.join(", ")}` : "Nothing binds");
  put(byId("shares-of"), used.length ? `share of each limit used by ${of}` : "");
  while (parent.children.length > used.length) parent.lastChild.remove();
  used.forEach(([name, share], i) => {
    let row = parent.children[i];
    if (!row) {
      row = make("li");
      const track = make("div", "bar");
      track.append(make("i"));
      row.append(make("span"), track, make("span", "value"));
      parent.append(row);
    }
    row.classList.toggle("binds", share >= BINDS);
    put(row.firstChild, AXES.includes(name) ? `box, ${name}` : name);
    row.children[1].firstChild.style.width = `${Math.min(100, 100 * share)}%`;
    put(row.lastChild, `${fixed(100 * share, 0)} %`);
  });
}
