"""Where the other processes are found in the run directory."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any, Final, cast

from fastapi import FastAPI

from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.requests import ask
from motionserver.telemetry.run_files import located
from motionserver.web.app import build_app
from motionserver.web.config import WebConfig
from motionserver.web.heart import Heart

GUARD_SNAPSHOT: Final = "guard.map"
PLANNER_SNAPSHOT: Final = "planner.map"
SERVICE_SNAPSHOT: Final = "service.map"
SIGN_OF_LIFE: Final = "page.map"
GUARD_REQUESTS: Final = "guard.sock"
PLANNER_REQUESTS: Final = "planner.sock"
_PATIENCE: Final = 1.0
"""Time to wait for an answer [s]."""


class MappedSnapshot:
    """JSON snapshots in a mapped file that may not be there yet.

    Args:
        path: The mapped file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: MappedFile | None = None
        self._sequence = -1
        self._last: dict[str, Any] | None = None

    def read(self) -> dict[str, Any] | None:
        """The newest snapshot, decoded once.

        Raises:
            OSError: The file is not there.
            ValueError: It holds something else.
        """
        if self._file is None:
            self._file = MappedFile(self._path)
        newest = self._file.read()
        if newest is not None and newest[0] != self._sequence:
            data = json.loads(newest[1])
            if not isinstance(data, dict):
                raise ValueError(f"{self._path}: a snapshot must be a JSON object")
            self._sequence, self._last = newest[0], cast("dict[str, Any]", data)
        return self._last


def wired_app(config: WebConfig) -> FastAPI:
    """The application, connected to guard and planner through the run directory."""
    folder = config.run_dir
    return build_app(
        config,
        MappedSnapshot(located(folder, GUARD_SNAPSHOT)),
        MappedSnapshot(located(folder, PLANNER_SNAPSHOT)),
        MappedSnapshot(located(folder, SERVICE_SNAPSHOT)),
        partial(ask, folder / GUARD_REQUESTS, timeout=_PATIENCE),
        partial(ask, folder / PLANNER_REQUESTS, timeout=_PATIENCE),
        beat=Heart(located(folder, SIGN_OF_LIFE)).beat,
    )
