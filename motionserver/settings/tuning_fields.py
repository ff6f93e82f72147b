"""The tunables: name, unit, bounds and meaning of each, in the units of people."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from motionserver.cueing.tuning import Tuning
from motionserver.settings.fields import LONGEST_PATH, algorithms, choice, file, number


def _known(name: str) -> str:
    if name not in algorithms():
        raise ValueError("no such algorithm is installed")
    return name


_WIDEST: Final = {"m": 1e4, "deg": 90.0}
"""Wider than any box a machine's file may state: the machine in use bounds the tunable box."""
_NARROWEST: Final = 1e-6


def _box(axis: str, default: float, unit: str) -> Any:  # noqa: ANN401  (pydantic's Field)
    return number(
        default,
        _NARROWEST,
        _WIDEST[unit],
        unit,
        group="Workspace",
        label=axis.capitalize(),
        meaning=f"Largest {axis} either way that cueing may use.",
        more="stronger cues, less reserve",
    )


def _weight(default: float, low: float, high: float, label: str, meaning: str, more: str) -> Any:  # noqa: ANN401  (as above)
    return number(
        default, low, high, "", group="Optimiser", label=label, meaning=meaning, more=more
    )


def _six(default: float, high: float, label: str, meaning: str, more: str) -> Any:  # noqa: ANN401  (as above)
    return number(default, 0.0, high, "", group="Six axes", label=label, meaning=meaning, more=more)


REMOVED: Final = {
    "translation_threshold_m_s2": "removed: no algorithm ever read it; leave it out",
}
"""Tunables of earlier versions: left out of files that hold them, refused in a request."""
_START: Final = Tuning()
"""Where the defaults stand; here only those are written again that have other units."""


class TuningFields(BaseModel):
    """Everything that may change while the platform moves. Hard limits are not here."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    # fmt: off
    algorithm: Annotated[str, AfterValidator(_known)] = choice(
        _START.algorithm, group="Feel", label="Algorithm", meaning="What turns motion into plans."
    )
    scale: float = number(
        _START.scale, 0.0, 1.0, "", group="Feel", label="Scale",
        meaning="Share of the vehicle's forces and turn rates that is wanted at all.",
        more="stronger motion, limits reached sooner",
    )
    gain: float = number(
        _START.gain, 0.0, 1.0, "", group="Feel", label="Washout gain",
        meaning="Gain of the classical washout, on top of the scale.",
        more="stronger motion",
    )
    rotation_gain: float = number(
        _START.rotation_gain, 0.0, 1.0, "", group="Feel", label="Rotation gain",
        meaning="Share of the vehicle's own roll, pitch and yaw rate that is shown.",
        more="livelier turning, less tilt left for sustained forces",
    )
    tilt_rate_deg_s: float = number(
        3.0, 0.5, 12.0, "deg/s", group="Perception", label="Tilt rate",
        meaning="How fast the cabin may tilt to replace a sustained force; 3 goes unnoticed by "
        "a passenger, about 6 by a driver at work.",
        more="sustained forces arrive sooner, tilting may be felt as turning",
    )
    tilt_acceleration_deg_s2: float = number(
        0.3, 0.05, 60.0, "deg/s2", group="Perception", label="Tilt acceleration",
        meaning="Threshold of angular acceleration; in force only if its weight is above 0.",
        more="quicker onset of tilt",
    )
    tilt_acceleration_weight: float = number(
        _START.tilt_acceleration_weight, 0.0, 1000.0, "", group="Perception",
        label="Tilt acceleration weight",
        meaning="Price of exceeding that threshold; 0 leaves it out.",
        more="smoother, later tilt",
    )
    box_surge_m: float = _box("surge", 0.198, "m")
    box_sway_m: float = _box("sway", 0.220, "m")
    box_heave_m: float = _box("heave", 0.200, "m")
    box_roll_deg: float = _box("roll", 17.5, "deg")
    box_pitch_deg: float = _box("pitch", 16.3, "deg")
    box_yaw_deg: float = _box("yaw", 17.5, "deg")
    halving: Literal["off", "paper", "sound"] = choice(
        _START.halving, group="Workspace", label="Interval halving",
        meaning="How position limits shrink until the legs agree: off, as printed in the paper, "
        "or sound.",
    )
    legs: bool = choice(
        _START.legs, group="Workspace", label="Leg rows",
        meaning="Leg lengths inside the optimiser; off is the paper's box-only form.",
    )
    horizon_s: float = number(
        2.0, 0.5, 3.5, "s", group="Optimiser", label="Horizon",
        meaning="How far ahead the optimiser looks.",
        more="earlier braking before limits, more computing time",
    )
    weight_force: float = _weight(
        _START.weight_force, 0.001, 100.0, "Force weight", "Price of a wrong specific force.",
        "closer to the wanted force, more travel",
    )
    weight_input: float = _weight(
        _START.weight_input, 0.0, 100.0, "Input weight",
        "Price of the washout's input leaving the reference.",
        "closer to plain washout",
    )
    weight_change: float = _weight(
        _START.weight_change, 0.0, 100.0, "Change weight", "Price of changing the input.",
        "smoother, softer onset",
    )
    weight_position: float = _weight(
        _START.weight_position, 0.0, 100.0, "Position weight", "Price of being away from neutral.",
        "sooner back at neutral, weaker cues",
    )
    filters: Literal["standard", "fig3"] = choice(
        _START.filters, group="Optimiser", label="Filters",
        meaning="Filter set of the washout; fig3 is that of the paper's figure 3.",
    )
    reference: Literal["constant", "fade", "ar", "vehicle", "learned"] = choice(
        _START.reference, group="Optimiser", label="Reference",
        meaning="What surge and sway are expected to do next: stay, fade, follow an "
        "autoregressive model, follow from pedals and steering, or from recorded drives.",
    )
    backend: Literal["daqp", "osqp", "piqp", "hpipm"] = choice(
        _START.backend, group="Optimiser", label="Solver",
        meaning="Which solver computes the quadratic programme.",
    )
    predictor: Annotated[str, Field(max_length=LONGEST_PATH)] = file(
        _START.predictor, group="Optimiser", label="Predictor",
        meaning="File that 'motionserver tune --predictor' wrote from your own drives, with its "
        "whole path: what the reference model learned corrects its forecast by.",
    )
    mpc_weight_heave: float = _six(
        _START.mpc_weight_heave, 10.0, "Heave weight",
        "Price of a wrong vertical force; a horizontal one costs 1.",
        "closer vertical force, more stroke used for bumps",
    )
    mpc_weight_rates: float = _six(
        _START.mpc_weight_rates, 500.0, "Rate weight",
        "Price of a wrong turn rate of roll, pitch and yaw.",
        "closer turning, less tilt for sustained forces",
    )
    mpc_weight_position: float = _six(
        _START.mpc_weight_position, 100.0, "Travel weight",
        "Price of surge, sway and heave away from neutral.",
        "sooner back at neutral, weaker onsets",
    )
    mpc_weight_attitude: float = _six(
        _START.mpc_weight_attitude, 100.0, "Attitude weight",
        "Price of roll, pitch and yaw away from level.",
        "sooner level, weaker sustained forces",
    )
    mpc_weight_tilt_rate: float = _six(
        _START.mpc_weight_tilt_rate, 100.0, "Tilt rate weight",
        "Price of tilting faster than the tilt rate.",
        "tilting stays below the threshold, sustained forces arrive later",
    )
    mpc_trust_s: float = number(
        _START.mpc_trust, 0.2, 20.0, "s", group="Six axes", label="Trust",
        meaning="How far ahead a prediction is believed; a preview is believed to its end.",
        more="smoother, earlier preparation; weaker onsets",
    )
    perception: Literal["none", "telban-cardullo", "reid-nahon"] = choice(
        _START.perception, group="Six axes", label="Perception",
        meaning="Judge the error as the inner ear would: not at all, or with one of two models.",
    )
    # fmt: on


UNIT_NAMES: Final = {
    "tilt_rate_deg_s": "tilt_rate",
    "tilt_acceleration_deg_s2": "tilt_acceleration",
    "horizon_s": "horizon",
    "mpc_trust_s": "mpc_trust",
}
"""Tunables that carry their unit here, and their names in `Tuning`."""
SI_NAMES: Final = UNIT_NAMES | {
    name: "box" for name in TuningFields.model_fields if name.startswith("box_")
}
"""Every tunable with another name in `Tuning`."""
