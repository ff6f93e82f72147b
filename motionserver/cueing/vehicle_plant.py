"""How a road vehicle answers pedals and steering, identified while it drives.

Longitudinal: a first-order lag behind a dead time, f' = (f_end - f) / tau, with
f_end = k_t throttle - k_b brake - k_d v / 30 + k_g (drag, grade). Lateral: the steady state of the
single-track model, yaw rate r = v delta / (p_1 + p_2 v^2) with p_1 = steering ratio x wheelbase and
p_2 = steering ratio x understeer gradient (Rajamani, Vehicle Dynamics and Control, 2.5 and 3.3),
behind a lag; f_y = c v r. All parameters come from recursive least squares with forgetting, are
kept within bounds that keep their signs physical, and learn only while there is something to learn
from. The lag is that candidate which explains the past best.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.state import Driver

DEAD_TIME: Final = 0.05
"""Between the pedal and the first answer [s]."""
LAGS: Final = frozen([0.1, 0.2, 0.35, 0.6])
"""Candidates of the longitudinal lag [s]."""
TURN_LAGS: Final = frozen([0.06, 0.12, 0.25, 0.45])
"""Candidates of the lateral lag [s]."""
FORGETTING: Final = 0.998
"""Per sample of the identification, `SAMPLE` apart: a memory of 25 s."""
SAMPLE: Final = 0.05
"""Spacing of the samples of the identification [s]."""
JUDGED: Final = 0.995
"""Forgetting of the squared errors by which candidates are compared."""
LARGEST_TRACE: Final = 1e4
REFERENCE_SPEED: Final = 30.0
"""Drag is told at this speed [m/s]."""
SLOWEST: Final = 2.0
"""Below this speed nothing lateral is learnt [m/s]."""
GRIP: Final = 12.0
"""Largest lateral acceleration a model without tyres' limits may claim [m/s2]."""
LEAST_TURN: Final = 0.01
"""Nor below this yaw rate [rad/s]."""
LEAST_CHANGE: Final = 0.02
"""Pedal travel about its slow mean that is enough to learn from [-]."""


class BoundedLeastSquares:
    """Recursive least squares of several candidates with the same parameters, within bounds.

    Args:
        start: Parameters at the beginning, (P,).
        low: Lower bounds, (P,).
        high: Upper bounds, (P,).
        spread: How unsure the start is: the covariance's diagonal, (P,).
        candidates: How many, C.

    Attributes:
        theta: Parameters, (C, P).
        error: Mean squared error of the one-step forecast, forgotten slowly, (C,).
    """

    def __init__(
        self, start: Array, low: Array, high: Array, spread: Array, candidates: int
    ) -> None:
        self.theta: Array = np.tile(start, (candidates, 1))
        self.error: Array = np.ones(candidates)
        self._low, self._high = low, high
        self._covariance: Array = np.tile(np.diag(spread), (candidates, 1, 1))

    @property
    def best(self) -> int:
        """The candidate that explained the past best."""
        return int(np.argmin(self.error))

    def learn(self, rows: Array, value: Array) -> None:
        """Take in regressors (C, P) and what they should have given, (C,)."""
        if not (np.isfinite(rows).all() and np.isfinite(value).all()):
            return
        missing = value - np.einsum("cp,cp->c", self.theta, rows)
        self.error += (1.0 - JUDGED) * (missing**2 - self.error)
        gain = np.einsum("cpq,cq->cp", self._covariance, rows)
        gain /= (FORGETTING + np.einsum("cp,cp->c", rows, gain))[:, None]
        self.theta = np.clip(self.theta + gain * missing[:, None], self._low, self._high)
        seen = np.einsum("cp,cpq->cq", rows, self._covariance)
        shrunk = self._covariance - gain[:, :, None] * seen[:, None, :]
        shrunk = (shrunk + shrunk.transpose(0, 2, 1)) / (2.0 * FORGETTING)
        trace = np.trace(shrunk, axis1=1, axis2=2)
        self._covariance = shrunk * np.minimum(1.0, LARGEST_TRACE / trace)[:, None, None]


@dataclass(frozen=True, slots=True)
class Controls:
    """What acts on the vehicle, signs included.

    Attributes:
        drive: Throttle in the direction of the gear, none while the clutch is pressed [-].
        brake: Brake against the direction of motion, none at standstill [-].
        steering: Steering wheel angle [rad].
        speed: Forward speed [m/s].
    """

    drive: float
    brake: float
    steering: float
    speed: float


def controls_of(driver: Driver, speed: float) -> Controls:
    """Sort out reverse gear, clutch and standstill."""
    direction = -1.0 if driver.gear < 0 else 1.0
    drive = direction * driver.throttle * (1.0 - driver.clutch)
    # the brake's sign turns softly with the speed, for it cannot push
    against = float(np.clip(speed, -1.0, 1.0))
    return Controls(drive, driver.brake * against, driver.steering, speed)


class VehiclePlant:
    """Longitudinal and lateral answer to pedals and steering.

    Args:
        period: Time between two calls of `follow` [s].
        instants: Instants of the forecast, (K,) [s].
    """

    def __init__(self, period: float, instants: Array) -> None:
        self._period = period
        self._steps = np.diff(np.concatenate(([0.0], instants)))
        later = np.maximum(instants - DEAD_TIME, 0.0)
        self._decay: Array = np.exp(-later[:, None] / LAGS)
        self._turn_decay: Array = np.exp(-later[:, None] / TURN_LAGS)
        self._share: Array = 1.0 - np.exp(-period / LAGS)
        self._turn_share: Array = 1.0 - np.exp(-period / TURN_LAGS)
        self._delay: deque[Controls] = deque(maxlen=max(1, round(DEAD_TIME / period)) + 1)
        self._stride = max(1, round(SAMPLE / period))
        self._count = 0
        self._lagged = np.zeros((len(LAGS), 4))
        self._wheel = np.zeros(len(TURN_LAGS))
        self._habit = np.zeros(2)
        self.surge = BoundedLeastSquares(
            np.array([3.0, 8.0, 0.3, 0.0]),
            np.array([0.2, 0.5, 0.0, -2.0]),
            np.array([20.0, 25.0, 5.0, 2.0]),
            np.array([4.0, 10.0, 0.5, 0.5]),
            len(LAGS),
        )
        self.turn = BoundedLeastSquares(
            np.array([45.0, 0.1]),
            np.array([0.5, -0.01]),
            np.array([300.0, 2.0]),
            np.array([1e3, 0.1]),
            len(TURN_LAGS),
        )
        self.lean = BoundedLeastSquares(
            np.array([1.0]), np.array([0.5]), np.array([1.6]), np.array([0.1]), 1
        )

    def restart(self) -> None:
        """Forget the lagged controls, not the parameters: they were not told for a while."""
        self._delay.clear()

    def follow(self, controls: Controls, force: Array, yaw_rate: float) -> None:
        """Take in this period's controls and what the vehicle does, not scaled.

        Args:
            controls: What acts on it.
            force: Specific force x, y, (2,) [m/s2].
            yaw_rate: [rad/s].
        """
        begins = not self._delay
        self._delay.append(controls)
        late = self._delay[0]
        row = np.array([late.drive, -late.brake, -late.speed / REFERENCE_SPEED, 1.0])
        wheel = late.speed * late.steering
        if begins:
            self._lagged[:], self._wheel[:] = row, wheel
            self._habit[:] = row[:2]
        self._lagged += self._share[:, None] * (row - self._lagged)
        self._wheel += self._turn_share * (wheel - self._wheel)
        self._habit += self._period / 5.0 * (row[:2] - self._habit)
        self._count += 1
        if self._count % self._stride == 0 and np.abs(row[:2] - self._habit).max() > LEAST_CHANGE:
            self.surge.learn(self._lagged, np.full(len(LAGS), force[0]))
        turns = abs(controls.speed) > SLOWEST and abs(yaw_rate) > LEAST_TURN
        if (self._count + self._stride // 2) % self._stride == 0 and turns:
            # wheel = (p_1 + p_2 v^2) r: linear in both parameters, scaled to yaw rates' size
            unit = 1.0 / (1.0 + controls.speed**2 / 400.0) / 45.0
            rows = np.array([1.0, controls.speed**2]) * yaw_rate * unit
            self.turn.learn(np.tile(rows, (len(TURN_LAGS), 1)), self._wheel * unit)
            self.lean.learn(np.array([[controls.speed * yaw_rate]]) / 5.0, force[1:2] / 5.0)

    @property
    def turn_delay(self) -> float:
        """From the wheel to the yaw rate [s]."""
        return DEAD_TIME + float(TURN_LAGS[self.turn.best])

    def ahead(self, steering: Array) -> tuple[Array, Array]:
        """Answer to the pedals as they are now, held, and to a course of the steering wheel.

        Args:
            steering: Wheel angle `turn_delay` before each instant, (K,) [rad].

        Returns:
            Now, (3,), and ahead, (K, 3): f_x, f_y [m/s2], yaw rate [rad/s].
        """
        held = self._delay[-1]
        best = self.surge.best
        theta, lagged = self.surge.theta[best], self._lagged[best]
        goal = np.array([held.drive, -held.brake, -held.speed / REFERENCE_SPEED, 1.0])
        surge_now = float(theta @ lagged)
        surge = theta @ goal + (theta @ (lagged - goal)) * self._decay[:, best]
        braking = np.concatenate(([surge_now], surge))
        speed = held.speed + np.cumsum(0.5 * (braking[1:] + braking[:-1]) * self._steps)
        # no further than to standstill: a held brake does not drive backwards
        speed = np.maximum(speed, 0.0) if held.speed >= 0.0 else np.minimum(speed, 0.0)
        best = self.turn.best
        wheel_now = self._wheel[best]
        angle_now = wheel_now / held.speed if abs(held.speed) > SLOWEST else held.steering
        angle = steering + (angle_now - held.steering) * self._turn_decay[:, best]
        turn_now = _gripped(wheel_now / self._wheel_per_turn(np.array(held.speed)), held.speed)
        turn = _gripped(speed * angle / self._wheel_per_turn(speed), speed)
        lean = float(self.lean.theta[0, 0])
        now = np.array([surge_now, lean * held.speed * float(turn_now), float(turn_now)])
        return now, np.column_stack((surge, lean * speed * turn, turn))

    def _wheel_per_turn(self, speed: Array) -> Array:
        ratio, understeer = self.turn.theta[self.turn.best]
        # an oversteering fit has a critical speed: stay away from it
        out: Array = np.maximum(ratio + understeer * speed**2, 0.3 * ratio)
        return out


def _gripped(turn: Array, speed: Array | float) -> Array:
    """Yaw rates no larger than tyres allow at these speeds."""
    most = GRIP / np.maximum(np.abs(speed), SLOWEST)
    out: Array = np.clip(turn, -most, most)
    return out
