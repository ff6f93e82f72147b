"""Who drives which recording how, and by what its result is known again."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import motion_clients
import numpy as np
from motion_protocol import preview_times

import motionserver
from motionserver.bounded_files import MIB, read_bounded
from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.disturbance import Disturbance
from motionserver.evaluate.progress import Share

LARGEST_RECORDING: Final = 1024 * MIB
RIVALS: Final = ("yardstick", "hindsight", "no motion")
"""Always in the table."""
PREDICTING: Final = ("default", "constant", "preview")
"""Ways in which an algorithm that predicts is driven."""
_WITHOUT_REFERENCE: Final = ("classical",)
_OF_ALGORITHMS: Final = (
    "cueing/mpc",
    "cueing/thondel",
    "cueing/perception",
    "cueing/predictor",
    "cueing/tuning",
    "cueing/vehicle_plant",
    "cueing/standstill",
    "cueing/side",
    "cueing/scores",
    "cueing/autoregression",
    "cueing/reference_",
    "solvers/",
)
"""Files a rival does not depend on; values of the tuning stand in its key themselves."""
_READERS: Final = ("csv_", "drive_samples", "recording", "units")


@dataclass(frozen=True, slots=True)
class Contender:
    """One line of the table.

    Attributes:
        name: Algorithm or rival.
        way: "default", "constant", "preview", "held out"; empty for a rival.
        tuning: Tunables.
        preview: How far the recording is told ahead [s].
        disturbance: Trouble; none if None.
    """

    name: str
    way: str
    tuning: Tuning
    preview: float = 0.0
    disturbance: Disturbance | None = None

    @property
    def label(self) -> str:
        """For people."""
        if self.way == "default" and self.name not in _WITHOUT_REFERENCE:
            return f"{self.name} ({self.tuning.reference})"
        if self.way == "preview":
            return f"{self.name} (told {self.preview:g} s ahead)"
        if self.way == "held out":
            return f"{self.name} (tuned on the others)"
        return f"{self.name} (constant)" if self.way == "constant" else self.name


@dataclass(frozen=True, slots=True)
class Task:
    """One contender on one recording.

    Attributes:
        recording: The file.
        contender: Who.
        machine: The platform.
        rate: Rate of judging [Hz].
        planner_hz: Planner rate [Hz].
        gain: For hindsight the yardstick's on the same recording; searched if None.
        share: Called with the share done; None in a process of its own.
    """

    recording: Path
    contender: Contender
    machine: Machine
    rate: float
    planner_hz: float
    gain: float | None = None
    share: Share | None = None

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.recording.stem}: {self.contender.label}"

    def key(self) -> str:
        """Hash of everything its result depends on, the server's own code included."""
        contender = self.contender
        tuning: dict[str, Any] = asdict(contender.tuning)
        tuning["box"] = contender.tuning.box.tolist()
        words = [
            hashlib.sha256(read_bounded(self.recording, LARGEST_RECORDING)).hexdigest(),
            contender.name,
            repr(sorted(tuning.items())),
            repr((preview_times(contender.preview), contender.disturbance)),
            repr((self.rate, self.planner_hz)),
            self.machine.digest,
            _code(contender.name in RIVALS),
        ]
        return hashlib.sha256("\n".join(words).encode()).hexdigest()[:24]


def contenders(
    algorithms: list[str],
    tuning: Tuning,
    preview: float,
    disturbance: Disturbance | None,
    held_out: Tuning | None = None,
) -> list[Contender]:
    """All lines of the table: each algorithm in each of its ways, then the rivals.

    A way that is no other than the default (its reference is the constant one already) is left
    out.

    Args:
        algorithms: Their names.
        tuning: Tunables of all.
        preview: How far the recording is told ahead in that way [s].
        disturbance: Trouble for the algorithms; none if None.
        held_out: The algorithms' tunables on this recording, chosen on others, in place of
            ``tuning``.
    """
    out = []
    for name in algorithms:
        own = replace(held_out or tuning, algorithm=name)
        way = "default" if held_out is None else "held out"
        out.append(Contender(name, way, own, 0.0, disturbance))
        if name in _WITHOUT_REFERENCE:
            continue
        if held_out is None and tuning.reference != "constant":
            constant = replace(own, reference="constant")
            out.append(Contender(name, "constant", constant, 0.0, disturbance))
        out.append(Contender(name, "preview", own, preview, disturbance))
    # a rival has filters of its own: what only concerns the others must not spoil its cache
    plain = replace(
        Tuning(),
        scale=tuning.scale,
        rotation_gain=tuning.rotation_gain,
        tilt_rate=tuning.tilt_rate,
        box=tuning.box,
    )
    return [*out, *(Contender(name, "", plain) for name in RIVALS)]


@cache
def _code(rival: bool) -> str:
    """Hash of the files that plan and play; a rival does not depend on other algorithms."""
    root = Path(motionserver.__file__).parent
    digest = hashlib.sha256(np.__version__.encode())
    for folder in ("core", "cueing", "solvers", "evaluate"):
        for path in sorted((root / folder).rglob("*")):
            name = path.relative_to(root).as_posix()
            judging = folder == "evaluate" and not name.startswith("evaluate/metrics")
            if path.suffix == ".pyc" or not path.is_file() or (judging and not _drives(name)):
                continue
            if rival and name.startswith(_OF_ALGORITHMS):
                continue
            digest.update(name.encode())
            digest.update(path.read_bytes())
    # who reads the file decides what it says
    for path in sorted(Path(motion_clients.__file__).parent.glob("*.py")):
        if path.stem.startswith(_READERS):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _drives(name: str) -> bool:
    """Whether a file of this folder moves the platform rather than draws it."""
    stem = name.removeprefix("evaluate/").removesuffix(".py")
    return stem in {
        "disturbance",
        "drive",
        "hearing",
        "hindsight",
        "lockstep",
        "recording",
        "screen",
        "yardstick",
        "compare/run",
    }
