// State, processes, pose, timing, rejected plans and events.
import { POSE, byId, fixed, isNumber, list, make, put } from "./dom.js";

const LOOKS = {
  OFFLINE: ["○", "--dim"], PARKED: ["■", "--dim"], RAISING: ["▲", "--yellow"], READY: ["●", "--blue"], RUN: ["▶", "--green"],
  HOLD: ["❚❚", "--orange"], PARKING: ["▼", "--yellow"], FAULT: ["✕", "--red"], SAFE: ["◆", "--violet"], UNKNOWN: ["?", "--red"],
};

export function showState(status) {
  const [mark, tone] = LOOKS[status.state] || LOOKS.UNKNOWN;
  document.querySelector(".card.state").style.setProperty("--tone", `var(${tone})`);
  put(byId("state-mark"), mark);
  put(byId("state"), String(status.state));
  put(byId("reason"), String(status.reason || "–"));
  const since = status.guard?.since_ns;
  put(byId("since"), isNumber(since) ? `for ${duration((status.t_ns - since) / 1e9)}` : "–");
  put(byId("algorithm"), (status.algorithm ? `algorithm ${status.algorithm}` : "no planner") + (status.guard?.dry_run ? " · dry run: nothing moves" : ""));
  put(byId("machine"), String(status.machine?.name || "–"));
  put(byId("digest"), status.guard?.limits?.digest ? `limits ${status.guard.limits.digest}` : "");
  document.title = `${status.state} – motionserver`;
  processes(status.processes);
  pose(status.guard?.pose);
}

function processes(all) {
  const parent = byId("processes");
  for (const [name, process] of Object.entries(all)) {
    let pill = parent.querySelector(`[data-name="${CSS.escape(name)}"]`);
    if (!pill) {
      pill = make("li");
      pill.dataset.name = name;
      parent.append(pill);
    }
    pill.className = `pill ${process.alive ? "good" : "bad"}`;
    pill.title = isNumber(process.pid) ? `process ${process.pid}` : "";
    const again = process.restarts ? ` · ${process.restarts} restart${process.restarts > 1 ? "s" : ""}` : "";
    put(pill, process.alive ? name + again : `${name} ${isNumber(process.age_s) ? `silent ${duration(process.age_s)}` : "absent"}`);
  }
}

function pose(values) {
  const parent = byId("pose");
  if (!parent.children.length) {
    for (const [name, unit] of POSE) {
      const pair = make("div");
      const value = make("dd");
      value.append(document.createTextNode("–"), make("small", "", unit));
      pair.append(make("dt", "", name), value);
      parent.append(pair);
    }
  }
  POSE.forEach(([, , k, digits], i) => {
    const text = fixed(list(values)[i] * k, digits);
    const node = parent.children[i].lastChild.firstChild;
    if (node.data !== text) node.data = text;
  });
}

const slots = (count) => `${fixed(count, 0)} ${count === 1 ? "slot" : "slots"}`;

export function showNumbers(status) {
  const g = status.guard || {}, p = status.planner || {};
  const source = p.source || {}, solver = p.solver || {}, handover = p.handover || {}, tick = g.tick || {}, feedback = g.feedback || {};
  const ms = (seconds) => (isNumber(seconds) ? fixed(Math.max(0, 1e3 * seconds), 1, "ms") : "–");
  rows(byId("numbers"), [
    ["Source", source.address ? `${source.kind} ${source.address}` : "none", source.address && !source.fresh],
    ["Device", feedback.device_state || "–", list(feedback.faults).length > 0],
    ["Cue age", ms(source.age_s), source.age_s > 0.05],
    ["Feedback age", ms(feedback.age_s), feedback.age_s > 0.1],
    ["Cue rate", `${fixed(source.rate_hz, 1, "Hz")}, ${source.mode || "–"}`],
    ["Send rate", fixed(status.rates_hz?.send, 1, "Hz")],
    ["Planner rate", fixed(status.rates_hz?.planner, 1, "Hz")],
    ["Guard tick", fixed(status.rates_hz?.tick, 0, "Hz") + (tick.scheduling ? `, ${tick.scheduling}` : "")],
    ["Solver p50 / p99", `${fixed(solver.time_p50_ms, 1)} / ${fixed(solver.time_p99_ms, 1)} ms`],
    ["Tick late p50 / p99", `${fixed(tick.late_p50_ms, 2)} / ${fixed(tick.late_p99_ms, 2)} ms`],
    ["Solver", `${solver.backend || "–"}, ${solver.status || "–"}, ${fixed(solver.iterations, 0)} it.`],
    ["Forecast", p.reference || "–"],
    ["Tick late max, missed", `${fixed(tick.late_max_ms, 1)} ms, ${fixed(tick.missed, 0)}`, tick.missed > 0],
    ["Plans begun ahead, lead", isNumber(handover.ahead_ms) ? `${fixed(handover.ahead_ms, 1, "ms")}, ${slots(handover.lead_slots)}` : "–"],
    ["Plans waiting, last refusal", isNumber(handover.waiting) ? `${fixed(handover.waiting, 0)}, ${String(handover.last_refusal || "none").replaceAll("-", " ")}` : "–"],
    ["Plan share κ", fixed(p.kappa ?? g.plan?.kappa, 3)],
    ["Tracking error", isNumber(g.tracking_error) ? fixed(1e3 * g.tracking_error, 2, "mm") : "–"],
    ["Plans halved, refused", `${fixed(p.counters?.plans_halved ?? 0, 0)}, ${fixed(p.counters?.plans_refused ?? 0, 0)}`],
    ["Plan played", g.plan ? `${fixed(Math.max(0, g.plan.time), 2)} of ${fixed(g.plan.duration, 2)} s` : "–"],
    ...(isNumber(p.tracking?.mismatch) ? [["Measured against felt", fixed(p.tracking.mismatch, 2, "m/s²"), p.tracking.alarm]] : []),
    ...[["Planner", p.trouble], ["Source error", source.last_error]].filter(([, text]) => text).map(([name, text]) => [name, text, true]),
    ...list(feedback.faults).map((fault) => ["Device fault", String(fault), true]),
  ]);
}

function rows(parent, wanted) {
  while (parent.children.length > wanted.length) parent.lastChild.remove();
  wanted.forEach(([name, text, bad], i) => {
    let row = parent.children[i];
    if (!row) {
      row = make("div");
      row.append(make("dt"), make("dd"));
      parent.append(row);
    }
    put(row.firstChild, name);
    put(row.lastChild, String(text));
    row.lastChild.className = bad ? "bad" : "";
  });
}

export function showLog(status) {
  const ago = (ns) => (isNumber(ns) ? `${duration((status.t_ns - ns) / 1e9)} ago` : "–");
  const newest = (items) => list(items).slice().sort((a, b) => b.t_ns - a.t_ns);
  lines(byId("rejections"), newest(status.guard?.rejections).map((r) => [ago(r.t_ns),
    `${String(r.reason).replaceAll("-", " ")}${isNumber(r.leg) ? `, leg ${r.leg + 1}` : ""}${isNumber(r.when) ? ` at ${fixed(r.when, 2)} s of the plan` : ""}${isNumber(r.value) ? `: ${short(r.value)}, allowed ${short(r.allowed)}` : ""}`]), "None. Every plan passed.");
  lines(byId("events"), newest(status.guard?.events).map((e) => [ago(e.t_ns), String(e.text).replaceAll("->", "→")]), "Nothing yet.");
}

const short = (value) => (isNumber(value) ? String(Number(value.toPrecision(5))) : String(value ?? "–"));

function lines(parent, wanted, empty) {
  const all = wanted.length ? wanted : [["", empty]];
  while (parent.children.length > all.length) parent.lastChild.remove();
  all.forEach(([when, text], i) => {
    let line = parent.children[i];
    if (!line) {
      line = make("li");
      line.append(make("time"), make("span"));
      parent.append(line);
    }
    put(line.firstChild, when);
    put(line.lastChild, text);
  });
}

export function duration(seconds) {
  if (!isNumber(seconds)) return "–";
  const s = Math.max(0, seconds);
  if (s < 10) return `${s.toFixed(1)} s`;
  if (s < 120) return `${Math.round(s)} s`;
  return s < 7200 ? `${Math.round(s / 60)} min` : `${Math.round(s / 3600)} h`;
}
