"""Routes of the tuning: read, change, undo, presets."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from fastapi import APIRouter, Request
from starlette.responses import Response

from motionserver.core.limits import Machine
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning import TuningModel, apply_changes, default_for, describe
from motionserver.settings.tuning_presets import Preset, PresetShelf
from motionserver.settings.tuning_scope import without_effect
from motionserver.web.described import takes_tunables, versioned
from motionserver.web.desk import Desk, read_json
from motionserver.web.refusal import Refusal, json_response
from motionserver.web.requests import tuning_refusal
from motionserver.web.tokens import Role

_READ_BACK: Final = ("in_force", "is_ramping", "retune_error", "fallback")
"""What the planner read from its engine, beside the values asked for."""
_TAG: Final = re.compile(r'"([0-9]{1,15})"')


def tuning_routes(desk: Desk) -> APIRouter:
    """All routes below /api/tuning and /api/presets."""
    router = APIRouter()
    machine = desk.config.hexapod()
    fields = describe(machine)

    @router.get("/api/tuning")
    async def tuning(request: Request) -> Response:
        desk.require(request, Role.VIEWER)
        answer = await desk.planner.ask({"op": "tuning"}, request.url.path)
        return _tuning_response(answer, request, fields=fields)

    @router.patch("/api/tuning", openapi_extra=versioned(takes_tunables(needed=True)))
    async def tune(request: Request) -> Response:
        caller = desk.require(request, Role.TUNER)
        version = _if_match(request)
        changes = await read_json(request)
        _checked(changes, request.url.path)
        asked = {"op": "tune", "if_version": version, "changes": changes}
        before = await desk.planner.ask({"op": "tuning"}, request.url.path)
        answer = await desk.planner.ask(asked, request.url.path)
        noted = {"changes": _changed(before, answer)} if answer.get("ok") else {"asked": changes}
        desk.audit.note("tune", caller, _result(answer), version=version, **noted)
        return _tuning_response(answer, request)

    @router.post("/api/tuning/undo", openapi_extra=versioned())
    async def undo(request: Request) -> Response:
        caller = desk.require(request, Role.TUNER)
        version = _if_match(request)
        before = await desk.planner.ask({"op": "tuning"}, request.url.path)
        answer = await desk.planner.ask({"op": "undo", "if_version": version}, request.url.path)
        noted = {"changes": _changed(before, answer)} if answer.get("ok") else {}
        desk.audit.note("undo", caller, _result(answer), version=version, **noted)
        return _tuning_response(answer, request)

    @router.get("/api/presets")
    async def presets(request: Request) -> Response:
        desk.require(request, Role.VIEWER)
        found = []
        for name in desk.presets.names():
            try:
                found.append(_whole(desk.presets.read(name), machine))
            except (KeyError, TuningError):
                continue
        return json_response({"presets": found})

    @router.get("/api/presets/{name}")
    async def preset(request: Request, name: str) -> Response:
        desk.require(request, Role.VIEWER)
        try:
            return json_response(_whole(desk.presets.read(name), machine))
        except KeyError:
            raise _no_preset(request.url.path) from None
        except TuningError as error:
            raise _invalid(error, request.url.path) from error

    @router.put("/api/presets/{name}", openapi_extra=takes_tunables(needed=False))
    async def save(request: Request, name: str) -> Response:
        caller = desk.require(request, Role.TUNER)
        asked = await read_json(request, empty={})
        path = request.url.path
        if asked:
            values = _state(asked, path).live_values()
        else:
            answer = await desk.planner.ask({"op": "tuning"}, path)
            kept: dict[str, Any] = answer.get("values") or {}
            values = _checked(kept, path).live_values()
        before = _values_of(desk.presets, name)
        try:
            saved = desk.presets.save(name, "Saved from the page.", values)
        except TuningError as error:
            raise _invalid(error, path) from error
        except OSError as error:
            raise Refusal(507, f"not saved: {error.strerror}", path, "a writable presets directory",
                          "look at the disk") from error  # fmt: skip
        changes = differences(before, dict(saved.values))
        desk.audit.note("save preset", caller, "done", name=name, changes=changes)
        return json_response(_whole(saved, machine), 201)

    def _checked(changes: dict[str, Any], path: str) -> TuningModel:
        """Say what is wrong before the planner is troubled; it checks again."""
        try:
            wanted = apply_changes(default_for(machine), changes)
            wanted.check_machine(machine)
        except TuningError as error:
            raise _invalid(error, path) from error
        return wanted

    def _state(values: dict[str, Any], path: str) -> TuningModel:
        """A whole state: these values and the defaults; none that its algorithm does not read."""
        wanted = _checked(values, path)
        unread = without_effect(values, wanted.algorithm, (default_for(machine).values(),))
        if unread:
            raise _invalid(TuningError(unread), path)
        return wanted

    return router


def _if_match(request: Request) -> int:
    tag = request.headers.get("if-match")
    path = request.url.path
    if tag is None:
        raise Refusal(428, "If-Match is missing", path, 'If-Match: "<version>"',
                      "read GET /api/tuning and send its ETag")  # fmt: skip
    match = _TAG.fullmatch(tag.strip())
    if match is None:
        raise Refusal(412, "If-Match is not one version", path, 'If-Match: "<version>"',
                      "send the ETag of GET /api/tuning as it is")  # fmt: skip
    return int(match[1])


def _tuning_response(answer: dict[str, Any], request: Request, **more: object) -> Response:
    if not answer.get("ok"):
        raise tuning_refusal(answer, request.url.path)
    read_back = {name: answer[name] for name in _READ_BACK if name in answer}
    body: dict[str, Any] = {"version": answer["version"], "values": answer["values"]}
    body |= read_back | more
    return json_response(body, headers={"etag": f'"{answer["version"]}"'})


def _result(answer: dict[str, Any]) -> str:
    return "done" if answer.get("ok") else str(answer.get("kind"))


def _changed(before: dict[str, Any], answer: dict[str, Any]) -> dict[str, Any]:
    """What a change that was accepted changed; without old values if it was not on top of these."""
    old = before.get("values") if before.get("ok") else None
    return differences(old or {}, answer.get("values") or {})


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """The names whose values differ, each with its old value beside the new one.

    A value that was not there, or is there no more, is null.
    """
    names = sorted(old.keys() | new.keys())
    return {
        name: {"old": old.get(name), "new": new.get(name)}
        for name in names
        if old.get(name) != new.get(name)
    }


def _values_of(shelf: PresetShelf, name: str) -> dict[str, Any]:
    try:
        return dict(shelf.read(name).values)
    except (KeyError, TuningError, OSError):
        return {}


def _whole(preset: Preset, machine: Machine) -> dict[str, Any]:
    """A preset with every tunable of its state.

    Raises:
        TuningError: A value is not allowed on this machine.
    """
    model, warnings = preset.whole(machine)
    return {
        "name": preset.name,
        "about": preset.about,
        "built_in": preset.built_in,
        "values": model.values(),
        "warnings": list(warnings),
    }


def _no_preset(path: str) -> Refusal:
    return Refusal(404, "no preset of that name", path, "a name listed by GET /api/presets",
                   "choose one of these")  # fmt: skip


def _invalid(error: TuningError, path: str) -> Refusal:
    details = [item.to_mapping() for item in error.errors]
    known = len(TuningModel.model_fields)
    return Refusal(422, "values outside what is allowed", path, "see details",
                   "correct the values named in details", details=details[: 2 * known])  # fmt: skip
