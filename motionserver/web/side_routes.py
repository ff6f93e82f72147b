"""Routes of the side engines: which run beside the driving one."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response

from motionserver.settings.fields import TuningError, algorithms
from motionserver.settings.side_engines import side_names
from motionserver.web.described import takes_engines
from motionserver.web.desk import Desk, read_json
from motionserver.web.refusal import Refusal, json_response
from motionserver.web.requests import tuning_refusal
from motionserver.web.tokens import Role


def side_routes(desk: Desk) -> APIRouter:
    """All routes below /api/side."""
    router = APIRouter()

    @router.get("/api/side")
    async def side(request: Request) -> Response:
        desk.require(request, Role.VIEWER)
        answer = await desk.planner.ask({"op": "side"}, request.url.path)
        return _response(answer, request.url.path)

    @router.post("/api/side", openapi_extra=takes_engines())
    async def run_beside(request: Request) -> Response:
        caller = desk.require(request, Role.OPERATOR)
        path = request.url.path
        body = await read_json(request)
        _check(body, path)
        before = (await desk.planner.ask({"op": "side"}, path)).get("engines")
        answer = await desk.planner.ask({"op": "side", "engines": body["engines"]}, path)
        result = "done" if answer.get("ok") else str(answer.get("kind"))
        desk.audit.note("side", caller, result, old=before, new=body["engines"])
        return _response(answer, path)

    return router


def _check(body: dict[str, Any], path: str) -> None:
    """Say what is wrong before the planner is troubled; it checks again."""
    if set(body) != {"engines"}:
        raise Refusal(422, 'exactly "engines" is expected', path, '{"engines": ["name", ...]}',
                      f"name some of {', '.join(algorithms())}", details=[])  # fmt: skip
    try:
        side_names(body["engines"])
    except TuningError as error:
        details = [item.to_mapping() for item in error.errors]
        raise Refusal(422, "engines that are not allowed", path, error.errors[0].allowed,
                      "correct the names in details", details=details) from error  # fmt: skip


def _response(answer: dict[str, Any], path: str) -> Response:
    if not answer.get("ok"):
        raise tuning_refusal(answer, path)
    body = {name: answer[name] for name in ("engines", "running", "allowed") if name in answer}
    return json_response(body)
