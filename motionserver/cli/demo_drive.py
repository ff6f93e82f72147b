"""The demo's drive: to RUN, and back to RUN after a fault, since its base is emulated."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from motionserver.cli.demo_watch import OVERLOADED, STOPPED, DemoError, FaultError, StateWatch
from motionserver.telemetry.requests import RequestError, ask

START_PATIENCE: Final = 180.0
"""Longest wait for engaging: the planner loads its solvers [s]."""
RESET_PATIENCE: Final = 60.0
"""Longest wait for the cause of a fault to go [s]."""
_ASK_EVERY: Final = 0.2
MOST_FAULTS: Final = 5
"""Faults within `_NEAR` that end the demo."""
_NEAR: Final = 120.0
"""How close faults are to each other [s]."""
_BEFORE: Final = {"engage": frozenset({"", "OFFLINE", "PARKED"}) | STOPPED, "reset": STOPPED}
"""States in which a request is still to be granted; it may be, and its answer lost."""


class Driver:
    """Engages the demo's server and resets it after faults.

    Attributes:
        faults: State and reason of every fault, oldest first.
    """

    def __init__(
        self, watch: StateWatch, run_dir: Path, check_children: Callable[[], None]
    ) -> None:
        """Drive the server of a run directory.

        Args:
            watch: Follows its states.
            run_dir: Where its guard takes requests.
            check_children: Raises `DemoError` if a process of the demo has ended.
        """
        self._watch, self._run_dir, self._check_children = watch, run_dir, check_children
        self._times: list[float] = []
        self.faults: list[str] = []

    async def reach_run(self) -> None:
        """Engage, and drive; a fault on the way is reset.

        Raises:
            DemoError: It does not get there.
        """
        while True:
            try:
                await self.raise_once()
            except FaultError:
                await self.reset()
            else:
                return

    async def raise_once(self) -> None:
        """Engage, and drive, unless somebody parks meanwhile.

        Raises:
            FaultError: The server went into FAULT or SAFE.
            DemoError: It does not get there.
        """
        await self._watch.until("PARKED")
        await self._request("engage", START_PATIENCE)
        await self._watch.until("RAISING", "READY", "RUN", "HOLD")
        await self._watch.until("RUN", "PARKED")

    async def keep_driving(self, until: float | None) -> None:
        """Drive until an instant of the demo's time [s], or for ever; faults are reset.

        Raises:
            DemoError: It cannot go on.
        """
        hinted = 0
        while until is None or self._watch.time < until:
            self._check_children()
            if self._watch.state in STOPPED:
                await self.reset()
                await self.reach_run()
                self._watch.say("driving again after the fault")
            if self._watch.state == "PARKED" and len(self._watch.states) > hinted:
                hinted = len(self._watch.states)
                self._watch.say("parked; to drive on: Engage on the page, or `motionserver engage`")
            await asyncio.sleep(_ASK_EVERY)

    async def reset(self) -> None:
        """Say what happened, and leave FAULT or SAFE once the cause is gone.

        Raises:
            DemoError: The cause stays, or faults come again and again.
        """
        what = f"{self._watch.state}: {self._watch.reason}"
        self.faults.append(what)
        self._times.append(self._watch.time)
        if sum(self._watch.time - at < _NEAR for at in self._times) >= MOST_FAULTS:
            raise DemoError(
                f"{MOST_FAULTS} faults within {_NEAR:g} s, the last: {what}. {OVERLOADED}"
            )
        self._watch.say(
            f"{self._watch.state} means that nothing is cued until somebody resets it, on a real "
            "base a person who has found the cause; this base is emulated, so that the demo resets "
            "by itself. The last minute before it: `motionserver blackbox show`"
        )
        await self._request("reset", RESET_PATIENCE)
        self._watch.say("the cause is gone: reset")

    async def _request(self, op: str, patience: float) -> None:
        """Ask until it is granted."""
        begun = self._watch.time
        reminder = self._watch.reminder()
        while self._watch.state in _BEFORE[op]:
            self._check_children()
            try:
                request = {"op": op, "by": "console"}
                answer: dict[str, Any] = await asyncio.to_thread(
                    ask, self._run_dir / "guard.sock", request
                )
                if answer["ok"]:
                    return
                why = f"refused in {answer['state']} ({answer['reason']})"
            except RequestError as error:
                why = str(error)
            if op != "reset" and self._watch.state in STOPPED:
                raise FaultError(f"{self._watch.state}: {self._watch.reason}")
            if self._watch.time - begun > patience:
                raise DemoError(
                    f"Timed out after {patience:g} s waiting for {op} to be granted: {why}. "
                    f"{OVERLOADED}"
                )
            reminder(f"waiting for {op} to be granted: {why}")
            await asyncio.sleep(_ASK_EVERY)
