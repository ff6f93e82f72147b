"""How the server drove what `motionserver record` wrote down: the stretch, and all settings."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motion_clients import recording as files

from motionserver.core.axes import Array, frozen
from motionserver.core.limits import Machine, machine_from_mapping
from motionserver.core.safety.states import State

_DRIVEN: Final = State.RUN.value


@dataclass(frozen=True, slots=True)
class Live:
    """A live drive.

    Attributes:
        machine: The platform, with the head point as it was.
        tuning: Tunables at the beginning of the stretch, in the units of the page.
        arm: Driver's head from the point whose motion was sent, (3,) [m].
        planner_hz: Planner rate [Hz].
        lead: From a plan's beginning to where it takes over [s].
        begin: Of the longest stretch in which the platform was driven, by the file's clock [s].
        end: Of that stretch [s].
        remarks: What was not as offline, one line each.
    """

    machine: Machine
    tuning: dict[str, Any]
    arm: Array
    planner_hz: float
    lead: float
    begin: float
    end: float
    remarks: tuple[str, ...] = ()

    def described(self) -> str:
        """What was driven how, in one line."""
        head = ", ".join(f"{value:g}" for value in self.machine.head)
        return (
            f"driven live from {self.begin:.1f} to {self.end:.1f} s of the file by "
            f"{self.tuning.get('algorithm')}, scale {self.tuning.get('scale')}, head at ({head}) m "
            f"on {self.machine.name}, planner {self.planner_hz:g} Hz; taken over where no option "
            "says otherwise"
        )


class NotDrivenError(ValueError):
    """A file of `motionserver record` that cannot be judged; the text says why."""


def live_of(read: files.Recording) -> Live | None:
    """What a recording's settings and states say; None if the server did not write it.

    Raises:
        NotDrivenError: The platform was never driven, or the settings cannot be read.
    """
    if not read.states:
        return None
    stretches = _driven(read.states, read.samples[-1].time)
    if not stretches:
        states = ", ".join(sorted({state for _, state in read.states}))
        raise NotDrivenError(
            f"the platform was never in {_DRIVEN} (only {states}), so nothing was felt: engage it "
            "while it is recorded"
        )
    begin, end = max(stretches, key=lambda one: one[1] - one[0])
    told = [(at, text) for at, text in read.settings if at <= begin] or list(read.settings[:1])
    if not told:
        raise NotDrivenError("it holds no settings: recorded by another version")
    try:
        data = json.loads(told[-1][1])
        period = float(data["planner_period_s"])
        live = Live(
            machine_from_mapping(data["machine"]),
            dict(data["tuning"]),
            frozen(np.array(data["vehicle_head_m"], dtype=np.float64)),
            1.0 / period,
            min(float(data["budget_s"]), period),
            begin,
            end,
            tuple(_remarks(read, stretches, begin, end)),
        )
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise NotDrivenError(f"its settings cannot be read ({error!r})") from error
    return live


def _driven(states: tuple[tuple[float, str], ...], last: float) -> list[tuple[float, float]]:
    """Beginning and end of every stretch in which the platform was driven."""
    ends = [at for at, _ in states[1:]] + [last]
    return [
        (at, end)
        for (at, state), end in zip(states, ends, strict=True)
        if state == _DRIVEN and end > at
    ]


def _remarks(
    read: files.Recording, stretches: list[tuple[float, float]], begin: float, end: float
) -> list[str]:
    out = []
    if len(stretches) > 1:
        out.append(
            f"driven in {len(stretches)} stretches: the longest counts, from {begin:.1f} to "
            f"{end:.1f} s"
        )
    changes = [at for at, _ in read.settings if begin < at <= end]
    if changes:
        out.append(
            f"the tunables were changed {len(changes)} times while it drove, first at "
            f"{changes[0]:.1f} s: judged are those of its beginning"
        )
    return out
