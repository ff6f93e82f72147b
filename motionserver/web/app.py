"""The application: every route, and the answers to what goes wrong."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path

from fastapi import FastAPI, Request
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles

from motionserver.settings.tuning_presets import PresetShelf
from motionserver.web.attempts import Attempts
from motionserver.web.audit import Audit
from motionserver.web.auth import Doorkeeper
from motionserver.web.blackbox_routes import blackbox_routes
from motionserver.web.config import WebConfig
from motionserver.web.desk import Desk
from motionserver.web.gate import Gate
from motionserver.web.metrics import registry_for, text_of
from motionserver.web.refusal import Refusal, json_response
from motionserver.web.refusals import Refusals
from motionserver.web.requests import Ask, Peer, guard_refusal
from motionserver.web.side_routes import side_routes
from motionserver.web.snapshot import SnapshotSource, StatusBoard
from motionserver.web.stream import Streams
from motionserver.web.tokens import Role, load_tokens
from motionserver.web.tuning_routes import tuning_routes
from motionserver.web.watch import Watch

_log = logging.getLogger(__name__)
_STATIC = Path(__file__).parent / "static"


def build_app(
    config: WebConfig,
    guard: SnapshotSource,
    planner: SnapshotSource,
    service: SnapshotSource,
    ask_guard: Ask,
    ask_planner: Ask,
    attempts: Attempts | None = None,
    beat: Callable[[], Coroutine[None, None, None]] | None = None,
) -> FastAPI:
    """Put the application together; nothing is bound or started.

    Args:
        config: Configuration of this process.
        guard: Snapshots of the guard.
        planner: Snapshots of the planner.
        service: Snapshots of the service that watches the processes.
        ask_guard: Sends a request to the guard.
        ask_planner: Sends a request to the planner.
        attempts: Keeps who guesses tokens waiting; None = by the real clock.
        beat: Runs beside the watching, for whoever wants to know that the loop turns.

    Raises:
        WebConfigError: The tokens file cannot be used.
    """
    doorkeeper = Doorkeeper(load_tokens(config.tokens_file), attempts or Attempts())
    board = StatusBoard(guard, planner, service, config)
    answered: Counter[str] = Counter()
    audit = Audit(config.audit_file)
    refusals = Refusals(audit)
    watch = Watch(board, audit)

    @asynccontextmanager
    async def watching(_: FastAPI) -> AsyncIterator[None]:
        tasks = [asyncio.create_task(work()) for work in (watch.run, beat) if work is not None]
        yield
        for task in tasks:
            task.cancel()

    app = FastAPI(
        title="motionserver", docs_url=None, redoc_url=None, openapi_url=None, lifespan=watching
    )
    desk = Desk(
        config,
        Peer("guard", ask_guard),
        Peer("planner", ask_planner),
        PresetShelf(config.presets_dir),
        audit,
        refusals,
    )
    _reading_routes(app, desk, board, answered, audit)
    _motion_routes(app, desk)
    app.include_router(tuning_routes(desk))
    app.include_router(side_routes(desk))
    app.include_router(blackbox_routes(desk))
    app.mount("/static", StaticFiles(directory=_STATIC), name="static")
    _error_answers(app)
    app.add_middleware(
        Gate,
        host_names=config.host_names,
        doorkeeper=doorkeeper,
        answered=answered,
        refusals=refusals,
    )
    return app


def _reading_routes(
    app: FastAPI, desk: Desk, board: StatusBoard, answered: Counter[str], audit: Audit
) -> None:
    registry = registry_for(board, answered, audit)
    streams = Streams(board)

    @app.get("/")
    async def page() -> Response:
        return FileResponse(_STATIC / "index.html", headers={"cache-control": "no-cache"})

    @app.get("/healthz")
    async def healthz() -> Response:
        return json_response({"ok": True})

    @app.get("/metrics")
    async def metrics(request: Request) -> Response:
        desk.require(request, Role.VIEWER)
        return Response(text_of(registry), media_type="text/plain; version=0.0.4; charset=utf-8")

    @app.get("/api/status")
    async def status(request: Request) -> Response:
        caller = desk.require(request, Role.VIEWER)
        headers = {"cache-control": "no-store", "x-motion-role": caller.role.name.lower()}
        headers["x-motion-token"] = "yes" if caller.token_id else "no"
        return Response(board.current().text, headers=headers, media_type="application/json")

    @app.get("/api/stream")
    async def stream(request: Request) -> Response:
        caller = desk.require(request, Role.VIEWER)
        return streams.open(request.url.path, caller.address)


def _motion_routes(app: FastAPI, desk: Desk) -> None:
    async def pass_on(request: Request, op: str, role: Role) -> Response:
        caller = desk.require(request, role)
        path = request.url.path
        refusal = desk.config.engage_refusal() if op == "engage" else None
        if refusal is not None:
            desk.audit.note(op, caller, "not by HTTP")
            raise Refusal(403, f"engaging by HTTP is not possible: {refusal}", path,
                          "[operator] engage = http, with a loopback bind or an enable input",
                          "engage at the console")  # fmt: skip
        answer = await desk.guard.ask({"op": op, "by": "http"}, path)
        result = "done" if answer.get("ok") else str(answer.get("reason"))
        desk.audit.note(op, caller, result, state=answer.get("state"))
        if not answer.get("ok"):
            raise guard_refusal(answer, path)
        return json_response(answer)

    @app.post("/api/engage")
    async def engage(request: Request) -> Response:
        return await pass_on(request, "engage", Role.OPERATOR)

    @app.post("/api/park")
    async def park(request: Request) -> Response:
        return await pass_on(request, "park", Role.VIEWER)

    @app.post("/api/reset")
    async def reset(request: Request) -> Response:
        return await pass_on(request, "reset", Role.OPERATOR)


def _error_answers(app: FastAPI) -> None:
    @app.exception_handler(Refusal)
    async def refused(_: Request, refusal: Refusal) -> Response:
        return refusal.response()

    @app.exception_handler(HTTPException)
    async def unknown(request: Request, error: HTTPException) -> Response:
        answer = Refusal(
            error.status_code,
            str(error.detail),
            ascii(request.url.path)[1:-1][:200],
            "the routes listed in the README",
            "check path and method",
            headers=error.headers,
        )
        return answer.response()

    @app.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> Response:
        _log.exception("request failed", exc_info=error)
        answer = Refusal(
            500, "the page's process failed on this request; motion goes on", request.url.path,
            "-", "look at the log of the web process",
        )  # fmt: skip
        return answer.response()
