"""What the demo's server does: its states, printed as they change, and waiting for one of them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from motionserver.cli.demo_show import line
from motionserver.telemetry.mapped import MappedFile

PATIENCE: Final = 60.0
"""Longest wait for a state [s]."""
SHOW_EVERY: Final = 0.02
"""How often the server's state is looked at [s]."""
_REMIND_EVERY: Final = 5.0
"""How often it is said what is waited for [s]."""
_LINE_EVERY: Final = 1.0
"""How often a line of figures is printed [s]."""
STOPPED: Final = frozenset({"FAULT", "SAFE"})
"""States that only a reset leaves."""
OVERLOADED: Final = "The machine may be overloaded; run `motionserver doctor`."


class DemoError(Exception):
    """The demo cannot go on; the text says why."""


class FaultError(DemoError):
    """The server went into FAULT or SAFE."""


class StateWatch:
    """Follows the snapshots of guard and planner.

    Attributes:
        states: All states so far, oldest first.
        reason: Why the newest state was entered.
        began: When the demo began, on the loop's clock [s].
    """

    def __init__(self, run_dir: Path, say: Callable[[str], None], began: float) -> None:
        """Follow the server of a run directory.

        Args:
            run_dir: Its mapped files exist already.
            say: Prints a line.
            began: What printed times count from, on the loop's clock [s].
        """
        self._guard = MappedFile(run_dir / "guard.map")
        self._planner = MappedFile(run_dir / "planner.map")
        self._say = say
        self.began = began
        self.states: list[str] = []
        self.reason = ""

    @property
    def state(self) -> str:
        """The newest state; "" while the guard has not reported."""
        return self.states[-1] if self.states else ""

    @property
    def time(self) -> float:
        """Time since the demo began [s]."""
        return asyncio.get_running_loop().time() - self.began

    def say(self, text: str) -> None:
        """Print a line with the time."""
        self._say(f"{self.time:6.1f} s  {text}")

    async def show(self) -> None:
        """Print every change of state, and figures while it drives; never returns."""
        printed = self.time
        while True:
            snapshot = _read(self._guard)
            if snapshot is not None:
                self.reason = snapshot["reason"]
                if self.state != snapshot["state"]:
                    self.states.append(snapshot["state"])
                    self.say(f"{self.state}: {self.reason}")
                    printed = self.time
                elif self.time - printed >= _LINE_EVERY and self.state in ("RUN", "HOLD"):
                    self.say(line(snapshot, _read(self._planner)))
                    printed = self.time
            await asyncio.sleep(SHOW_EVERY)

    async def until(self, *wanted: str) -> None:
        """Wait until the server is in one of these states, saying what is waited for.

        Raises:
            FaultError: It went into FAULT or SAFE, which is not among them.
            DemoError: It did not get there in `PATIENCE`.
        """
        begun, known = self.time, len(self.states)
        reminder = self.reminder()
        while self.state not in wanted:
            if self.state in STOPPED and len(self.states) > known:
                raise FaultError(f"{self.state}: {self.reason}")
            if self.time - begun > PATIENCE:
                raise DemoError(
                    f"Timed out after {PATIENCE:g} s waiting for state {' or '.join(wanted)}: "
                    f"{self.situation()}. {OVERLOADED}"
                )
            reminder(f"waiting for state {' or '.join(wanted)}: {self.situation()}")
            await asyncio.sleep(SHOW_EVERY)

    def situation(self) -> str:
        """What the server does now, in words."""
        if not self.states:
            return "the guard has not reported"
        return f"the server is in {self.state} ({self.reason})"

    def reminder(self) -> Callable[[str], None]:
        """What prints a line every few seconds, and not at once."""
        last = self.time

        def remind(text: str) -> None:
            nonlocal last
            if self.time - last >= _REMIND_EVERY:
                last = self.time
                self.say(text)

        return remind


def _read(source: MappedFile) -> dict[str, Any] | None:
    message = source.read()
    return None if message is None else json.loads(message[1])
