"""What one evaluation found, and its JSON form."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from motionserver import __version__
from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.disturbance import Disturbance
from motionserver.evaluate.drive import Drive
from motionserver.evaluate.hindsight import HINDSIGHT_RULE, Hindsight
from motionserver.evaluate.metrics.figures import Figures
from motionserver.evaluate.recording import Recording
from motionserver.evaluate.yardstick import RULE, Yardstick

SCHEMA = "motionserver-evaluation-1"


@dataclass(frozen=True, slots=True)
class EvaluateResult:
    """Everything about one recording.

    Attributes:
        recording: The drive.
        machine: The platform.
        tuning: Scale and tunables; its algorithm says nothing.
        rate: Of the executed samples [Hz].
        planner_hz: Planner rate [Hz].
        preview: How far the algorithms were told the recording ahead [s].
        drives: Algorithms as asked for, then yardstick, hindsight, no motion.
        figures: Of the drives, in the same order.
        yardstick: How it was found.
        hindsight: How it was found.
        disturbance: How the algorithms were troubled; None if not.
    """

    recording: Recording
    machine: Machine
    tuning: Tuning
    rate: float
    planner_hz: float
    preview: float
    drives: tuple[Drive, ...]
    figures: tuple[Figures, ...]
    yardstick: Yardstick
    hindsight: Hindsight
    disturbance: Disturbance | None = None

    def of(self, name: str) -> Figures:
        """The figures of one algorithm or rival.

        Raises:
            KeyError: It is not in the table.
        """
        for figures in self.figures:
            if figures.name == name:
                return figures
        raise KeyError(name)

    @property
    def violations(self) -> int:
        """Executed samples beyond any limit, over all drives; must be 0."""
        return sum(figures.workspace.violations for figures in self.figures)

    @property
    def rejected(self) -> int:
        """Proposals the guard's own verification rejected, over all drives; must be 0."""
        return sum(f.planning.rejected for f in self.figures if f.planning is not None)


def to_mapping(result: EvaluateResult) -> dict[str, object]:
    """Everything but the curves as plain numbers and text, SI."""
    tuning = asdict(result.tuning)
    tuning["box"] = result.tuning.box.tolist()
    return {
        "schema": SCHEMA,
        "version": __version__,
        "recording": {
            "name": result.recording.name,
            "duration_s": result.recording.duration,
            "samples": len(result.recording.times),
        },
        "machine": {"name": result.machine.name, "digest": result.machine.digest},
        "head_m": result.machine.head.tolist(),
        "scale": result.tuning.scale,
        "rate_hz": result.rate,
        "planner_hz": result.planner_hz,
        "preview_s": result.preview,
        "tuning": tuning,
        "yardstick": {
            "rule": RULE,
            "gain": result.yardstick.gain,
            "tried": [{"gain": gain, "rmse_xy": rmse} for gain, rmse in result.yardstick.tried],
        },
        "hindsight": {
            "rule": HINDSIGHT_RULE,
            "high_rad_s": result.hindsight.washout.high,
            "low_rad_s": result.hindsight.washout.low,
            "gain": result.hindsight.washout.gain,
            "by": "server" if result.hindsight.by_server else "screen",
            "rmse_xy_screen": result.hindsight.best_screen,
            "rmse_xy_server": result.hindsight.best_server,
            "screened": [asdict(trial) for trial in result.hindsight.screened],
            "driven": [asdict(trial) for trial in result.hindsight.driven],
        },
        "disturbance": None if result.disturbance is None else asdict(result.disturbance),
        "violations": result.violations,
        "rejected": result.rejected,
        "results": [asdict(figures) for figures in result.figures],
    }


def to_json(result: EvaluateResult) -> str:
    """`to_mapping` as text; None is ``null``, there is no NaN."""
    return json.dumps(to_mapping(result), indent=1, allow_nan=False) + "\n"
