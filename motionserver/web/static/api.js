// Requests with the token of this tab; it is kept in sessionStorage and sent in a header only.
const KEY = "motionserver-token";

export const token = () => sessionStorage.getItem(KEY) || "";

export function setToken(value) {
  if (value) sessionStorage.setItem(KEY, value);
  else sessionStorage.removeItem(KEY);
}

// A link may hand over a token behind "#", which browsers send to nobody. It leaves the address bar
// and this tab's history before anything else happens.
export function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given === null) return false;
  history.replaceState(null, "", location.pathname + location.search);
  setToken(given.trim());
  return true;
}

export function headers(more = {}) {
  return token() ? { ...more, Authorization: `Bearer ${token()}` } : more;
}

export async function send(method, path, { body, ifMatch } = {}) {
  const named = {};
  if (body !== undefined) named["Content-Type"] = "application/json";
  if (ifMatch !== undefined) named["If-Match"] = `"${ifMatch}"`;
  try {
    const answer = await fetch(path, {
      method, headers: headers(named), body: body === undefined ? undefined : JSON.stringify(body),
      cache: "no-store", credentials: "omit",
    });
    return { ok: answer.ok, status: answer.status, headers: answer.headers, body: await answer.json() };
  } catch {
    return { ok: false, status: 0, headers: new Headers(), body: { error: "the server does not answer", do: "is it running?" } };
  }
}

export function sentence(body) {
  const said = [body.error || "refused"];
  const details = (body.details || []).map((item) => `${item.field} ${item.message}${item.allowed ? ` (allowed ${item.allowed})` : ""}`);
  if (details.length) said.push(details.join("; "));
  else if (body.allowed && body.allowed !== "-") said.push(`allowed is ${body.allowed}`);
  if (body.do && body.do !== "-") said.push(body.do);
  return said.join(": ");
}
