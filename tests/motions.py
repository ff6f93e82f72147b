"""Samples of vehicle motion, for tests."""

from typing import Any

import numpy as np

from motionserver.core.axes import GRAVITY, frozen
from motionserver.core.state import Preview, VehicleMotion

MS = 1_000_000


def motion(
    at_ms: float = 0.0,
    sequence: int | None = None,
    x: float = 0.0,
    rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
    sent_ms: float | None = None,
    session: int = 1,
    force: tuple[float, float, float] | None = None,
    **more: Any,
) -> VehicleMotion:
    """A sample that arrives at ``at_ms``, of forward acceleration ``x``, level."""
    return VehicleMotion(
        arrival_ns=int(at_ms * MS),
        session=session,
        sequence=sequence,
        sender_ns=None if sent_ms is None else int(sent_ms * MS),
        force=frozen((x, 0.0, GRAVITY) if force is None else force),
        rates=frozen(rates),
        **more,
    )


def preview(times: list[float], x: float = 0.0, rate: float = 0.0) -> Preview:
    force = np.tile([x, 0.0, GRAVITY], (len(times), 1))
    rates = np.tile([rate, 0.0, 0.0], (len(times), 1))
    return Preview(frozen(times), frozen(force), frozen(rates))
