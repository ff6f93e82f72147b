"""The application with a guard and a planner that answer at once, and every route it has."""

import json
from dataclasses import dataclass

from browser.scene import TOKENS, Scene, t2_compact
from starlette.routing import Mount, WebSocketRoute
from starlette.testclient import TestClient

from motionserver.core.limits import machine_to_mapping
from motionserver.settings.tuning_book import TuningBook
from motionserver.web.app import build_app
from motionserver.web.attempts import Attempts
from motionserver.web.config import WebConfig

MACHINE = t2_compact()
HERE = ("127.0.0.1", 50000)
AWAY = ("192.0.2.7", 50000)


class Newest:
    def __init__(self, make):
        self.make = make

    def read(self):
        return self.make()


NONE = Newest(lambda: None)


def is_question(request):
    return set(request) == {"op"} and request["op"] in ("tuning", "side")


class World:
    """One server, with a clock of its own that it is told about."""

    def __init__(self, folder, tokens=TOKENS, **more):
        self.time = 0.0
        self.scene = Scene(MACHINE)
        self.scene.book = TuningBook(MACHINE, self.now)
        self.asked = []
        self.silent = False
        file = folder / "tokens.json"
        file.write_text(json.dumps(tokens))
        file.chmod(0o600)
        values = {"host": "127.0.0.1", "engage": "http", **more}
        self.config = WebConfig(
            port=8080,
            tokens_file=file,
            run_dir=folder,
            audit_file=folder / "audit.jsonl",
            presets_dir=folder / "presets",
            machine=machine_to_mapping(MACHINE),
            **values,
        )
        self.app = build_app(
            self.config,
            Newest(self.scene.guard),
            Newest(self.scene.planner),
            Newest(self.scene.service),
            self.ask(self.scene.answer_guard),
            self.ask(lambda request: self.scene.answer_planner(request)),
            Attempts(lambda: 0.0),
        )

    def now(self):
        self.time += 10.0
        return self.time

    def ask(self, answer):
        def ask(request):
            if self.silent:
                raise TimeoutError
            self.asked.append(request)
            return answer(request)

        return ask

    def client(self, role=None, peer=HERE, **headers):
        if role:
            headers["authorization"] = f"Bearer {TOKENS[role]}"
        return TestClient(self.app, base_url="http://127.0.0.1:8080", client=peer, headers=headers)

    def state(self):
        """Everything a request could change."""
        shelf = self.config.presets_dir
        kept = sorted((p.name, p.read_bytes()) for p in shelf.iterdir()) if shelf.exists() else []
        audit = self.config.audit_file
        noted = audit.read_text().splitlines() if audit.exists() else []
        return (
            self.scene.state,
            self.scene.book.version,
            self.scene.book.model.model_dump(),
            list(self.scene.beside),
            kept,
            # that somebody was refused changes nothing
            [line for line in noted if json.loads(line)["action"] != "refused"],
            [request for request in self.asked if not is_question(request)],
        )


def every_route(app):
    """(methods, path) of each route: of included routers, of applications mounted below, of folders
    (one file stands for a folder), and of websockets."""
    found, waiting = [], [("", route) for route in app.routes]
    while waiting:
        prefix, route = waiting.pop()
        inner = getattr(route, "original_router", None)
        if inner is not None:
            waiting += [(prefix + route.include_context.prefix, one) for one in inner.routes]
        elif isinstance(route, Mount) and route.routes:
            waiting += [(prefix + route.path, one) for one in route.routes]
        elif isinstance(route, Mount):
            found.append((frozenset({"GET", "HEAD"}), prefix + route.path + "/app.js"))
        elif isinstance(route, WebSocketRoute):
            found.append((frozenset({"WEBSOCKET"}), prefix + route.path))
        elif getattr(route, "methods", None):
            found.append((frozenset(route.methods), prefix + route.path))
        else:
            raise AssertionError(f"a kind of route that is not tried: {route!r}")
    return sorted(found, key=lambda one: one[1])


@dataclass(frozen=True, slots=True)
class Answer:
    """What came back."""

    status: int
    headers: dict[str, str]
    body: bytes

    def json(self):
        return json.loads(self.body)


async def ask_app(app, method, path, headers, *, body=b"", scheme="http", peer=HERE):
    """One request straight to the application; who asks leaves once the answer has begun."""
    path, _, query = path.partition("?")
    scope = {
        "type": "http",
        "asgi": {"version": "3.0", "spec_version": "2.3"},
        "http_version": "1.1",
        "method": method,
        "scheme": scheme,
        "path": path,
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "root_path": "",
        "headers": [(name.encode(), value.encode("latin-1")) for name, value in headers],
        "client": peer,
        "server": ("127.0.0.1", 8080),
        "state": {},
    }
    told = [{"type": "http.request", "body": body, "more_body": False}]
    came = []

    async def receive():
        return told.pop() if told else {"type": "http.disconnect"}

    async def send(message):
        came.append(message)

    await app(scope, receive, send)
    start = came[0]
    named = {name.decode(): value.decode("latin-1") for name, value in start["headers"]}
    return Answer(start["status"], named, b"".join(m.get("body", b"") for m in came[1:]))
