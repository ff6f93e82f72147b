"""Puts together what a running server does, from its mapped files alone."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan, unpack
from motionserver.telemetry.cue_clock import CueClock
from motionserver.telemetry.cue_history import CueReader
from motionserver.telemetry.cue_rows import cue_row
from motionserver.telemetry.link import STATES, GuardClock, Maps
from motionserver.telemetry.recorded import CUE, RecordError, columns
from motionserver.telemetry.trace import Trace

POLL: Final = 0.004
"""Pause between two looks at the files [s]; packets go out every 5 to 50 ms."""
SILENT_NS: Final = 2_000_000_000
"""A guard that says nothing for longer has ended [ns]."""
_OLD_NS: Final = 300_000_000
"""A trace that is older says nothing about now [ns]."""
_FLUSH_NS: Final = 1_000_000_000
_KEPT: Final = 16


class Recorder:
    """Makes a row of every packet; reads only, so it cannot disturb what it watches.

    Args:
        maps: Mapped files of the run directory.
        machine: For the legs.
        engines: Names of all algorithms, for the columns.
        cues: What the simulator says; None for a recording without it.
        settings: What does not change while a server runs, kept beside the tunables.
    """

    def __init__(
        self,
        maps: Maps,
        machine: Machine,
        engines: Sequence[str],
        cues: CueReader | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        self._maps, self._machine, self._engines = maps, machine, tuple(engines)
        self._cues, self._clock = cues, CueClock(() if cues is None else cues.kept)
        self._settings, self._told_settings = settings, ""
        self._platform_columns = len(columns(engines)) - len(CUE) - 1
        self._plans: dict[int, Plan] = {}
        self._seen = self._seen_plan = -1
        self._sent_ns = 0
        self._began_ns: int | None = None
        self.heard_ns = 0
        self.rows = 0
        self.cue_rows = 0

    def look(self) -> str | None:
        """Look once.

        Returns:
            The row of a packet not seen before; None if there is none.
        """
        if self._maps.accepted.newest_sequence() != self._seen_plan:
            self._take_plan()
        if self._maps.clock.newest_sequence() == self._seen:
            return None
        message = self._maps.clock.read()
        if message is None:
            return None
        self._seen = message[0]
        clock = GuardClock.unpack(message[1])
        self.heard_ns = clock.written_ns
        if clock.newest_id not in self._plans:
            # accepted since the look above; the guard tells a plan before its clock
            self._take_plan()
        if clock.sent_ns == self._sent_ns:
            return None
        self._sent_ns = clock.sent_ns
        if self._began_ns is None:
            self._began_ns = clock.written_ns
        self.rows += 1
        return ",".join(
            (
                f"{(clock.written_ns - self._began_ns) * 1e-9:.6f}",
                STATES[clock.state],
                *self._posture(clock),
                *self._forces(clock.written_ns),
                *[""] * len(CUE),
                _quoted(self._new_settings()),
            )
        )

    def heard(self, is_last: bool = False) -> list[str]:
        """Rows of the simulator's packets that were not seen before.

        Args:
            is_last: True to give out those as well whose time is not known well yet.
        """
        if self._cues is None:
            return []
        timed = self._clock.timed(self._cues.new())
        timed += self._clock.flush() if is_last else []
        began = self._began_ns
        rows = [cue_row((t - began) * 1e-9, cue) for t, cue in timed if began and t >= began]
        self.cue_rows += len(rows)
        return [",".join([""] * self._platform_columns + row + [""]) for row in rows]

    @property
    def missed(self) -> int:
        """Packets of the simulator that came too fast to be read."""
        return 0 if self._cues is None else self._cues.missed

    def _new_settings(self) -> str:
        """What is in force, if it is not what was told last; empty if it is."""
        if self._settings is None:
            return ""
        message = self._maps.planner.read()
        if message is None:
            return ""
        tuning = json.loads(message[1]).get("tuning", {}).get("values")
        text = json.dumps({**self._settings, "tuning": tuning}, separators=(",", ":"))
        if text == self._told_settings:
            return ""
        self._told_settings = text
        return text

    def _take_plan(self) -> None:
        message = self._maps.accepted.read()
        if message is None:
            return
        self._seen_plan = message[0]
        try:
            plan = unpack(message[1])
        except ValueError:
            return
        self._plans.pop(plan.plan_id, None)
        self._plans[plan.plan_id] = plan
        while len(self._plans) > _KEPT:
            del self._plans[next(iter(self._plans))]

    def _posture(self, clock: GuardClock) -> list[str]:
        """Pose and legs, from the plan that is played; from the guard's own word before the first.

        Empty where a plan is played that was replaced before it was read.
        """
        pose = self._played(clock)
        if pose is None and not (clock.newest_id and self._plans):
            # the snapshot is older than the packet: no substitute while a plan is played
            pose = self._told()
        if pose is None:
            return [""] * 12
        return [f"{v:.6f}" for v in (*pose, *leg_lengths(self._machine, pose))]

    def _played(self, clock: GuardClock) -> Array | None:
        plan, time = self._plans.get(clock.newest_id), clock.newest_clock
        while plan is not None and time < 0.0:
            # it waits for its instant: its parent is played
            time += plan.takeover
            plan = self._plans.get(plan.parent_id)
        return None if plan is None else np.asarray(plan.poses(np.array([time]))[0])

    def _told(self) -> Array | None:
        message = self._maps.guard.read()
        return None if message is None else np.array(json.loads(message[1])["pose"])

    def _forces(self, now_ns: int) -> list[str]:
        message = self._maps.trace.read()
        empty = [""] * (8 + 4 * len(self._engines))
        if message is None:
            return empty
        try:
            trace = Trace.unpack(message[1])
        except ValueError:
            return empty
        if now_ns - trace.t_ns > _OLD_NS:
            return empty
        nothing = (None, None, None, None)
        sides = [v for name in self._engines for v in trace.sides.get(name, nothing)]
        forces = [f"{v:.5f}" for v in (*trace.wanted, *trace.felt)]
        return [*forces, trace.algorithm, _share(trace.kappa), *map(_share, sides)]


def _quoted(text: str) -> str:
    """One field, whatever is in it."""
    return '"' + text.replace('"', '""') + '"' if text else ""


def _share(value: float | None) -> str:
    return "" if value is None else f"{value:.5g}"


def write_recording(
    recorder: Recorder,
    engines: Sequence[str],
    out: Path,
    *,
    now_ns: Callable[[], int],
    pause: Callable[[float], None],
    is_over: Callable[[], bool],
) -> str:
    """Record until told to stop, or until the server has ended.

    Args:
        recorder: What makes the rows.
        engines: Names of all algorithms, for the header.
        out: A file that does not exist yet (or a device).
        now_ns: The clock of all processes [ns].
        pause: Sleeps for so long [s].
        is_over: True once to end.

    Returns:
        Why it ended, in words.

    Raises:
        RecordError: The file is there already, or the disk refuses; what was written stays.
    """
    if out.is_file():
        raise RecordError(f"--out {out}: there already. Give the name of a new file.")
    begun = now_ns()
    why = "told to end"
    try:
        with out.open("w", encoding="utf-8", newline="") as stream:
            _line(stream, ",".join(columns(engines)))
            flushed = begun
            while not is_over():
                row = recorder.look()
                now = now_ns()
                if row is not None:
                    _line(stream, row)
                for cue in recorder.heard():
                    _line(stream, cue)
                if row is None and now - max(recorder.heard_ns, begun) > SILENT_NS:
                    why = "the server ended"
                    break
                if now - flushed > _FLUSH_NS:
                    flushed = now
                    stream.flush()
                if row is None:
                    pause(POLL)
            for cue in recorder.heard(is_last=True):
                _line(stream, cue)
    except OSError as error:
        raise RecordError(
            f"--out {out}: {error.strerror or error} after {recorder.rows} rows; the motion goes "
            "on. Free the disk or give another file, then record again."
        ) from error
    return why


def _line(stream: TextIO, text: str) -> None:
    stream.write(text + os.linesep)
