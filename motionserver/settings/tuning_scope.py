"""Which algorithms read which tunable, and what is said to who sets one that has no effect."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from motionserver.cueing.registry import algorithms, tunables_of
from motionserver.errors import TunableError
from motionserver.settings.fields import FieldError, TuningError
from motionserver.settings.tuning_fields import SI_NAMES, TuningFields
from motionserver.settings.tuning_options import option_fields


def names_of(algorithm: str) -> tuple[str, ...]:
    """Tunables that an algorithm reads, by their names on the page, in the order of the page.

    One that cannot be loaded reads nothing but what acts in front of it.
    """
    try:
        declared = tunables_of(algorithm)
    except TunableError:
        declared = frozenset({"algorithm"})
    shared = (name for name in TuningFields.model_fields if SI_NAMES.get(name, name) in declared)
    own = (name for name, (owner, _, _) in option_fields().items() if owner == algorithm)
    return (*shared, *own)


def users_of(name: str) -> tuple[str, ...]:
    """Algorithms that read a tunable."""
    return tuple(one for one in algorithms() if name in names_of(one))


def without_effect(
    values: Mapping[str, Any], algorithm: str, unchanged: Iterable[Mapping[str, Any]]
) -> list[FieldError]:
    """What is set although the algorithm does not read it.

    Args:
        values: Tunables that are set.
        algorithm: What they are for.
        unchanged: Sets of values; a tunable that has its value in one of them changes nothing.

    Returns:
        One error per such tunable.
    """
    read, same = names_of(algorithm), tuple(unchanged)
    errors = []
    for name, value in values.items():
        if name in read or any(name in one and one[name] == value for one in same):
            continue
        users = users_of(name)
        errors.append(
            FieldError(
                name,
                value,
                f"a tunable of {algorithm}, or {name} together with "
                f"algorithm = {' or '.join(users) or 'one that reads it'}",
                f"has no effect with {algorithm}; read by {', '.join(users) or 'no algorithm'}",
            )
        )
    return errors


def check_effect(
    values: Mapping[str, Any], algorithms_in_use: Collection[str], unchanged: Mapping[str, Any]
) -> None:
    """Make sure that everything that is set is read by some of these algorithms.

    Args:
        values: Tunables that are set.
        algorithms_in_use: The driving one first, then those that run beside it.
        unchanged: Values that may be repeated without an effect.

    Raises:
        TuningError: One is read by none of them.
    """
    driving = next(iter(algorithms_in_use))
    read = {name for one in algorithms_in_use for name in names_of(one)}
    rest = {name: value for name, value in values.items() if name not in read}
    errors = without_effect(rest, driving, (unchanged,))
    if errors:
        raise TuningError(errors)
