"""The clock of day: the motion never looks at it, logs and certificates do."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

from motionserver.doctor.finding import Finding, Level
from motionserver.doctor.measure import ClockOfDay
from motionserver.doctor.mends import CLOCK

EARLIEST: Final = datetime(2026, 1, 1, tzinfo=UTC)
"""This program is younger."""
LATEST: Final = datetime(2100, 1, 1, tzinfo=UTC)


def clock_of_day(clock: ClockOfDay) -> Finding:
    """Whether the clock of day can be true, and whether anybody keeps it so."""
    name = "clock of day"
    if not EARLIEST.timestamp() <= clock.seconds < LATEST.timestamp():
        return Finding(
            name, Level.WARNING, f"{clock.seconds:.0f} s after 1970: it cannot be true",
            "certificates count as not valid, logs and audit bear wrong times; motion is untouched",
            CLOCK,
        )  # fmt: skip
    now = datetime.fromtimestamp(clock.seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    if clock.synchronised is None:
        return Finding(
            name, Level.UNKNOWN, f"{now}; the kernel does not say whether it is kept",
            "only logs, audit and certificates use it",
        )  # fmt: skip
    if not clock.synchronised:
        return Finding(
            name, Level.ADVICE, f"{now}, not synchronised",
            "logs of two computers cannot be laid side by side; motion is untouched", CLOCK,
        )  # fmt: skip
    return Finding(
        name, Level.OK, f"{now}, synchronised", "jumps of it do not touch the motion either"
    )
