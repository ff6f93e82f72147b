"""Proof that a tuning can be used: its algorithm is made with it before it is accepted."""

from __future__ import annotations

from motionserver.core.limits import Machine
from motionserver.cueing.base import Cueing
from motionserver.cueing.registry import tunables_of
from motionserver.cueing.think import prepare
from motionserver.errors import TunableError
from motionserver.settings.fields import FieldError, TuningError
from motionserver.settings.tuning import TuningModel
from motionserver.settings.tuning_fields import SI_NAMES
from motionserver.settings.tuning_options import check_options


def make_with(
    machine: Machine, period: float, model: TuningModel, former: TuningModel | None = None
) -> Cueing:
    """Make the algorithm with a tuning.

    Args:
        machine: Geometry and hard limits.
        period: Planner period [s].
        model: The tuning.
        former: What was in force before, to name the change at fault; the defaults if None.

    Raises:
        TuningError: It cannot be made; the error names the tunable, why, and what to use instead.
    """
    try:
        tunables_of(model.algorithm)
        check_options(model.algorithm)
        return prepare(machine, model.to_tuning(), period)
    except Exception as error:
        raise TuningError([_fault(error, model, former or TuningModel())]) from error


def _fault(error: Exception, model: TuningModel, former: TuningModel) -> FieldError:
    values = model.values()
    if isinstance(error, TunableError):
        names = (n for n in values if SI_NAMES.get(n, n) == error.tunable)
        name = next(names, "algorithm")
        return FieldError(name, values[name], error.allowed, error.what)
    # a plug-in that does not say what it is about: the one change, else the algorithm itself
    before = former.values()
    changed = [name for name, value in values.items() if before.get(name) != value]
    name = changed[0] if len(changed) == 1 else "algorithm"
    what = f"{model.algorithm} cannot be made: {type(error).__name__}: {error}"[:300]
    allowed = f"what {model.algorithm} can be made with, for example {before.get(name)}"
    return FieldError(name, values[name], allowed, what)
