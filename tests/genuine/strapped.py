"""Three-axis recordings: find the vehicle's axes by physics, estimate attitude, remove gravity."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from .drive import GRAVITY, Drive, Proof, Strapped
from .signals import (
    PROOF_BAND,
    RATE,
    Array,
    correlation,
    derivative,
    integral,
    lowpass,
    slow_part,
    still,
    uniform,
)

FORWARD: Final = "forward on dv/dt, gravity out by gyro, above 1/40 Hz"
LEFT: Final = "left on v x yaw rate, gravity out by gyro, above 1/40 Hz"
COURSE: Final = "yaw rate on course over ground"
BRAKING: Final = "pitch on braking, 0.2 to 2 Hz"
LEANING: Final = "roll on left acceleration, 0.2 to 2 Hz"
SIGN: Final = 0.1
"""Correlation of the body's own pitch and roll below which their sign is not proven."""
KNOTS: Final = 20.0
"""Attitude is the gyros' above about 1/40 Hz; slower, a spline with such knots follows tilt [s]."""
SHIFTS: Final = range(0, 251, 5)
"""Tried where speed comes late [samples]."""


def convert(raw: Strapped) -> Drive:
    """Convert to the project's format.

    Raises:
        RefusedError: Correlation with dv/dt, v x yaw rate or the course, or gravity, is not what
            physics asks.
    """
    force, rates, speed, course, delay = _together(raw)
    axes = mounting(force, rates, speed)
    force, rates = force @ axes.T, rates @ axes.T
    rest = still(speed)
    if rest.any():
        rates = rates - rates[rest].mean(axis=0)
    roll, pitch = attitude(force, rates, speed)
    a = np.column_stack(
        [
            force[:, 0] + GRAVITY * np.sin(pitch),
            force[:, 1] - GRAVITY * np.sin(roll) * np.cos(pitch),
            force[:, 2] - GRAVITY * np.cos(roll) * np.cos(pitch),
        ]
    )
    a[:, 2] -= a[:, 2].mean()
    proof = _prove(force, a, rates, speed, course)
    # on its springs a vehicle dips its nose when it brakes and lifts its left side in a left turn
    proof.pairs[BRAKING] = correlation(_springs(pitch), _springs(-a[:, 0]))
    proof.pairs[LEANING] = correlation(_springs(roll), _springs(a[:, 1]))
    proof.figures["gravity m/s^2"] = _gravity(force, rates, speed, rest)
    proof.figures["standstill s"] = float(rest.sum()) / RATE
    proof.figures["speed delay s"] = delay
    proof.require(FORWARD, LEFT, *((COURSE,) if COURSE in proof.pairs else ()))
    proof.require(BRAKING, LEANING, least=SIGN)
    names = ("ax", "ay", "az", "p", "q", "r", "v", "roll", "pitch")
    values = np.column_stack([a, rates, speed, roll, pitch])
    return Drive(dict(zip(names, values.T, strict=True)), proof)


def _gravity(force: Array, rates: Array, speed: Array, rest: NDArray[np.bool_]) -> float:
    """Specific force at rest; of a drive without a stop, its mean less the mean acceleration."""
    if rest.any():
        return float(np.linalg.norm(force[rest], axis=1).mean())
    dv, vr = _expected(speed, rates[:, 2])
    return float(np.linalg.norm(force.mean(axis=0) - [dv.mean(), vr.mean(), 0.0]))


def _together(raw: Strapped) -> tuple[Array, Array, Array, Array | None, float]:
    """Everything at 100 Hz, speed and course where they belong, and the delay they had."""
    first, last = max(raw.t[0], raw.speed_t[0]), min(raw.t[-1], raw.speed_t[-1])
    times = np.arange(first + raw.start, min(last, first + raw.end), 1.0 / RATE)
    force, rates = uniform(raw.t, raw.force, times), uniform(raw.t, raw.rates, times)
    late = [np.maximum(uniform(raw.speed_t, raw.speed, times), 0.0)]
    if raw.course is not None:
        late.append(uniform(raw.speed_t, raw.course, times))
    shift = 0
    if raw.delayed_speed:
        # under the right delay dv/dt and v x yaw rate explain most of the horizontal force
        shift = max(SHIFTS, key=lambda n: _explained(force, rates, late[0], n))
    if shift:
        force, rates = force[:-shift], rates[:-shift]
        late = [x[shift:] for x in late]
    return force, rates, late[0], late[1] if len(late) > 1 else None, shift / RATE


def _prove(force: Array, a: Array, rates: Array, speed: Array, course: Array | None) -> Proof:
    """Compare; what is required is free of the tilt that the spline in `attitude` was fitted to."""
    dv, vr = _expected(speed, rates[:, 2])
    slow, freed = lowpass(force, PROOF_BAND), lowpass(a, PROOF_BAND)
    beyond_x = force[:, 0] - derivative(lowpass(speed, PROOF_BAND))
    beyond_y = force[:, 1] - speed * rates[:, 2]
    pairs = {
        "forward on dv/dt, gravity in": correlation(slow[:, 0], dv),
        "left on v x yaw rate, gravity in": correlation(slow[:, 1], vr),
        FORWARD: correlation(_quick(freed[:, 0]), _quick(dv)),
        LEFT: correlation(_quick(freed[:, 1]), _quick(vr)),
        # nose down by the gyro takes 9.81 sin(pitch) from the forward axis, left side up adds
        "forward rest on -g x pitch gyro": _by_gyro(beyond_x, -integral(rates[:, 1])),
        "left rest on g x roll gyro": _by_gyro(beyond_y, integral(rates[:, 0])),
    }
    if course is not None:
        # while it stands or crawls, a course means nothing
        moving = lowpass((speed > 2.5).astype(float), PROOF_BAND) > 0.95
        turn = derivative(lowpass(course, PROOF_BAND))
        pairs[COURSE] = correlation(lowpass(rates[:, 2], PROOF_BAND)[moving], turn[moving])
    return Proof(pairs)


def mounting(force: Array, rates: Array, speed: Array) -> Array:
    """Rotation from sensor to vehicle axes.

    Up is the mean specific force less the mean acceleration: the road is level on the average,
    but a lap turns more to one side. Forward is the direction in the horizontal plane under which
    dv/dt and v x yaw rate explain most of the force.
    """
    slow = lowpass(force, PROOF_BAND)
    axes, accelerated = np.eye(3), np.zeros(3)
    for _ in range(8):
        up = force.mean(axis=0) - accelerated
        up /= np.linalg.norm(up)
        some = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
        some /= np.linalg.norm(some)
        level = np.vstack([some, np.cross(up, some), up])
        x, y = ((slow - slow.mean(axis=0)) @ level.T).T[:2]
        dv, vr = _expected(speed, rates @ up)
        accelerated = np.array([dv.mean(), vr.mean(), 0.0])
        dv, vr = dv - dv.mean(), vr - vr.mean()
        # the angle that makes (x, y) turned look most like (dv, vr)
        angle = float(np.arctan2(dv @ y - vr @ x, dv @ x + vr @ y))
        turn = np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        axes = turn @ level
        accelerated = accelerated @ axes
    return axes


def attitude(force: Array, rates: Array, speed: Array) -> tuple[Array, Array]:
    """Roll and pitch: integrated gyros, whose drift is corrected by tilt from gravity.

    Tilt is what specific force holds beyond dv/dt and v x yaw rate. Three rounds, since pitch
    needs roll while the vehicle turns.
    """
    dv = derivative(lowpass(speed, PROOF_BAND))
    tilt_pitch = -lowpass(force[:, 0] - dv, PROOF_BAND) / GRAVITY
    tilt_roll = lowpass(force[:, 1] - speed * rates[:, 2], PROOF_BAND) / GRAVITY
    roll, pitch = slow_part(tilt_roll, KNOTS), slow_part(tilt_pitch, KNOTS)
    for _ in range(3):
        yaw_part = rates[:, 1] * np.sin(roll) + rates[:, 2] * np.cos(roll)
        turned_roll = integral(rates[:, 0] + yaw_part * np.tan(pitch))
        turned_pitch = integral(rates[:, 1] * np.cos(roll) - rates[:, 2] * np.sin(roll))
        roll = turned_roll + slow_part(tilt_roll - turned_roll, KNOTS)
        pitch = turned_pitch + slow_part(tilt_pitch - turned_pitch, KNOTS)
    return roll, pitch


def _expected(speed: Array, yaw_rate: Array) -> tuple[Array, Array]:
    return derivative(lowpass(speed, PROOF_BAND)), lowpass(speed * yaw_rate, PROOF_BAND)


def _springs(x: Array) -> Array:
    return lowpass(x, 2.0) - lowpass(x, 0.2)


def _quick(x: Array) -> Array:
    return x - slow_part(x, KNOTS)


def _by_gyro(beyond: Array, angle: Array) -> tuple[float, float]:
    """What physics leaves of an axis on gravity times the gyro's angle, from 1/40 to 0.5 Hz."""
    return correlation(
        _quick(lowpass(beyond, PROOF_BAND)), _quick(lowpass(GRAVITY * angle, PROOF_BAND))
    )


def _explained(force: Array, rates: Array, speed: Array, shift: int) -> float:
    n = len(speed) - shift
    f, w, v = force[:n], rates[:n], speed[shift:]
    axes = mounting(f, w, v)
    dv, vr = _expected(v, w @ axes[2])
    slow = lowpass(f @ axes.T, PROOF_BAND)
    return correlation(slow[:, 0], dv)[0] + correlation(slow[:, 1], vr)[0]
