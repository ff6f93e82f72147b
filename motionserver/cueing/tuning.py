"""Everything that may be tuned while the platform moves, in SI. Hard limits are not here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from math import radians
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen

Option = float | bool | str
"""Value of a plug-in's own option."""


@dataclass(frozen=True, slots=True)
class Tuning:
    """Tunables of all algorithms; which of them an algorithm reads, it declares itself.

    Attributes:
        algorithm: "mpc", "thondel2014" or "classical".
        scale: Share of the vehicle's specific force and rates that is wanted, 0..1 [-].
        gain: Gain of the classical washout on top of the scale, 0..1 [-].
        rotation_gain: Share of the vehicle's own roll and pitch rate that is shown, 0..1 [-].
        tilt_rate: Perception threshold of tilt coordination [rad/s]; soft in the MPC, in the
            loop of the classical washout.
        tilt_acceleration: Threshold of angular acceleration [rad/s2]; soft, see
            tilt_acceleration_weight.
        tilt_acceleration_weight: Weight of exceeding it; 0 = row off [-].
        box: Position limits per axis, (6,) [m, rad] (Table 2); at most the machine's.
        horizon: Prediction horizon [s].
        weight_force: Weight of the specific-force error.
        weight_input: Weight of the washout's input leaving the reference.
        weight_change: Weight of changing the input.
        weight_position: Weight of being away from neutral.
        filters: Filter set of the washout: "standard" or "fig3".
        reference: Reference model of surge and sway, see `reference.MODELS`.
        legs: Leg-length rows in the MPC; False is the paper's box-only form.
        halving: "off", "paper" (equations 7 and 8 as printed) or "sound".
        backend: QP solver, see `solvers.registry.BACKENDS`.
        predictor: File of the fitted predictor that the reference "learned" uses; "" for none.
        mpc_weight_heave: Weight of the vertical force error, horizontal is 1.
        mpc_weight_rates: Weight of the body-rate error, per (rad/s)2.
        mpc_weight_position: Weight of being away from neutral, surge and sway, per m2.
        mpc_weight_attitude: The same of roll and pitch, per rad2.
        mpc_weight_tilt_rate: Price of exceeding tilt_rate, in units of it.
        mpc_trust: How far a reference model is believed: weights of the error fall to 1/e at
            that time after the last thing known [s].
        perception: Weighting of the error: "none", "telban-cardullo" or "reid-nahon".
        options: What plug-ins have of their own: by algorithm, then by the name the plug-in gave.
    """

    algorithm: str = "mpc"
    scale: float = 0.6
    gain: float = 0.7
    rotation_gain: float = 1.0
    tilt_rate: float = radians(3.0)
    tilt_acceleration: float = radians(0.3)
    tilt_acceleration_weight: float = 0.0
    box: Array = field(
        default_factory=lambda: frozen([0.198, 0.220, 0.200, *np.radians([17.5, 16.3, 17.5])])
    )
    horizon: float = 2.0
    weight_force: float = 1.0
    weight_input: float = 0.2
    weight_change: float = 0.02
    weight_position: float = 2.8
    filters: str = "standard"
    reference: str = "ar"
    legs: bool = True
    halving: str = "sound"
    backend: str = "daqp"
    predictor: str = ""
    mpc_weight_heave: float = 0.3
    mpc_weight_rates: float = 5.0
    mpc_weight_position: float = 0.1
    mpc_weight_attitude: float = 0.05
    mpc_weight_tilt_rate: float = 2.0
    mpc_trust: float = 1.0
    perception: str = "none"
    options: Mapping[str, Mapping[str, Option]] = field(default_factory=dict)

    @property
    def own(self) -> Mapping[str, Option]:
        """Options of the algorithm that is named, as its plug-in declared them."""
        return self.options.get(self.algorithm, {})


TUNABLES: Final = frozenset(item.name for item in fields(Tuning)) - {"options"}
"""Names of all tunables that algorithms share."""
COMMON: Final = frozenset({"algorithm", "scale"})
"""Tunables that act in front of every algorithm."""
AT_ONCE: Final = frozenset({"horizon"})
"""Numbers that are not ramped: each step would build the algorithm's programme anew."""


def blend(old: Tuning, new: Tuning, share: float) -> Tuning:
    """Go from one tuning to another: numbers linearly; words, switches and `AT_ONCE` at once."""
    changes: dict[str, object] = {}
    for item in fields(Tuning):
        if item.name not in AT_ONCE:
            before, after = getattr(old, item.name), getattr(new, item.name)
            changes[item.name] = _between(before, after, share)
    return replace(new, **changes)  # type: ignore[arg-type]


def _between(before: object, after: object, share: float) -> object:
    if isinstance(after, float) and isinstance(before, float):
        return before + share * (after - before)
    if isinstance(after, np.ndarray) and isinstance(before, np.ndarray):
        return frozen(before + share * (after - before))
    if isinstance(after, Mapping) and isinstance(before, Mapping):
        return {name: _between(before.get(name), one, share) for name, one in after.items()}
    return after
