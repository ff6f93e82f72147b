"""One thing found on the machine: how bad, what, what it means for the motion, how to mend it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum


class Level(StrEnum):
    """How bad a finding is, mildest first."""

    OK = "ok"
    UNKNOWN = "unknown"
    """It could not be read here; nothing is claimed about it."""
    ADVICE = "advice"
    """Works; could be better."""
    WARNING = "warning"
    """Works for now; ticks may be late, or something will be refused later."""
    PROBLEM = "problem"
    """The server will not start, or cannot keep the platform up."""

    @property
    def rank(self) -> int:
        """0 for the mildest."""
        return list(Level).index(self)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found.

    Attributes:
        name: What was looked at; the same on every machine.
        level: How bad it is.
        found: The fact, with its unit.
        means: What it means for the motion.
        mend: The exact command, or the exact key to change; "" if nothing needs mending.
    """

    name: str
    level: Level
    found: str
    means: str
    mend: str = ""

    def to_mapping(self) -> dict[str, str]:
        """Write it for JSON."""
        return {key: str(value) for key, value in asdict(self).items()}


def unknown(name: str, why: str, mend: str = "") -> Finding:
    """A finding that could not be made: ``why`` says what could not be read."""
    return Finding(name, Level.UNKNOWN, why, "nothing is claimed about it", mend)


def worst(findings: Iterable[Finding]) -> Level:
    """The worst level among findings; OK of none."""
    return max(
        (finding.level for finding in findings), key=lambda level: level.rank, default=Level.OK
    )
