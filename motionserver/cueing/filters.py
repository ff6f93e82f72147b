"""The washout filters as linear blocks in Frobenius form (Thoendel 2014, equations 5 and 6)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg import expm

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.errors import TunableError


@dataclass(frozen=True, slots=True)
class Block:
    """A linear time-invariant system x' = A x + B u with one input.

    Attributes:
        A: (n, n) [1/s].
        B: (n,).
    """

    A: Array
    B: Array


@dataclass(frozen=True, slots=True)
class Corner:
    """A second-order corner with a lag behind it: 1 / ((s2 + 2 zeta omega s + omega2)(tau s + 1)).

    Attributes:
        omega: Corner [rad/s].
        zeta: Damping [-].
        tau: Time constant of the lag; it bounds the jerk [s].
    """

    omega: float
    zeta: float
    tau: float


@dataclass(frozen=True, slots=True)
class FilterSet:
    """Corners of one set of washout filters.

    Attributes:
        name: Its name in the tuning.
        high: High-pass of surge and sway.
        low: Low-pass of tilt coordination; no pole in common with ``high``.
        heave: High-pass of heave.
        yaw: High-pass of the yaw angle, its input is a yaw acceleration.
        rotation: High-pass of the vehicle's own roll and pitch [rad/s].
        rotation_tau: Time constant of each of the two lags behind it [s].
    """

    name: str
    high: Corner
    low: Corner
    heave: Corner
    yaw: Corner
    rotation: float
    rotation_tau: float


FILTER_SETS: Final = {
    "fig3": FilterSet(
        "fig3",
        high=Corner(3.5, 1.0, 0.05),
        low=Corner(2.0, 1.0, 0.08),
        heave=Corner(3.5, 1.0, 0.05),
        yaw=Corner(1.0, 1.0, 0.05),
        rotation=0.5,
        rotation_tau=0.03,
    ),
    "standard": FilterSet(
        "standard",
        high=Corner(2.1, 0.5, 0.045),
        low=Corner(9.0, 1.3, 0.04),
        heave=Corner(3.5, 1.0, 0.04),
        yaw=Corner(1.0, 1.0, 0.05),
        rotation=0.5,
        rotation_tau=0.03,
    ),
}


def filter_set(name: str) -> FilterSet:
    """The set called ``name``.

    Raises:
        ValueError: There is none, or its channel cannot be controlled through one input.
    """
    if name not in FILTER_SETS:
        raise TunableError("filters", f"filter set {name!r} does not exist", ", ".join(FILTER_SETS))
    chosen = FILTER_SETS[name]
    check_controllable(channel(chosen.high, chosen.low), f"filter set {name!r}")
    return chosen


def high_pass(corner: Corner) -> Block:
    """Block A_h, B_h: position x of ``s2 / (...)`` applied to a wanted acceleration.

    x/U = 1 / ((s2 + 2 zeta omega s + omega2)(tau s + 1)), state [x, x', x''].
    """
    return Block(_companion(corner), frozen([0.0, 0.0, 1.0 / corner.tau]))


def low_pass(corner: Corner) -> Block:
    """Block A_l, B_l: tilt phi that shows U by gravity, state [phi, phi', phi''].

    phi/U = omega2/g / ((s2 + 2 zeta omega s + omega2)(tau s + 1)).
    """
    return Block(_companion(corner), frozen([0.0, 0.0, corner.omega**2 / (GRAVITY * corner.tau)]))


def rate_high_pass(omega: float, tau: float) -> Block:
    """Angle of a body rate, high-passed: 1 / ((s + omega)(tau s + 1)2), state [q, q', q''].

    A step of the vehicle's attitude appears fully and then fades with 1/omega.
    """
    poles = np.polymul([1.0, omega], np.polymul([1.0, 1.0 / tau], [1.0, 1.0 / tau]))
    matrix = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], -poles[:0:-1]])
    return Block(frozen(matrix), frozen([0.0, 0.0, 1.0 / tau**2]))


def channel(high: Corner, low: Corner) -> Block:
    """Both blocks behind one input U (equation 5 with A_m = 0): [x, x', x'', phi, phi', phi'']."""
    upper, lower = high_pass(high), low_pass(low)
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = upper.A
    matrix[3:, 3:] = lower.A
    return Block(frozen(matrix), frozen(np.concatenate((upper.B, lower.B))))


def _companion(corner: Corner) -> Array:
    square, damping, lag = corner.omega**2, 2.0 * corner.zeta * corner.omega, 1.0 / corner.tau
    return frozen(
        [
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [-square * lag, -(square + damping * lag), -(damping + lag)],
        ]
    )


def check_controllable(block: Block, name: str) -> None:
    """Refuse a block that one input cannot steer (Popov, Belevitch, Hautus).

    Args:
        block: The system.
        name: What to call it in the message.

    Raises:
        ValueError: Some pole is out of the input's reach; for `channel` that means both blocks
            share it.
    """
    size = len(block.A)
    for pole in np.linalg.eigvals(block.A):
        test = np.column_stack((block.A - pole * np.eye(size), block.B))
        # each row has its own unit: judge directions, not sizes
        test = test / np.linalg.norm(test, axis=1, keepdims=True)
        if np.linalg.matrix_rank(test, tol=1e-7) < size:
            raise ValueError(
                f"{name}: the pole at {pole:.4g} rad/s cannot be controlled by its one input; "
                "high-pass and low-pass must not share a corner or a lag: change one of them"
            )


def discretise(block: Block, step: float) -> tuple[Array, Array]:
    """Exact zero-order hold over ``step`` [s]: A_d (n, n), B_d (n,)."""
    matrix = np.ascontiguousarray(block.A, dtype=float)
    push = np.ascontiguousarray(block.B, dtype=float)
    return _held(matrix.tobytes(), push.tobytes(), float(step))


@lru_cache(maxsize=1024)
def _held(matrix: bytes, push: bytes, step: float) -> tuple[Array, Array]:
    """Zero-order hold of a block given by its bytes.

    An algorithm is made once to prove that its tuning can be used, and its parts again when they
    come into force: the exponentials, most of the time that takes, are computed once.
    """
    vector = np.frombuffer(push)
    size = len(vector)
    augmented = np.zeros((size + 1, size + 1))
    augmented[:size, :size] = np.frombuffer(matrix).reshape(size, size)
    augmented[:size, size] = vector
    full = expm(augmented * step)
    return frozen(full[:size, :size]), frozen(full[:size, size])
