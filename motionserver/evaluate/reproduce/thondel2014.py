"""Figures 3 and 4 of Thoendel (ECMS 2014): all runs, and the claims tried on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import radians
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, Axis
from motionserver.core.limits import Machine
from motionserver.evaluate.lockstep import drive as drive_lockstep
from motionserver.evaluate.metrics.workspace import workspace_figures
from motionserver.evaluate.recording import from_samples
from motionserver.evaluate.reproduce import signals
from motionserver.evaluate.reproduce.paper import (
    PAPER,
    Run,
    mpc,
    mpc_measured,
    run_of,
    washout,
    worst_case_scale,
)
from motionserver.evaluate.reproduce.signals import PERIOD, Signal

STANDARD: Final = "standard MCA"
SCALED: Final = "standard MCA, scaled for the worst case"
MPC_BOX: Final = "MPC-MCA"
MPC_TABLE1: Final = "MPC-MCA, Table 1 soft"
MPC_HALVING: Final = "MPC-MCA, halving (7)(8)"
CERTIFIED: Final = "MPC-MCA, leg rows, every plan verified"
CERTIFIED_TABLE1: Final = "same, Table 1 soft"
NOISE_SLOW: Final = "noise, slow disturbance estimate"
NOISE_RAW: Final = "noise, raw substitution"
SHARES: Final = {"step": 0.70, "brake": 0.96, "drive": 0.80}
"""Largest RMSE of MPC-MCA as a share of the scaled washout's."""
NOISE_SHARE: Final = 1.10
"""Largest RMSE with noise as a share of that without."""

Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper, or of ours beside it.

    Attributes:
        text: What is claimed.
        found: What was found, in words and numbers.
        holds: Whether it holds.
    """

    text: str
    found: str
    holds: bool


@dataclass(frozen=True, slots=True)
class Verified:
    """What the full chain adds to a run.

    Attributes:
        violations: Executed samples beyond any limit of the machine.
        rejected: Plans the guard's check rejected.
        whole: Share of plans that went through whole.
    """

    violations: int
    rejected: int
    whole: float


@dataclass(frozen=True, slots=True)
class Reproduction:
    """All runs, by signal and variant.

    Attributes:
        machine: The platform.
        scale: Of the scaled washout.
        runs: By (signal, variant).
        verified: Of the certified variants, by (signal, variant).
        measured: Noisy acceleration of the slow and the raw run on the step [m/s2].
    """

    machine: Machine
    scale: float
    runs: dict[tuple[str, str], Run]
    verified: dict[tuple[str, str], Verified]
    measured: tuple[Array, Array]

    def run(self, signal: str, variant: str) -> Run:
        """One of them."""
        return self.runs[signal, variant]


def run_all(machine: Machine, tell: Told = lambda _: None) -> Reproduction:
    """Drive every variant on every signal.

    Args:
        machine: Platform whose box is Table 2.
        tell: Called with a line of progress.
    """
    every = (signals.step(), signals.brake(), signals.drive())
    scale = worst_case_scale(every[1], machine)
    runs: dict[tuple[str, str], Run] = {}
    verified: dict[tuple[str, str], Verified] = {}
    for signal in every:
        tell(f"{signal.name}: {signal.what}")
        box_only = [
            washout(STANDARD, signal, machine),
            washout(SCALED, signal, machine, scale),
            mpc(MPC_BOX, signal, machine),
            mpc(MPC_TABLE1, signal, machine, replace(PAPER, tilt_rate=radians(3.0))),
            mpc(MPC_HALVING, signal, machine, replace(PAPER, halving="paper")),
        ]
        for run in box_only:
            runs[signal.name, run.name] = run
        for name, rate in ((CERTIFIED, radians(1000.0)), (CERTIFIED_TABLE1, radians(3.0))):
            run, check = _certified(name, signal, machine, rate)
            runs[signal.name, name] = run
            verified[signal.name, name] = check
    tell("step with white noise on the measured acceleration")
    slow, heard_slow = mpc_measured(NOISE_SLOW, every[0], machine, raw=False)
    rough, heard_raw = mpc_measured(NOISE_RAW, every[0], machine, raw=True)
    runs["step", NOISE_SLOW], runs["step", NOISE_RAW] = slow, rough
    return Reproduction(machine, scale, runs, verified, (heard_slow, heard_raw))


def _certified(
    name: str, signal: Signal, machine: Machine, tilt_rate: float
) -> tuple[Run, Verified]:
    """The same signal through the whole server: leg rows, governor, the guard's check, player."""
    count = len(signal.times)
    force = np.zeros((count, 3))
    force[:, 0], force[:, 2] = signal.wanted, GRAVITY
    recording = from_samples(
        signal.name, signal.times, force, np.zeros((count, 3)), np.zeros(count)
    )
    tuning = replace(PAPER, tilt_rate=tilt_rate, legs=True, halving="sound")
    driven = drive_lockstep(machine, recording, tuning, planner_hz=1.0 / PERIOD)
    periods = driven.periods
    assert periods is not None
    space = workspace_figures(machine, driven.pose, driven.legs, 1.0 / driven.rate)
    check = Verified(
        space.violations, sum(periods.rejections.values()), float(np.mean(periods.kappa == 1.0))
    )
    stride = round(driven.rate * PERIOD)
    states = np.stack((driven.pose, driven.velocity, driven.acceleration), 1)[::stride]
    return run_of(name, signal, machine, states, periods.x_max[:, Axis.SURGE]), check


def claims(found: Reproduction) -> list[Claim]:
    """Try every claim."""
    box = found.machine.box
    standard, scaled = found.run("step", STANDARD), found.run("step", SCALED)
    controlled = found.run("step", MPC_BOX)
    reach, lean = float(np.max(np.abs(standard.x))), float(np.max(np.abs(standard.tilt)))
    out = [
        Claim(
            "Fig. 3: the standard MCA leaves both limits, displacement and inclination",
            f"{1e3 * reach:.0f} mm of {1e3 * box[Axis.SURGE]:.0f}, "
            f"{np.degrees(lean):.1f} deg of {np.degrees(box[Axis.PITCH]):.1f}",
            bool(reach > box[Axis.SURGE] and lean > box[Axis.PITCH]),
        ),
        Claim(
            "Fig. 3: it would reproduce the acceleration more accurately",
            f"step: RMSE {standard.rmse:.3f} against {controlled.rmse:.3f} m/s2 of MPC-MCA",
            standard.rmse < controlled.rmse,
        ),
    ]
    for name, share in SHARES.items():
        run, rival = found.run(name, MPC_BOX), found.run(name, SCALED)
        outside = int(run.outside(box).sum())
        out.append(
            Claim(
                f"Fig. 3: MPC-MCA stays within both limits ({name})",
                f"{outside} samples outside, at most {1e3 * np.max(np.abs(run.x)):.1f} mm and "
                f"{np.degrees(np.max(np.abs(run.tilt))):.2f} deg",
                outside == 0,
            )
        )
        out.append(
            Claim(
                f"MPC-MCA beats the washout scaled for the worst case ({name}): <= {share:.2f}",
                f"RMSE {run.rmse:.3f} / {rival.rmse:.3f} = {run.rmse / rival.rmse:.3f}",
                run.rmse <= share * rival.rmse,
            )
        )
    out.append(
        Claim(
            "the scaled washout uses a part of the range only",
            f"step: {1e3 * np.max(np.abs(scaled.x)):.0f} mm against "
            f"{1e3 * np.max(np.abs(controlled.x)):.0f} mm of MPC-MCA",
            float(np.max(np.abs(scaled.x))) < float(np.max(np.abs(controlled.x))),
        )
    )
    for (signal, variant), check in found.verified.items():
        out.append(
            Claim(
                f"every limit of the hexapod is kept ({variant}, {signal})",
                f"{check.violations} samples beyond a limit, {check.rejected} plans rejected; "
                f"RMSE {found.run(signal, variant).rmse:.3f} m/s2",
                check.violations == 0,
            )
        )
    noisy = found.run("step", NOISE_SLOW)
    outside = int(noisy.outside(box).sum())
    out.append(
        Claim(
            "Fig. 4: with noise on the measured acceleration the limits are respected",
            f"{outside} set-points outside, at most {1e3 * np.max(np.abs(noisy.x)):.1f} mm",
            outside == 0,
        )
    )
    out.append(
        Claim(
            f"Fig. 4: and the acceleration is reproduced: at most {NOISE_SHARE:.2f} of the RMSE",
            f"RMSE {noisy.rmse:.3f} / {controlled.rmse:.3f} = {noisy.rmse / controlled.rmse:.3f}",
            noisy.rmse <= NOISE_SHARE * controlled.rmse,
        )
    )
    return out
