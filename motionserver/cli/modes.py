"""Which options a command's modes take: one that would say nothing is refused, not swallowed."""

from __future__ import annotations

from typing import Final

import typer

from motionserver.errors import ConfigError

_ALL: Final = frozenset({"platform", "head", "scale", "tuning"})
_DRIVES: Final = _ALL | {"algorithm", "planner_rate", "reference", "tilt_rate", "jobs"}
_TROUBLED: Final = _DRIVES | {"rate", "preview", "disturb", "seed"}
EVALUATE: Final = {
    "INPUT.csv": _TROUBLED | {"recording", "setpoints", "json_out", "html_out"},
    "--compare": _TROUBLED | {"compare", "held_out", "out"},
    "omct": _DRIVES | {"recording", "amplitude", "boundaries", "out"},
    "--predictions": _ALL | {"recording", "predictions"},
}
"""Parameters of `evaluate` by mode."""
TUNE_PREDICTOR: Final = {"--predictor": frozenset({"recordings", "out", "predictor"})}
"""Parameters of `tune` when it fits a predictor; a search takes all."""


def written(context: typer.Context) -> frozenset[str]:
    """Names of the parameters that were written at the prompt."""
    sources = (
        (p.name or "", context.get_parameter_source(p.name or "")) for p in context.command.params
    )
    return frozenset(
        name for name, source in sources if source is not None and source.name == "COMMANDLINE"
    )


def refuse_idle(
    context: typer.Context, mode: str, modes: dict[str, frozenset[str]], rest: str = ""
) -> None:
    """Make sure that all that was written at the prompt means something.

    Args:
        context: Of the command; tells what was written and what is a default.
        mode: The mode that was chosen.
        modes: Parameters by mode.
        rest: The mode that takes everything, if there is one.

    Raises:
        ConfigError: Something is given that this mode does not take.
    """
    told = written(context)
    for parameter in context.command.params:
        name = parameter.name or ""
        if name not in told or name in modes[mode]:
            continue
        takers = [other for other, takes in modes.items() if name in takes]
        takers += [rest] if rest else []
        where = parameter.opts[0]
        if not where.startswith("-"):
            where = str(getattr(parameter, "metavar", None) or where)
        raise ConfigError(
            where,
            f"means nothing with {mode}",
            f"Leave it out; it goes with {' or '.join(takers)}.",
        )
