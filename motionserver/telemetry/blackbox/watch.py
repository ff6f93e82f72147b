"""What looks for faults and deaths, and has them written down a moment later."""

from __future__ import annotations

import contextlib
import json
import logging
import signal
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from motionserver.core.safety.states import State
from motionserver.telemetry.blackbox.dump import Trigger, collect, slug_of, write_dump
from motionserver.telemetry.blackbox.history import open_history
from motionserver.telemetry.blackbox.records import KEPT
from motionserver.telemetry.blackbox.room import FOLDER
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.run_files import located

AFTER_NS: Final = 1_000_000_000
"""What follows a fault is kept as well [ns]."""
SPACING_NS: Final = int(KEPT * 1e9)
"""A process that dies again and again: its dumps join without a gap and without an overlap [ns]."""
WRITTEN: Final = frozenset({State.FAULT, State.SAFE})
STATUS_BYTES: Final = 4096
_WEIGHT: Final = tuple(
    f"died-{who}" for who in ("guard", "service", "planner", "spare-guard", "web", "black-box")
)

log = logging.getLogger("motionserver.blackbox")


@dataclass(frozen=True, slots=True)
class _Pending:
    trigger: Trigger
    due_ns: int


class Watch:
    """Looks at the histories; pure but for the files it reads and writes.

    It tells what it did in a mapped file of its own, and goes on from there if it was killed.

    Args:
        run_dir: Where the processes meet.
        folder: Where dumps go.
        kept: How many of them.
        utc: The wall clock, for names.
    """

    def __init__(self, run_dir: Path, folder: Path, kept: int, utc: Callable[[], datetime]) -> None:
        self._run_dir, self._folder, self._kept, self._utc = run_dir, folder, kept, utc
        self._events = open_history(located(run_dir, f"{FOLDER}/guard_events.history"))
        self._service = MappedFile(located(run_dir, "service.map"))
        self._status = MappedFile(located(run_dir, "blackbox.map"), STATUS_BYTES)
        self._pending: list[_Pending] = []
        self._dumped_ns: dict[str, int] = {}
        self._seen_event = self._seen_death_ns = 0
        self._done_event = self._done_death_ns = 0
        self.shown: dict[str, Any] = {"dumps": 0, "failed": 0, "newest": "", "error": ""}
        self._go_on()

    def _go_on(self) -> None:
        message = self._status.read()
        if message is None:
            return
        with contextlib.suppress(ValueError, KeyError, TypeError):
            told = json.loads(message[1])
            self._seen_event = int(told["seen_event"])
            self._seen_death_ns = int(told["seen_death_ns"])
            self._done_event, self._done_death_ns = self._seen_event, self._seen_death_ns
            self.shown = {key: told[key] for key in self.shown}

    def look(self, now_ns: int) -> None:
        """Find what happened, and write down what is due.

        Args:
            now_ns: Now, CLOCK_MONOTONIC [ns].
        """
        for trigger in (*self._states(), *self._deaths()):
            self.add(trigger)
        if any(now_ns >= one.due_ns for one in self._pending):
            self.finish(now_ns)

    def add(self, trigger: Trigger) -> None:
        """Have something written down; a death that repeats waits until its minute is full."""
        log.warning("black box: %s", trigger.text)
        due = trigger.t_ns + AFTER_NS
        last = self._dumped_ns.get(trigger.slug)
        if last is not None and trigger.slug.startswith("died"):
            due = max(due, last + SPACING_NS)
        self._pending.append(_Pending(trigger, due))

    def finish(self, now_ns: int) -> None:
        """Write down all that waits, now."""
        if not self._pending:
            return
        triggers = sorted((one.trigger for one in self._pending), key=lambda one: one.t_ns)
        self._pending = []
        first = min(triggers, key=_rank)
        utc = self._utc()
        try:
            data = collect(self._run_dir, triggers, now_ns, utc)
            path = write_dump(self._folder, data, first.slug, utc, self._kept)
        except OSError as error:
            self.shown["failed"] += 1
            self.shown["error"] = f"{self._folder}: {error.strerror or error}"[:300]
            log.warning("black box: not written, %s; the motion goes on", self.shown["error"])
        else:
            self.shown["dumps"] += 1
            self.shown["newest"] = path.name
            log.info("black box: %s", path)
        for trigger in triggers:
            self._dumped_ns[trigger.slug] = now_ns

    def tell(self, now_ns: int, pid: int) -> None:
        """Show what was done, for `status` and for a successor."""
        if not self._pending:
            self._done_event, self._done_death_ns = self._seen_event, self._seen_death_ns
        self._status.write(
            json.dumps(
                {
                    **self.shown,
                    "pid": pid,
                    "t_ns": now_ns,
                    "seen_event": self._done_event,
                    "seen_death_ns": self._done_death_ns,
                }
            ).encode()
        )

    def _states(self) -> list[Trigger]:
        if self._events is None:
            return []
        found = []
        for sequence, data in self._events.since(self._seen_event):
            self._seen_event = sequence
            with contextlib.suppress(ValueError, KeyError, TypeError):
                event = json.loads(data)
                if event["what"] == "state" and event["state"] in WRITTEN:
                    state, reason = event["state"], event["reason"]
                    slug = slug_of(f"{state} {reason}")
                    found.append(Trigger(int(event["t_ns"]), slug, f"{state}: {reason}"))
        return found

    def _deaths(self) -> list[Trigger]:
        message = self._service.read()
        if message is None:
            return []
        found = []
        with contextlib.suppress(ValueError, KeyError, TypeError):
            for at, name, status, pid in json.loads(message[1])["deaths"]:
                if at > self._seen_death_ns:
                    # the spare has become the guard if it ever said so
                    who = "guard" if "guard" in name and self._was_guard(pid) else name
                    text = f"the {who}, process {pid}, {_how(int(status))}"
                    found.append(Trigger(int(at), slug_of(f"died {who}"), text))
            self._seen_death_ns = max([self._seen_death_ns, *(one.t_ns for one in found)])
        return found

    def _was_guard(self, pid: int) -> bool:
        events = [] if self._events is None else self._events.since()
        with contextlib.suppress(ValueError):
            return any(
                event["what"] == "guard" and event["pid"] == pid
                for event in (json.loads(data) for _, data in events)
            )
        return False


def _rank(trigger: Trigger) -> int:
    """What names a dump: first what happened to the platform, then who died, by weight."""
    return _WEIGHT.index(trigger.slug) + 1 if trigger.slug in _WEIGHT else 0


def _how(status: int) -> str:
    if status >= 0:
        return f"ended with status {status}"
    with contextlib.suppress(ValueError):
        return f"was killed by {signal.Signals(-status).name}"
    return f"was killed by signal {-status}"
