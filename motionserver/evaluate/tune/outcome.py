"""One trial on one recording: drive it with the server's own code, and judge."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np

from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.drive import Drive
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.comfort import rating, tilt_rate
from motionserver.evaluate.metrics.fidelity import FORCE_THRESHOLD
from motionserver.evaluate.metrics.linear import rms
from motionserver.evaluate.metrics.workspace import workspace_figures
from motionserver.evaluate.tune.sickness import weighted_rms
from motionserver.evaluate.tune.stretches import Stretch

_SILENT = 0.05 * FORCE_THRESHOLD


@dataclass(frozen=True, slots=True)
class Outcome:
    """Figures of one drive: of its judged part, or of the whole where that is said.

    Attributes:
        nrmse: RMSE of f_x and f_y together over the rms of what was wanted [-]; 1 = no motion.
        rmse: The RMSE itself [m/s2].
        incongruence: Peak of the incongruence rating over that of standing still [-].
        incongruence_peak: The peak itself [m/s2].
        sickness: W_f-weighted rms of the felt specific force [m/s2].
        rmse_heave: RMSE of f_z [m/s2].
        rmse_rates: RMSE of the body rates together [rad/s].
        tilt_p99: 99th percentile of the tilt rate nobody asked for [rad/s].
        stroke_used: Share of the stroke of the leg that uses most, over the whole drive [-].
        refused: Share of periods whose candidate was refused altogether or missing, over the
            whole drive [-].
        violations: Executed samples beyond a hard limit, over the whole drive; must be 0.
        rejected: Plans the guard's verification rejected, over the whole drive; must be 0.
        broken: Names of the limits broken.
    """

    nrmse: float
    rmse: float
    incongruence: float
    incongruence_peak: float
    sickness: float
    rmse_heave: float
    rmse_rates: float
    tilt_p99: float
    stroke_used: float
    refused: float
    violations: int
    rejected: int
    broken: str

    def to_mapping(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)

    @classmethod
    def from_mapping(cls, data: dict[str, object]) -> Outcome:
        """Back from JSON.

        Raises:
            KeyError: A figure is missing.
        """
        return cls(**{item.name: data[item.name] for item in fields(cls)})  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Job:
    """Everything one drive depends on.

    Attributes:
        machine: Geometry, hard limits, head.
        stretch: What is driven.
        tuning: Algorithm and tunables; its scale is what the algorithm is asked for.
        wanted_scale: Scale of what is wanted, the same in all trials.
        planner_hz: Planner rate [Hz].
    """

    machine: Machine
    stretch: Stretch
    tuning: Tuning
    wanted_scale: float
    planner_hz: float


def run(job: Job) -> Outcome:
    """Drive and judge."""
    driven = drive(job.machine, job.stretch.recording, job.tuning, planner_hz=job.planner_hz)
    return judge(driven, job.stretch, job.wanted_scale / job.tuning.scale)


def judge(driven: Drive, stretch: Stretch, ratio: float = 1.0) -> Outcome:
    """Judge a drive against ``ratio`` times what the algorithm was asked for.

    Raises:
        ConfigError: Next to nothing was wanted, so there is nothing to tune for.
    """
    dt = 1.0 / driven.rate
    judged = slice(round(stretch.lead * driven.rate), None)
    force, rates = driven.felt()
    wanted, turning = ratio * driven.wanted_force, ratio * driven.wanted_rates
    error = (force - wanted)[judged]
    asked = rms(wanted[judged, :2])
    if asked < _SILENT:
        raise ConfigError(
            f"recording {stretch.name}",
            f"between {stretch.start:g} and {stretch.end:g} s it has next to no horizontal force",
            "Leave it out, or judge a longer stretch with --excerpt.",
        )
    peak = float(rating(error, dt).max())
    space = workspace_figures(driven.machine, driven.pose, driven.legs, dt)
    periods = driven.periods
    kappa = np.ones(1) if periods is None else periods.kappa
    return Outcome(
        nrmse=rms(error[:, :2]) / asked,
        rmse=rms(error[:, :2]),
        incongruence=peak / float(rating(wanted[judged], dt).max()),
        incongruence_peak=peak,
        sickness=weighted_rms(force[judged], dt),
        rmse_heave=rms(error[:, 2]),
        rmse_rates=rms((rates - turning)[judged]),
        tilt_p99=float(np.percentile(tilt_rate(turning, rates)[judged], 99)),
        stroke_used=space.stroke_used,
        refused=float(np.mean(~(kappa > 0.0))),
        violations=space.violations,
        rejected=0 if periods is None else sum(periods.rejections.values()),
        broken=", ".join(margin.name for margin in space.margins if margin.violations),
    )
