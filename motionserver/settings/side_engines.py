"""Names of the engines that run beside the driving one, checked."""

from __future__ import annotations

from motionserver.settings.fields import FieldError, TuningError, algorithms, shown


def side_names(value: object) -> tuple[str, ...]:
    """Check a list of names, from the configuration or from the page.

    Args:
        value: What was given.

    Returns:
        The names, in their order.

    Raises:
        TuningError: It is no list, or a name is unknown or there twice.
    """
    known = algorithms()
    allowed = f"a list of names, each once, of {', '.join(known)}"
    if not isinstance(value, (list, tuple)):
        raise TuningError([FieldError("engines", shown(value), allowed, "not a list")])
    errors = []
    for place, name in enumerate(value):
        if name not in known:
            errors.append(FieldError("engines", shown(name), allowed, "no such algorithm"))
        elif name in value[:place]:
            errors.append(FieldError("engines", shown(name), allowed, "there twice"))
    if errors:
        raise TuningError(errors[:8])
    return tuple(value)
