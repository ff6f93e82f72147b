"""What canals and otoliths make of a motion: the perceived error.

Transfer functions of Telban and Cardullo (NASA CR-2005-213747), as confirmed by Nash, Cole and
Bigler (2016), Table 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.evaluate.metrics.linear import lag


@dataclass(frozen=True, slots=True)
class Organ:
    """A transfer function as a sum: direct + sum of share / (1 + tau s).

    Attributes:
        direct: What passes at once [-].
        shares: Residues [-].
        taus: Time constants [s].
    """

    direct: float
    shares: tuple[float, float]
    taus: tuple[float, float]

    def response(self, omega: float) -> complex:
        """Response at ``omega`` [rad/s]."""
        return self.direct + sum(
            share / (1.0 + 1j * omega * tau)
            for share, tau in zip(self.shares, self.taus, strict=True)
        )

    def sensed(self, signal: Array, dt: float) -> Array:
        """Pass a signal (N, ...) through the organ, ``dt`` [s] between samples."""
        out = self.direct * signal
        for share, tau in zip(self.shares, self.taus, strict=True):
            out = out + share * lag(signal, tau, dt)
        return out


def canals(long: float = 80.0, short: float = 5.73) -> Organ:
    """Semicircular canals: long short s^2 / ((1 + long s)(1 + short s)), times in [s]."""
    return Organ(1.0, (short / (long - short), long / (short - long)), (long, short))


def otoliths(
    gain: float = 0.4, lead: float = 10.0, long: float = 5.0, short: float = 0.016
) -> Organ:
    """Otoliths: gain (1 + lead s) / ((1 + long s)(1 + short s)), times in [s]."""
    shares = (
        gain * (1.0 - lead / long) / (1.0 - short / long),
        gain * (1.0 - lead / short) / (1.0 - long / short),
    )
    return Organ(0.0, shares, (long, short))


CANALS: Final = canals()
OTOLITHS: Final = otoliths()


def perceived(force: Array, rates: Array, dt: float) -> Array:
    """Sensed specific force and rates, (N, 6), of motion (N, 3) and (N, 3)."""
    return np.column_stack((OTOLITHS.sensed(force, dt), CANALS.sensed(rates, dt)))
