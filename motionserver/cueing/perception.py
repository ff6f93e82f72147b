"""What canals and otoliths make of a motion, and how that weighs an error over the horizon.

Two families: Telban and Cardullo (NASA CR-2005-213747, as confirmed by Nash, Cole and Bigler 2016,
Table 3), and Reid and Nahon (1985, after Young and Meiry).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Final

import numpy as np

from motionserver.core.axes import Array


@dataclass(frozen=True, slots=True)
class Organ:
    """A transfer function as a sum: direct + sum of share / (1 + tau s).

    Attributes:
        direct: What passes at once [-].
        shares: Residues [-].
        taus: Time constants [s].
    """

    direct: float
    shares: tuple[float, ...]
    taus: tuple[float, ...]

    def response(self, omega: float) -> complex:
        """Response at ``omega`` [rad/s]."""
        return self.direct + sum(
            share / (1.0 + 1j * omega * tau)
            for share, tau in zip(self.shares, self.taus, strict=True)
        )


def organ(numerator: tuple[float, ...], taus: tuple[float, ...]) -> Organ:
    """Split numerator(s) / prod(1 + tau s) into first-order parts.

    Args:
        numerator: Coefficients of 1, s, s^2 ...; at most as many as there are time constants
            plus one.
        taus: Different time constants [s].
    """
    count = len(taus)
    direct = numerator[count] / prod(taus) if len(numerator) > count else 0.0
    shares = []
    for index, tau in enumerate(taus):
        pole = -1.0 / tau
        value = sum(c * pole**power for power, c in enumerate(numerator))
        rest = prod(1.0 + other * pole for k, other in enumerate(taus) if k != index)
        shares.append(value / rest)
    return Organ(direct, tuple(shares), taus)


def _canals(long: float, short: float) -> Organ:
    return organ((0.0, 0.0, long * short), (long, short))


def _steinhausen(long: float, short: float, adaptation: float) -> Organ:
    return organ((0.0, 0.0, long * adaptation), (long, short, adaptation))


@dataclass(frozen=True, slots=True)
class Senses:
    """One organ per output.

    Attributes:
        force: Otoliths, for the three forces.
        roll: Canals.
        pitch: Canals.
        yaw: Canals.
    """

    force: Organ
    roll: Organ
    pitch: Organ
    yaw: Organ

    @property
    def outputs(self) -> tuple[Organ, ...]:
        """Of the six outputs in their order."""
        return (self.force, self.force, self.force, self.roll, self.pitch, self.yaw)


_TELBAN_CANALS: Final = _canals(80.0, 5.73)
TELBAN_CARDULLO: Final = Senses(
    organ((0.4, 0.4 * 10.0), (5.0, 0.016)), _TELBAN_CANALS, _TELBAN_CANALS, _TELBAN_CANALS
)
REID_NAHON: Final = Senses(
    organ((0.4, 0.4 * 13.2), (5.33, 0.66)),
    _steinhausen(6.1, 0.1, 30.0),
    _steinhausen(5.3, 0.1, 30.0),
    _steinhausen(10.2, 0.1, 30.0),
)
FAMILIES: Final = {"telban-cardullo": TELBAN_CARDULLO, "reid-nahon": REID_NAHON}
PLAIN: Final = 0.6
"""Share of the plain error in the weighed one: where organs feel nothing, a programme would wait
with every effort until the next period, for ever."""
NORMAL: Final = 1.0
"""Where every organ's gain counts as 1 [rad/s], so that weights keep their meaning."""


class Perceived:
    """Filters an error over uneven nodes; keeps what the organs remember of the past.

    Args:
        senses: The family.
        nodes: Instants after the hand-over, (N,) [s].
        period: Planner period [s].
    """

    def __init__(self, senses: Senses, nodes: Array, period: float) -> None:
        organs = senses.outputs
        scales = [1.0 / abs(each.response(NORMAL)) for each in organs]
        felt = 1.0 - PLAIN
        self.maps = np.stack(
            [
                PLAIN * np.eye(len(nodes)) + (1.0 - PLAIN) * scale * _over(each, nodes)
                for each, scale in zip(organs, scales, strict=True)
            ]
        )
        """Error at the nodes to perceived error there, (6, N, N)."""
        most = max(len(each.taus) for each in organs)
        self._fades = np.zeros((6, len(nodes), most))
        self._decays = np.zeros((6, most))
        for index, (each, scale) in enumerate(zip(organs, scales, strict=True)):
            for part, (share, tau) in enumerate(zip(each.shares, each.taus, strict=True)):
                self._fades[index, :, part] = felt * scale * share * np.exp(-nodes / tau)
                self._decays[index, part] = np.exp(-period / tau)
        self._memory = np.zeros((6, most))

    def remembered(self) -> Array:
        """What the past alone still makes felt at the nodes, (N, 6)."""
        out: Array = np.einsum("onp,op->no", self._fades, self._memory)
        return out

    def learn(self, error: Array) -> None:
        """Take in the error (6,) of one period."""
        self._memory = error[:, None] + self._decays * (self._memory - error[:, None])


def _over(each: Organ, nodes: Array) -> Array:
    """Map of an error, linear between the nodes and constant before the first, (N, N)."""
    count = len(nodes)
    out = each.direct * np.eye(count)
    steps = np.diff(nodes, prepend=0.0)
    for share, tau in zip(each.shares, each.taus, strict=True):
        state = np.zeros(count)
        for index, step in enumerate(steps):
            decay = np.exp(-step / tau)
            mean = (1.0 - decay) * tau / step
            state = decay * state
            state[max(index - 1, 0)] += mean - decay
            state[index] += 1.0 - mean
            out[index] += share * state
    return out
