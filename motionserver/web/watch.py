"""What happened without the page: an operator at the console, another client, another guard."""

from __future__ import annotations

import asyncio
import logging
import re
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from motionserver.web.audit import Audit
from motionserver.web.refusals import Budget
from motionserver.web.snapshot import StatusBoard

PERIOD: Final = 0.5
"""Time between two looks [s]."""
_TOLD: Final = re.compile(r"-> (RAISING|PARKING|FAULT|SAFE):|an operator|the guard before|leaving")
"""Events of the guard that somebody caused or must know of; not that a source comes and goes."""
_LONGEST: Final = 200
_LONGEST_CAUSE: Final = 500

_log = logging.getLogger(__name__)


class Watch:
    """Looks at the status now and then, and writes to the audit log what has changed hands.

    Args:
        board: The status.
        audit: The log.
        now: Monotonic clock [s].
    """

    def __init__(
        self, board: StatusBoard, audit: Audit, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._board, self._audit = board, audit
        self._budget = Budget(30, 60.0, now)
        self._client: dict[str, Any] | None = None
        self._guard: int | None = None
        self._fallback = ""
        self._seen_ns: int | None = None

    async def run(self) -> None:
        """Look until cancelled."""
        while True:
            try:
                self.look()
            except Exception:
                # what another process writes must not end the watching
                _log.exception("the status could not be watched")
            await asyncio.sleep(PERIOD)

    def look(self) -> None:
        """Compare with the last look; the first one only remembers."""
        data = self._board.current().data
        self._look_at_client(data.get("planner") or {})
        self._look_at_tuning(data.get("planner") or {})
        if data["processes"]["guard"]["alive"]:
            self._look_at_guard(data.get("guard") or {})

    def _look_at_client(self, planner: Mapping[str, Any]) -> None:
        source = planner.get("source") or {}
        if source.get("address") is None:
            return
        client = {name: source.get(name) for name in ("kind", "address", "session")}
        if client != self._client:
            self._write({"action": "client takeover", "old": self._client, "new": client})
            self._client = client

    def _look_at_tuning(self, planner: Mapping[str, Any]) -> None:
        """A planner that took another tuning at its start than the one kept; also at first sight.

        It falls back before anybody could have looked.
        """
        tuning = planner.get("tuning") or {}
        fallback = str(tuning.get("fallback") or "")[:_LONGEST_CAUSE]
        if fallback and fallback != self._fallback:
            version = tuning.get("version")
            self._write({"action": "tuning fallback", "text": fallback, "version": version})
        self._fallback = fallback

    def _look_at_guard(self, guard: Mapping[str, Any]) -> None:
        pid = guard.get("pid")
        if self._guard is not None and pid != self._guard:
            state = guard.get("state")
            self._write(
                {"action": "guard takeover", "old": self._guard, "new": pid, "state": state}
            )
        self._guard = pid
        events = guard.get("events") or []
        newest = max((event["t_ns"] for event in events), default=0)
        if self._seen_ns is not None:
            for event in events:
                if event["t_ns"] > self._seen_ns and _TOLD.search(event["text"]):
                    self._write({"action": "guard", "text": event["text"][:_LONGEST]})
        self._seen_ns = max(newest, self._seen_ns or 0)

    def _write(self, entry: dict[str, Any]) -> None:
        unwritten = self._budget.take()
        if unwritten is not None:
            self._audit.write(entry | ({"unwritten": unwritten} if unwritten else {}))
