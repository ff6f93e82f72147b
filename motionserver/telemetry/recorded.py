"""The file that `motionserver record` writes, and its reader.

Comma-separated values, UTF-8: one header line, then one row per packet to the platform and one per
believed packet of the simulator, as they come. An empty field means that nobody said it: no plan
yet, a planner that is away, an engine that did not run, or a row of the other kind.

| column | meaning |
|---|---|
| time_s | instant of the packet, from the first row [s] |
| state | motion state of the guard: PARKED, RUN, HOLD ...; empty in rows of the simulator |
| surge_m sway_m heave_m | commanded position of the motion reference point from neutral [m] |
| roll_rad pitch_rad yaw_rad | commanded attitude, Rz(yaw) Ry(pitch) Rx(roll), + pitch nose down |
| leg_1_m .. leg_6_m | leg lengths of that pose, pin to pin [m] |
| wanted_x_m_s2 .. z | wanted specific force at the head minus g e_z, scaled and faded [m/s2] |
| felt_x_m_s2 .. z | what the driving engine's plan lets feel at its next hand-over [m/s2] |
| algorithm | what drives |
| kappa | share of its candidate in its plan, 0..1 |
| NAME_x_m_s2 .. z | what the side engine NAME would let feel [m/s2] |
| NAME_kappa | share of its candidate in its plan |
| t | instant of the simulator's packet on the clock of time_s, see `cue_clock` [s] |
| ax ay az | kinematic acceleration of the vehicle, gravity removed by roll and pitch [m/s2] |
| p q r v | body rates [rad/s], forward speed [m/s] |
| roll pitch | attitude of the vehicle, 0 where the simulator tells none [rad] |
| mode | drive, pause, teleport or bye |
| throttle brake clutch steering gear | driver inputs: 0..1, steering wheel [rad], gear |
| sender_time_s sim_time_s | clocks of the sender and of its simulation [s] |
| preview | what was told ahead: t ax ay az p q r for each instant, / between, t from this packet |
| settings | JSON, in the first row and wherever it changed: machine, head, tunables, rates |

NAME runs over all installed algorithms, so that the columns stay the same when engines come and
go. Pose and legs are computed from the accepted plan and the guard's clock; forces are those of the
newest planner period and at most two periods old. From ``t`` on these are the columns of a
recording: `motionserver evaluate`, `tune` and `replay` read the file as it is.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from motionserver.bounded_files import MIB, read_bounded_text
from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.errors import MotionServerError

LARGEST_FILE: Final = 1024 * MIB
"""Largest recording that is read."""
FORCE: Final = ("x_m_s2", "y_m_s2", "z_m_s2")
CUE: Final = (
    *("t", "ax", "ay", "az", "p", "q", "r", "v", "roll", "pitch", "mode"),
    *("throttle", "brake", "clutch", "steering", "gear", "sender_time_s", "sim_time_s", "preview"),
)
"""Columns of what the simulator said."""
SETTINGS: Final = "settings"
_WORDS: Final = ("state", "algorithm")
_OTHERS: Final = (*CUE, SETTINGS)


class RecordError(MotionServerError):
    """A recording cannot be written or read; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recording in memory.

    Attributes:
        numbers: Every column of numbers by its name, (N,); nan where the field is empty.
        words: ``state`` and ``algorithm``, N words each.
        engines: Names of the side engines that ran at least once.
    """

    numbers: dict[str, Array]
    words: dict[str, list[str]]
    engines: tuple[str, ...]

    def force(self, of: str) -> Array:
        """Force (N, 3) of "wanted", "felt" or a side engine [m/s2]."""
        return np.column_stack([self.numbers[f"{of}_{axis}"] for axis in FORCE])


def columns(engines: Sequence[str]) -> list[str]:
    """The header for these names of algorithms."""
    pose = [f"{name}_{'m' if i < 3 else 'rad'}" for i, name in enumerate(AXIS_NAMES)]
    legs = [f"leg_{number}_m" for number in range(1, 7)]
    forces = [f"{of}_{axis}" for of in ("wanted", "felt") for axis in FORCE]
    sides = [f"{name}_{what}" for name in engines for what in (*FORCE, "kappa")]
    platform = ["time_s", "state", *pose, *legs, *forces, "algorithm", "kappa", *sides]
    return [*platform, *_OTHERS]


def read_recorded(path: Path) -> Recorded:
    """Read what the platform did; a last line that was cut off is left out.

    Raises:
        RecordError: It cannot be read, or is no recording.
    """
    try:
        text = read_bounded_text(path, LARGEST_FILE)
        header, *rows = list(csv.reader(io.StringIO(text, newline=""))) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordError(f"{path}: cannot be read ({error})") from error
    names = [name.removesuffix("_kappa") for name in header if name.endswith("_kappa")]
    if header != columns(names):
        raise RecordError(f"{path}: not written by `motionserver record` of this version")
    cut = rows.pop()[:1] if rows and len(rows[-1]) != len(header) else []
    state = header.index("state")
    rows = [row for row in rows if len(row) <= state or row[state]]
    try:
        # what was cut off began as a row at least
        [float(text) for text in cut if text]
        table = {name: [row[i] for row in rows] for i, name in enumerate(header)}
        numbers = {
            name: np.array([float(text) if text else np.nan for text in column])
            for name, column in table.items()
            if name not in _WORDS and name not in _OTHERS
        }
    except (IndexError, ValueError) as error:
        raise RecordError(f"{path}: a row does not fit the header ({error})") from error
    ran = tuple(n for n in names if np.isfinite(numbers[f"{n}_{FORCE[0]}"]).any())
    return Recorded(numbers, {name: table[name] for name in _WORDS}, ran)
