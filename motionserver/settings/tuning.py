"""The tuning in the units of people: to and from SI, against the machine, changed, described."""

from __future__ import annotations

from dataclasses import fields as dataclass_fields
from math import degrees, radians
from typing import Any, Final

import numpy as np
from pydantic import PrivateAttr, ValidationError

from motionserver.core.axes import AXIS_NAMES, frozen
from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Option, Tuning
from motionserver.settings.fields import (
    FieldError,
    Range,
    TuningError,
    allowed_range,
    described,
    shown,
)
from motionserver.settings.tuning_fields import REMOVED, SI_NAMES, UNIT_NAMES, TuningFields
from motionserver.settings.tuning_options import (
    checked_options,
    default_options,
    nested_options,
    option_fields,
)
from motionserver.settings.tuning_scope import names_of, users_of

_UNITS: Final = {"m": 1.0, "deg": radians(1.0)}
BOX_FIELDS: Final = tuple(
    f"box_{axis}_{'m' if index < 3 else 'deg'}" for index, axis in enumerate(AXIS_NAMES)
)
_LEAST_BOX: Final = {"m": 0.005, "deg": 0.5}
"""Least half width of the box on machines that have much more than that."""
_LEAST_SHARE: Final = 0.1
"""The same on small machines, as a share of the machine's own box."""
_ROUNDING: Final = 1e-9
"""Slack of a box against the machine's, for degrees that came from radians."""


class TuningModel(TuningFields):
    """Everything that may change while the platform moves. Hard limits are not here.

    Options of plug-ins stand beside the fields; they are declared elsewhere, see `tuning_options`.
    """

    _options: dict[str, Option] = PrivateAttr(default_factory=dict)

    @property
    def options(self) -> dict[str, Option]:
        """Options of plug-ins that differ from their defaults."""
        return self._options

    def with_options(self, options: dict[str, Option]) -> TuningModel:
        """The same with these options of plug-ins, checked before."""
        made = self.model_copy()
        made._options = options
        return made

    def values(self) -> dict[str, Any]:
        """All tunables by name, the options of plug-ins included."""
        return self.model_dump() | default_options() | self._options

    def live_values(self) -> dict[str, Any]:
        """Those that the algorithm reads."""
        values = self.values()
        return {name: values[name] for name in names_of(self.algorithm)}

    def to_tuning(self) -> Tuning:
        """The same in SI."""
        values: dict[str, Any] = self.model_dump(exclude=set(BOX_FIELDS))
        for name, si_name in UNIT_NAMES.items():
            values[si_name] = values.pop(name) * (radians(1.0) if "_deg" in name else 1.0)
        units = [_UNITS[name.rsplit("_", 1)[1]] for name in BOX_FIELDS]
        box = np.array([getattr(self, name) for name in BOX_FIELDS]) * np.array(units)
        return Tuning(**values, box=frozen(box), options=nested_options(self._options))

    @classmethod
    def from_tuning(cls, tuning: Tuning) -> TuningModel:
        """Write a tuning in the units of people.

        Raises:
            TuningError: It lies outside the bounds.
        """
        values: dict[str, Any] = {
            item.name: getattr(tuning, item.name)
            for item in dataclass_fields(Tuning)
            if item.name not in ("box", "options")
        }
        for name, si_name in UNIT_NAMES.items():
            value = values.pop(si_name)
            values[name] = round(degrees(value), 9) if "_deg" in name else value
        for name, value in zip(BOX_FIELDS, tuning.box.tolist(), strict=True):
            values[name] = round(degrees(value), 9) if name.endswith("_deg") else value
        options: dict[str, object] = {
            f"{algorithm}_{name}": value
            for algorithm, own in tuning.options.items()
            for name, value in own.items()
        }
        return apply_changes(_validated(values), options)

    def showing(self, tuning: Tuning) -> dict[str, Any]:
        """The values of a tuning in force; where it is this one, exactly as they stand here.

        Raises:
            TuningError: It lies outside the bounds.
        """
        shown, asked = TuningModel.from_tuning(tuning).values(), self.values()
        wanted = self.to_tuning()
        for name in TuningModel.model_fields:
            si_name = SI_NAMES.get(name, name)
            if si_name == "box":
                axis = BOX_FIELDS.index(name)
                is_same = wanted.box[axis] == tuning.box[axis]
            else:
                is_same = getattr(wanted, si_name) == getattr(tuning, si_name)
            if is_same:
                shown[name] = asked[name]
        return shown

    def check_machine(self, machine: Machine) -> None:
        """Make sure that the tuned box lies inside the machine's, and is not next to nothing.

        Raises:
            TuningError: The box is larger than the machine's, or too small to move in.
        """
        limits = machine_limits(machine)
        errors = []
        for name, (low, high) in limits.items():
            value, unit = getattr(self, name), name.rsplit("_", 1)[1]
            if low - _ROUNDING <= value <= high + _ROUNDING:
                continue
            what = (
                f"more than the {high:.6g} {unit} of machine {machine.name}"
                if value > high
                else f"less than machine {machine.name} can be confined to"
            )
            errors.append(FieldError(name, value, _allowed(name, limits), what))
        if errors:
            raise TuningError(errors)


def machine_limits(machine: Machine) -> dict[str, Range]:
    """Ranges of the box on a machine, in the units of the model.

    The file of the machine alone says how large its box is; bounds of the model would refuse
    machines that are smaller or larger than its author thought of.
    """
    limits = {}
    for name, value in zip(BOX_FIELDS, machine.box.tolist(), strict=True):
        unit = name.rsplit("_", 1)[1]
        high = round(value / _UNITS[unit], 9)
        limits[name] = (min(_LEAST_BOX[unit], _LEAST_SHARE * high), high)
    return limits


def apply_changes(model: TuningModel, changes: dict[str, object]) -> TuningModel:
    """Take over some values.

    Raises:
        TuningError: A name or value that is not allowed; then none is taken.
    """
    own = option_fields()
    shared = {name: value for name, value in changes.items() if name not in own}
    options = {name: value for name, value in changes.items() if name in own}
    errors: list[FieldError] = []
    taken, kept = model, model.options
    try:
        taken = _validated(model.model_dump() | shared)
    except TuningError as error:
        errors += error.errors
    try:
        kept = checked_options({**model.options, **options})
    except TuningError as error:
        errors += error.errors
    if errors:
        raise TuningError(errors)
    return taken.with_options(kept)


def readable(
    values: dict[str, Any], *, drop_unknown: bool = False
) -> tuple[dict[str, Any], list[str]]:
    """Values of a file of an earlier version, without what does not exist any more.

    Args:
        values: What the file holds.
        drop_unknown: True: leave out what is not known at all, as of a plug-in that is gone.

    Returns:
        What is left, and a sentence for each that was left out.
    """
    known = TuningModel.model_fields.keys() | option_fields().keys()
    gone = {name: REMOVED[name] for name in values if name in REMOVED}
    if drop_unknown:
        gone |= {n: "not known here (any more)" for n in values.keys() - known - gone.keys()}
    rest = {name: value for name, value in values.items() if name not in gone}
    return rest, [f"{name} is left out: {why}" for name, why in sorted(gone.items())]


def _validated(values: dict[str, object]) -> TuningModel:
    try:
        return TuningModel.model_validate(values)
    except ValidationError as error:
        raise TuningError([_explained(item) for item in error.errors(include_url=False)]) from None


def _explained(item: Any) -> FieldError:  # noqa: ANN401  (pydantic's ErrorDetails)
    name = str(item["loc"][0]) if item["loc"] else "tuning"
    if name not in TuningModel.model_fields:
        if name in REMOVED:
            return FieldError(name, shown(item["input"]), "nothing: leave it out", REMOVED[name])
        known = "a name listed by GET /api/tuning"
        return FieldError(ascii(name)[1:-1][:60], shown(item["input"]), known, "no such tunable")
    return FieldError(name, shown(item["input"]), _allowed(name, {}), str(item["msg"]))


def describe(machine: Machine | None) -> list[dict[str, object]]:
    """All tunables for a page or a document, in order, within a machine's limits."""
    limits = machine_limits(machine) if machine else {}
    shared = [
        described(name, item, limits, users_of(name))
        for name, item in TuningModel.model_fields.items()
    ]
    own = [
        described(name, item, {}, (algorithm,))
        for name, (algorithm, _, item) in option_fields().items()
    ]
    return shared + own


def default_for(machine: Machine) -> TuningModel:
    """The tuning of a fresh installation on this machine: its whole box, all else default."""
    return apply_changes(
        TuningModel(), {n: high for n, (_, high) in machine_limits(machine).items()}
    )


def _allowed(name: str, limits: dict[str, Range]) -> str:
    return allowed_range(TuningModel.model_fields[name], limits.get(name))
