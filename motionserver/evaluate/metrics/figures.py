"""All figures of one drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from motionserver.evaluate.drive import Drive
from motionserver.evaluate.metrics.comfort import ComfortFigures, comfort_figures
from motionserver.evaluate.metrics.fidelity import (
    FORCE_THRESHOLD,
    RATE_THRESHOLD,
    AxisFigures,
    axis_figures,
    ratio,
)
from motionserver.evaluate.metrics.horizontal import HorizontalFigures, horizontal_figures
from motionserver.evaluate.metrics.linear import rms
from motionserver.evaluate.metrics.perceived import perceived
from motionserver.evaluate.metrics.planning import PlanningFigures, planning_figures
from motionserver.evaluate.metrics.workspace import WorkspaceFigures, workspace_figures

FORCE_AXES: Final = ("f_x", "f_y", "f_z")
RATE_AXES: Final = ("w_x", "w_y", "w_z")


@dataclass(frozen=True, slots=True)
class Figures:
    """Everything printed about one algorithm on one recording.

    Attributes:
        name: Algorithm or rival.
        rmse_xy: RMSE of the horizontal specific force, x and y together [m/s2].
        nrmse_xy: The same over the rms of the reference; None if that is nothing.
        xy: More about x and y together.
        axes: f_x, f_y, f_z, w_x, w_y, w_z.
        comfort: Incongruence, tilt, washout.
        workspace: Margins and violations.
        planning: Of an algorithm; None for a rival that plans nothing.
    """

    name: str
    rmse_xy: float
    nrmse_xy: float | None
    xy: HorizontalFigures
    axes: tuple[AxisFigures, ...]
    comfort: ComfortFigures
    workspace: WorkspaceFigures
    planning: PlanningFigures | None

    def axis(self, name: str) -> AxisFigures:
        """The figures of one axis by name."""
        return next(axis for axis in self.axes if axis.axis == name)


def rmse_xy(drive: Drive) -> float:
    """RMSE of the horizontal specific force, x and y together [m/s2]."""
    return rms(drive.felt()[0][:, :2] - drive.wanted_force[:, :2])


def figures_of(drive: Drive) -> Figures:
    """Judge one drive on its executed samples."""
    dt = 1.0 / drive.rate
    force, rates = drive.felt()
    sensed_wanted = perceived(drive.wanted_force, drive.wanted_rates, dt)
    sensed_felt = perceived(force, rates, dt)
    axes = tuple(
        axis_figures(
            name,
            (drive.wanted_force if i < 3 else drive.wanted_rates)[:, i % 3],
            (force if i < 3 else rates)[:, i % 3],
            sensed_wanted[:, i],
            sensed_felt[:, i],
            dt,
            FORCE_THRESHOLD if i < 3 else RATE_THRESHOLD,
        )
        for i, name in enumerate((*FORCE_AXES, *RATE_AXES))
    )
    error = rmse_xy(drive)
    return Figures(
        drive.name,
        error,
        ratio(error, rms(drive.wanted_force[:, :2]), 0.05 * FORCE_THRESHOLD),
        horizontal_figures(
            drive.wanted_force[:, :2],
            force[:, :2],
            sensed_wanted[:, :2],
            sensed_felt[:, :2],
            dt,
        ),
        axes,
        comfort_figures(
            drive.wanted_force, drive.wanted_rates, force, rates, drive.acceleration, dt
        ),
        workspace_figures(drive.machine, drive.pose, drive.legs, dt),
        None if drive.periods is None else planning_figures(drive.periods),
    )
