"""Recordings of the horizontal plane alone: forward and left acceleration, yaw rate, speed."""

from __future__ import annotations

from typing import Final

import numpy as np

from .drive import Drive, Planar, Proof
from .signals import PROOF_BAND, RATE, correlation, derivative, lowpass, still, uniform

FORWARD: Final = "forward on dv/dt"
LEFT: Final = "left on v x yaw rate"
HEADING: Final = "yaw rate on compass"


def convert(raw: Planar) -> Drive:
    """Convert to the project's format; az, p, q, roll and pitch are zero, they are not measured.

    Raises:
        RefusedError: Correlation with dv/dt, v x yaw rate or the compass is not what physics asks.
    """
    times = np.arange(raw.t[0] + raw.start, min(raw.t[-1], raw.t[0] + raw.end), 1.0 / RATE)
    none = np.zeros(len(raw.t))
    table = np.column_stack(
        [
            raw.forward,
            raw.left,
            raw.yaw_rate,
            raw.speed,
            none if raw.sideways is None else raw.sideways,
            none if raw.heading is None else raw.heading,
        ]
    )
    ax, ay, r, v, vy, heading = uniform(raw.t, table, times).T
    v = np.maximum(v, 0.0)
    rest = still(v)
    if rest.any():
        ax, ay, r = (x - x[rest].mean() for x in (ax, ay, r))
    dv = derivative(lowpass(v, PROOF_BAND)) - lowpass(vy * r, PROOF_BAND)
    vr = lowpass(v * r, PROOF_BAND) + derivative(lowpass(vy, PROOF_BAND))
    pairs = {
        FORWARD: correlation(lowpass(ax, PROOF_BAND), dv),
        LEFT: correlation(lowpass(ay, PROOF_BAND), vr),
    }
    if raw.heading is not None:
        turn = derivative(lowpass(heading, PROOF_BAND))
        pairs[HEADING] = correlation(lowpass(r, PROOF_BAND), turn)
    proof = Proof(pairs, {"standstill s": float(rest.sum()) / RATE})
    proof.require(*pairs)
    zero = np.zeros(len(times))
    columns = {"ax": ax, "ay": ay, "az": zero, "p": zero, "q": zero, "r": r, "v": v}
    return Drive(columns | {"roll": zero, "pitch": zero}, proof)
