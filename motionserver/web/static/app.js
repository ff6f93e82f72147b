// Brings stream, drawings and forms together.
import { send, sentence, setToken, takeToken, token } from "./api.js";
import { byId, put } from "./dom.js";
import { Engines } from "./engines.js";
import { FaultHelp } from "./faulthelp.js";
import { Hexapod } from "./hexapod.js";
import { Legs } from "./legs.js";
import { showShares } from "./limits.js";
import { duration, showLog, showNumbers, showState } from "./panels.js";
import { Plots } from "./plots.js";
import { Stream } from "./stream.js";
import { Tuning } from "./tuning.js";

const OLD_MS = 1000;
takeToken();
const hexapod = new Hexapod(byId("hexapod"));
const legs = new Legs();
const plots = new Plots();
const tuning = new Tuning();
const engines = new Engines();
const faultHelp = new FaultHelp();
engines.onDrive = (name) => tuning.driveWith(name);
let status = null;
let arrived = 0;
let link = "connecting";
let caller = { role: "viewer", hasToken: false };

const stream = new Stream((data) => {
  status = data;
  arrived = performance.now();
  link = "live";
  plots.add(data);
}, (why) => { link = why; });

function freshness() {
  const age = performance.now() - arrived;
  const old = !status || age > OLD_MS;
  const silent = (name) => status && !status.processes[name].alive;
  document.body.classList.toggle("stale", old);
  document.body.classList.toggle("guard-old", Boolean(silent("guard")));
  document.body.classList.toggle("planner-old", Boolean(silent("planner")));
  const pill = byId("link");
  pill.className = `pill ${old ? "bad" : "good"}`;
  put(pill, old ? (link === "refused" ? "not allowed" : status ? `no data for ${duration(age / 1e3)}` : "connecting") : "live");
  let text = "";
  if (link === "refused" && old) text = "The server wants a token before it shows anything.";
  else if (old && status) text = `What you see is old: no data for ${duration(age / 1e3)}. Reconnecting.`;
  else if (silent("guard")) text = `The guard has not reported for ${duration(status.processes.guard.age_s)}: state, pose and legs are old.`;
  else if (silent("planner")) text = `The planner has not reported for ${duration(status.processes.planner.age_s)}: the accepted plan plays to rest.`;
  byId("banner").hidden = text === "";
  put(byId("banner"), text);
  buttons(old);
}

function buttons(old) {
  const operator = caller.role === "operator";
  const [engage, park, reset] = ["engage", "park", "reset"].map(byId);
  const byHttp = status?.engage?.by_http;
  engage.disabled = old || !operator || !byHttp || status.state !== "PARKED";
  engage.title = !byHttp ? status?.engage?.why_not || "" : operator ? "possible when parked" : "needs the operator's token";
  park.disabled = !caller.hasToken;
  park.title = caller.hasToken ? "always allowed" : "needs a token";
  reset.disabled = old || !operator || !["FAULT", "SAFE"].includes(status.state);
  reset.title = operator ? "possible in FAULT and SAFE" : "needs the operator's token";
}

for (const op of ["engage", "park", "reset"]) {
  byId(op).addEventListener("click", async () => {
    const answer = await send("POST", `/api/${op}`);
    put(byId("answer"), answer.ok ? `${op}: accepted` : sentence(answer.body));
    byId("answer").classList.toggle("warn", !answer.ok);
  });
}

async function identify() {
  let answer = await send("GET", "/api/status");
  const isUnknown = answer.status === 401 && token() !== "";
  if (isUnknown) {
    // an unknown token must not take away what is shown without one
    setToken("");
    byId("token").placeholder = "access token";
    stream.restart();
    answer = await send("GET", "/api/status");
  }
  caller = {
    role: answer.headers.get("x-motion-role") || "viewer",
    hasToken: answer.ok && answer.headers.get("x-motion-token") === "yes",
  };
  const wrong = answer.status === 401;
  const unknown = wrong ? "The token is not known here." : "The token is not known here; what is shown is open to everybody on this computer.";
  put(byId("answer"), caller.hasToken ? "" : isUnknown ? `${unknown} The tokens are in the server's tokens file.` : "To engage, park or tune, enter a token above; the server made three in its tokens file.");
  byId("role").className = `pill ${wrong || isUnknown ? "bad" : caller.hasToken ? "good" : ""}`;
  byId("answer").classList.toggle("warn", isUnknown);
  put(byId("role"), isUnknown ? "token unknown" : wrong ? "token needed" : caller.role);
  tuning.mayTune = caller.hasToken && caller.role !== "viewer";
  engines.mayTune = tuning.mayTune;
  engines.mayRun = caller.role === "operator";
  tuning.refresh();
  if (!wrong) await Promise.all([tuning.load(), engines.load()]);
}

byId("token-form").addEventListener("submit", (event) => {
  event.preventDefault();
  setToken(byId("token").value.trim());
  byId("token").value = "";
  useToken();
});

function useToken() {
  byId("token").placeholder = token() ? "token in use" : "access token";
  stream.restart();
  identify();
}

// a link with a token that is opened in a tab which shows the page already
addEventListener("hashchange", () => { if (takeToken()) useToken(); });

function render() {
  freshness();
  if (!status || document.hidden) return;
  showState(status);
  faultHelp.show(status);
  legs.show(status.guard);
  showNumbers(status);
  showShares(status);
  showLog(status);
  engines.show(status);
  plots.beside(engines.lines(status), (name) => engines.colour(name));
  plots.draw();
  tuning.noticed(status.planner?.tuning);
  hexapod.status = status;
}

let even = false;
function frame() {
  even = !even;
  if (even && !document.hidden && !document.body.classList.contains("stale")) hexapod.draw();
  requestAnimationFrame(frame);
}

if (token()) byId("token").placeholder = "token in use";
setInterval(render, 100);
requestAnimationFrame(frame);
identify();
