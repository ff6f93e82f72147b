"""Host x Origin x Sec-Fetch x method x path x scheme: the whole table, by a rule of its own."""

import itertools

import pytest
from browser.scene import TOKENS
from starlette.testclient import TestClient
from web_world import HERE, World, ask_app

OWN = "127.0.0.1:8080"
HOSTS = {
    OWN: True,
    "localhost:8080": True,
    "[::1]:8080": True,
    "evil.example": False,
    "127.0.0.1.evil.example:8080": False,
    "evil.example:8080@127.0.0.1": False,
    "127.0.0.1:8080,evil.example": False,
    "192.0.2.1": False,
    "": False,
}
ORIGINS = [
    *(None, "OWN", "OTHER SCHEME", "null", ""),
    *("http://evil.example", "https://127.0.0.1:8080.evil.example", "http://127.0.0.1:9090"),
    *("http://127.0.0.1", "http://user@127.0.0.1:8080", "http://127.0.0.1:8080/", "file://"),
]
SITES = [
    None,
    "same-origin",
    "none",
    "same-site",
    "cross-site",
    "",
    "SAME-ORIGIN",
    "same-origin, none",
]
FETCHES = [(None, None), ("navigate", "document"), ("navigate", "iframe"), ("no-cors", "image"),
           ("cors", "empty"), ("websocket", "websocket")]  # fmt: skip
CALLS = [
    *(("GET", "/"), ("HEAD", "/static/app.js"), ("GET", "/healthz"), ("GET", "/api/status")),
    *(("GET", "/api/stream"), ("GET", "/metrics"), ("POST", "/api/park"), ("POST", "/api/engage")),
    *(
        ("POST", "/"),
        ("PATCH", "/api/tuning"),
        ("PUT", "/api/presets/mine"),
        ("DELETE", "/healthz"),
    ),
    *(("OPTIONS", "/api/engage"), ("OPTIONS", "/static/app.js"), ("BREW", "/api/engage")),
]


def is_page(method, path):
    return method in ("GET", "HEAD") and not path.startswith(("/api", "/metrics"))


def expected(scheme, host, origin, site, fetch, method, path):
    """None = let through, else the status."""
    if not HOSTS[host]:
        return 400
    if origin not in (None, "OWN") and not (origin == "OTHER SCHEME" and scheme == "http"):
        return 403
    followed = is_page(method, path) and fetch == ("navigate", "document")
    return None if site in (None, "same-origin", "none") or followed else 403


def headers_of(scheme, host, origin, site, fetch):
    other = {"http": "https", "https": "http"}[scheme]
    origin = {"OWN": f"{scheme}://{host}", "OTHER SCHEME": f"{other}://{host}"}.get(origin, origin)
    named = {"host": host, "origin": origin, "sec-fetch-site": site}
    named |= {"sec-fetch-mode": fetch[0], "sec-fetch-dest": fetch[1]}
    named["authorization"] = f"Bearer {TOKENS['operator']}"
    return [(name, value) for name, value in named.items() if value is not None]


@pytest.mark.parametrize(
    ("scheme", "method", "path"),
    [*(("http", *call) for call in CALLS), *(("https", *call) for call in CALLS[:8:3])],
)
async def test_the_table(tmp_path, scheme, method, path):
    """The operator's own token is in every request: what is refused, is refused for its site."""
    world = World(tmp_path)
    before = world.state()
    let_through = []
    for case in itertools.product(HOSTS, ORIGINS, SITES, FETCHES):
        must = expected(scheme, *case, method, path)
        if must is None:
            let_through.append(case)
            continue
        answer = await ask_app(world.app, method, path, headers_of(scheme, *case), scheme=scheme)
        assert answer.status == must, (case, answer)
        assert set(answer.json()) == {"error", "where", "allowed", "do"}, case
        assert answer.headers["content-security-policy"].startswith("default-src 'self'")
        assert "access-control-allow-origin" not in answer.headers
    assert world.state() == before
    for case in let_through:
        answer = await ask_app(world.app, method, path, headers_of(scheme, *case), scheme=scheme)
        assert answer.status not in (401, 403), (case, answer)
        assert answer.status < 500, (case, answer)
        assert "access-control-allow-origin" not in answer.headers
    origins = 3 if scheme == "http" else 2
    links = 5 if is_page(method, path) else 0
    assert len(let_through) == 3 * origins * (3 * len(FETCHES) + links)


@pytest.mark.parametrize(
    "name", ["host", "origin", "authorization", "sec-fetch-site", "content-type", "content-length"]
)
def test_a_header_that_decides_something_comes_once(tmp_path, name):
    world = World(tmp_path)
    good = {
        "host": OWN,
        "origin": f"http://{OWN}",
        "authorization": f"Bearer {TOKENS['operator']}",
        "sec-fetch-site": "same-origin",
        "content-type": "application/json",
        "content-length": "2",
    }
    client = TestClient(world.app, base_url=f"http://{OWN}", client=HERE)
    pairs = [*good.items(), (name, good[name])]
    answer = client.post("/api/park", headers=pairs, content=b"{}")
    assert answer.status_code == 400
    assert world.asked == []
    assert client.post("/api/park", headers=list(good.items()), content=b"{}").status_code == 200


@pytest.mark.parametrize("path", ["/", "/api/stream", "/api/status", "/nothing"])
@pytest.mark.parametrize("origin", [None, f"http://{OWN}", "http://evil.example"])
async def test_a_websocket_is_closed_before_it_opens(tmp_path, path, origin):
    world = World(tmp_path)
    headers = [(b"host", OWN.encode()), (b"authorization", TOKENS["operator"].encode())]
    if origin is not None:
        headers.append((b"origin", origin.encode()))
    scope = {"type": "websocket", "scheme": "ws", "path": path, "headers": headers, "client": HERE}
    sent = []

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message)

    await world.app(scope | {"query_string": b"", "raw_path": path.encode()}, receive, send)
    assert sent == [{"type": "websocket.close", "code": 1008}]


async def test_a_body_with_two_lengths_is_refused(tmp_path):
    world = World(tmp_path)
    headers = [
        ("host", OWN),
        ("authorization", f"Bearer {TOKENS['operator']}"),
        ("content-type", "application/json"),
        ("content-length", "2"),
        ("transfer-encoding", "chunked"),
    ]
    answer = await ask_app(world.app, "POST", "/api/park", headers, body=b"{}")
    assert answer.status == 400
    assert world.asked == []
    answer = await ask_app(world.app, "POST", "/api/park", headers[:-1], body=b"{}")
    assert answer.status == 200
