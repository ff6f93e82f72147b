"""The page in a real browser over TLS, and another site's page that tries to move the platform."""

import http.server
import json
import threading

from browser.chromium import IN_CHROMIUM
from browser.scene import TOKENS
from web_process import Process, free_port, make_certificate

pytestmark = IN_CHROMIUM
ATTACK = """
async ([target, token]) => {
  const found = {};
  const attempt = async (name, url, options) => {
    try { const a = await fetch(url, options); found[name] = a.type + " " + a.status; }
    catch (error) { found[name] = "blocked"; }
  };
  const auth = { Authorization: `Bearer ${token}`, "Content-Type": "application/json" };
  await attempt("engage", target + "api/engage", { method: "POST", headers: auth });
  await attempt("simple", target + "api/engage", { method: "POST", mode: "no-cors" });
  await attempt("read", target + "api/status", {});
  await attempt("stream", target + "api/stream", { mode: "no-cors" });
  await attempt("page", target, { mode: "no-cors" });
  const socket = new WebSocket(target.replace("http", "ws") + "api/stream");
  found.socket = await new Promise((done) => {
    socket.onopen = () => done("open");
    socket.onerror = () => done("blocked");
  });
  const form = document.createElement("form");
  form.action = target + "api/engage"; form.method = "post"; form.target = "nowhere";
  document.body.append(form);
  form.submit();
  return found;
}
"""


def test_the_page_works_over_tls(chromium, tmp_path):
    cert, key, context = make_certificate(tmp_path, "127.0.0.1")
    with Process(tmp_path, context, tls_cert=str(cert), tls_key=str(key)) as site:
        visit = chromium.new_context(ignore_https_errors=True)
        page = visit.new_page()
        complaints = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(f"https://127.0.0.1:{site.port}/")
        shows = "([s, t]) => document.querySelector(s)?.textContent.includes(t)"
        page.wait_for_function(shows, arg=["#state", "PARKED"])
        page.fill("#token", TOKENS["operator"])
        page.click("#token-use")
        page.wait_for_function(shows, arg=["#role", "operator"])
        page.click("#engage:enabled")
        page.wait_for_function(shows, arg=["#state", "RUN"])
        visit.close()
        assert complaints == []


class Evil(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><body>win a prize</body>")

    def log_message(self, *_):
        pass


def test_another_sites_page_moves_nothing_and_reads_nothing(chromium, tmp_path):
    """Even if it knew the operator's token, and under a name that is the same site."""
    evil = http.server.ThreadingHTTPServer(("127.0.0.1", free_port()), Evil)
    threading.Thread(target=evil.serve_forever, daemon=True).start()
    try:
        with Process(tmp_path) as site:
            before = list(site.scene.events)
            for name in ("127.0.0.1", "localhost"):
                page = chromium.new_page()
                page.goto(f"http://{name}:{evil.server_port}/")
                target = f"http://127.0.0.1:{site.port}/"
                found = page.evaluate(ATTACK, [target, TOKENS["operator"]])
                assert set(found.values()) == {"blocked"}, found
                page.close()
            assert site.scene.events == before
            assert site.scene.state == "PARKED"
            audit = tmp_path / "audit.jsonl"
            lines = audit.read_text("utf-8").splitlines() if audit.exists() else []
            told = {json.loads(line)["action"] for line in lines}
            # a source that comes is told as well; nothing here is done for a page
            assert told <= {"refused", "client takeover"}
    finally:
        evil.shutdown()
        evil.server_close()
