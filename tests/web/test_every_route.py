"""Whatever route there is, it is closed to strangers and changes nothing without a token."""

import itertools

import pytest
from browser.scene import TOKENS
from fastapi import APIRouter, FastAPI
from starlette.responses import Response, StreamingResponse
from starlette.websockets import WebSocket, WebSocketDisconnect
from web_world import AWAY, HERE, World, ask_app, every_route

PUBLIC = {"/", "/healthz", "/static/app.js"}
METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT", "BREW"]
BODIES = [b"", b"{}", b'{"scale": 0.1}', b'{"engines": []}']
CREDENTIALS = [
    {},
    {"authorization": "Bearer " + "x" * 43},
    {"authorization": "Basic " + TOKENS["operator"]},
    {"authorization": TOKENS["operator"]},
    {"cookie": f"token={TOKENS['operator']}; motionserver-token={TOKENS['operator']}"},
    {"x-api-key": TOKENS["operator"]},
    {"x-forwarded-for": "127.0.0.1", "x-real-ip": "127.0.0.1"},
    {"proxy-authorization": "Bearer " + TOKENS["operator"]},
    {"x-http-method-override": "GET"},
]


@pytest.fixture
def world(tmp_path):
    return World(tmp_path)


def paths(app):
    return [path.replace("{name}", "gentle") for _, path in every_route(app)]


def test_all_routes_are_found(world):
    found = every_route(world.app)
    document = {
        (method.upper(), path)
        for path, item in world.app.openapi()["paths"].items()
        for method in item
    }
    listed = {(method, path) for methods, path in found for method in methods}
    assert document <= listed
    assert {path for _, path in found} - {path for _, path in document} == {"/static/app.js"}


def test_a_route_that_is_added_is_found_and_closed(world):
    inner, outer = APIRouter(), APIRouter(prefix="/deep")

    @inner.post("/er")
    async def er():
        world.scene.state = "RUN"
        return Response()

    @world.app.get("/api/new")
    async def new():
        return Response()

    outer.include_router(inner)
    world.app.include_router(outer, prefix="/api")
    assert {"/api/new", "/api/deep/er"} <= set(paths(world.app))
    before = world.state()
    assert world.client(peer=AWAY).get("/api/new").status_code == 401
    assert world.client().post("/api/deep/er").status_code == 401
    assert world.state() == before


def test_what_is_mounted_below_is_found_and_closed_streams_and_sockets_too(world):
    below, deeper = FastAPI(), FastAPI()

    @deeper.post("/change")
    async def change():
        world.scene.state = "RUN"
        return Response()

    @below.get("/stream")
    async def stream():
        return StreamingResponse(iter([b"data: 1\n\n"]), media_type="text/event-stream")

    @below.websocket("/socket")
    async def socket(link: WebSocket):
        await link.accept()

    below.mount("/deeper", deeper)
    world.app.mount("/below", below)
    found = set(paths(world.app))
    assert {"/below/stream", "/below/socket", "/below/deeper/change"} <= found
    before = world.state()
    assert world.client(peer=AWAY).get("/below/stream").status_code == 401
    assert world.client().post("/below/deeper/change").status_code == 401
    with (
        pytest.raises(WebSocketDisconnect),
        world.client("operator").websocket_connect("/below/socket"),
    ):
        pass
    assert world.state() == before


def test_the_stream_is_closed_to_strangers_and_open_to_a_viewer(world):
    stranger = world.client(peer=AWAY)
    assert stranger.get("/api/stream").status_code == 401
    assert stranger.get("/api/stream", headers={"accept": "text/event-stream"}).status_code == 401
    assert "/api/stream" in paths(world.app)


def test_no_file_outside_the_folder_is_served(world):
    for path in (
        "/static/../app.py", "/static/%2e%2e/app.py", "/static/..%2f..%2fweb/auth.py",
        "/static/%2e%2e%2f%2e%2e%2f%2e%2e%2fpyproject.toml", "/static//etc/passwd",
        "/static/\\..\\app.py", "/static/%00", "/static/", "/static/vendor", "/static",
    ):  # fmt: skip
        answer = world.client(peer=AWAY).get(path, follow_redirects=False)
        assert answer.status_code in (401, 404), (path, answer.status_code)
        assert b"import" not in answer.content


def test_strangers_from_elsewhere_get_nothing_but_page_and_health(world):
    client = world.client(peer=AWAY)
    for path in paths(world.app):
        for method in METHODS:
            status = client.request(method, path).status_code
            is_open = path in PUBLIC and method in ("GET", "HEAD")
            assert (status < 400 or status == 405) if is_open else status == 401, (method, path)


@pytest.mark.parametrize("credentials", CREDENTIALS, ids=lambda c: "+".join(c) or "none")
@pytest.mark.parametrize("peer", [HERE, AWAY], ids=["here", "away"])
async def test_nothing_changes_without_a_token(tmp_path, credentials, peer):
    world = World(tmp_path)
    before = world.state()
    common = [("host", "127.0.0.1:8080"), ("if-match", '"1"'), *credentials.items()]
    for path, method, body in itertools.product(paths(world.app), METHODS, BODIES):
        url = f"{path}?token={TOKENS['operator']}&access_token={TOKENS['operator']}"
        more = [("content-type", "application/json"), ("content-length", str(len(body)))]
        answer = await ask_app(world.app, method, url, common + more, body=body, peer=peer)
        if method not in ("GET", "HEAD"):
            assert answer.status in (401, 429), (method, path)
        assert answer.status < 500
    assert world.state() == before


def test_the_role_is_asked_for_on_every_changing_route(world):
    """A viewer's token changes nothing either, but to park."""
    before = world.state()
    for path in paths(world.app):
        for method in ("POST", "PUT", "PATCH", "DELETE"):
            if path == "/api/park":
                continue
            answer = world.client("viewer").request(
                method, path, json={}, headers={"if-match": '"1"'}
            )
            assert answer.status_code in (403, 404, 405), (method, path)
    assert world.state() == before


def test_the_enumeration_sees_more_than_the_list_of_the_application():
    app, router = FastAPI(), APIRouter()
    router.add_api_route("/x", lambda: None)
    app.include_router(router)
    assert "/x" in {path for _, path in every_route(app)}
