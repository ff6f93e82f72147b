"""Routes of the black box: which dumps there are, and each as a file."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Request
from starlette.responses import FileResponse, Response

from motionserver.telemetry.blackbox.dump import dumps
from motionserver.web.desk import Desk
from motionserver.web.refusal import Refusal, json_response
from motionserver.web.tokens import Role


def blackbox_routes(desk: Desk) -> APIRouter:
    """All routes below /api/blackbox."""
    router = APIRouter()

    def found() -> list[Path]:
        folder = desk.config.blackbox_dir
        return [] if folder is None else dumps(folder)[::-1]

    @router.get("/api/blackbox")
    async def listed(request: Request) -> Response:
        desk.require(request, Role.VIEWER)
        sizes = [{"name": path.name, "bytes": size} for path in found() if (size := _size(path))]
        return json_response({"dumps": sizes})

    @router.get("/api/blackbox/{name}")
    async def one(request: Request, name: str) -> Response:
        desk.require(request, Role.VIEWER)
        path = next((path for path in found() if path.name == name), None)
        if path is None or not _size(path):
            raise Refusal(
                404,
                "there is no such dump of the black box",
                "/api/blackbox/NAME",
                "a name of GET /api/blackbox",
                "list the dumps and ask again",
            )
        headers = {"cache-control": "no-store"}
        return FileResponse(path, filename=name, media_type="application/gzip", headers=headers)

    return router


def _size(path: Path) -> int:
    """Its size [B]; 0 once it has made room for a newer one."""
    try:
        return path.stat().st_size
    except OSError:
        return 0
