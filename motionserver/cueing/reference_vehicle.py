"""Surge, sway and yaw from what the driver does: the vehicle's answer, the rest autoregressive.

Pedals and steering lead the motion by the vehicle's own delay. Pedals are held over the horizon.
The wheel is not, for it swings back: with its own autoregressive forecast the error of sway is 10
to 25 % less than with a held one (measured on a simulated drive). The model is trusted as far as
it foretold the last seconds better than the autoregressive model alone; without controls, or with
controls that explain nothing, that model remains.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Driver, Stimulus
from motionserver.cueing.reference_ar import SlowSignals
from motionserver.cueing.reference_base import SMALLEST_SHARE, Decay
from motionserver.cueing.standstill import Standstill
from motionserver.cueing.vehicle_plant import VehiclePlant, controls_of

COMES: Final = 0.5
"""Time in which the model takes over from the autoregressive one, and gives back to it [s]."""
BOUND: Final = 20.0
"""Bound of a forecast of the unscaled force [m/s2]."""
JUDGED_AT: Final = 0.75
"""Forecasts are compared this far ahead [s]."""
JUDGED_OVER: Final = 10.0
"""Time constant of that comparison [s]."""
PRIOR: Final = np.array([0.05, 0.05, 1e-3])
"""Squared errors taken as given at first: nobody is better [m2/s4, m2/s4, rad2/s2]."""
RUNAWAY: Final = np.array([15.0, 15.0, 3.0])
"""Largest difference from now that the vehicle's answer may make [m/s2, m/s2, rad/s]."""


class Vehicle:
    """The model "vehicle"."""

    def __init__(self, period: float, instants: Array) -> None:
        self.status = "vehicle: no driver inputs, ar instead"
        self._period, self._instants = period, instants
        self._decay = Decay(instants)
        self._standstill = Standstill(instants)
        self._plant = VehiclePlant(period, instants)
        # the force itself, what the vehicle's answer leaves of it, unscaled; the wheel
        self._slow = SlowSignals(period, instants, 5, BOUND)
        self._wheel = np.zeros(len(instants))
        self._nodes = np.append(0.0, instants)
        self._yaw_decay = np.exp(-instants / 1.0)
        self._presence = 0.0
        self._last: Driver | None = None
        self._target = int(np.argmin(np.abs(instants - JUDGED_AT)))
        back = max(1, round(float(instants[self._target]) / period))
        self._told: deque[Array] = deque(maxlen=back)
        self._squares = np.tile(PRIOR, (2, 1))
        self._forgets = period / JUDGED_OVER

    @property
    def trust(self) -> Array:
        """Share of the vehicle's answer in surge, sway, yaw rate, (3,), 0..1 [-]."""
        plain, vehicle = self._squares
        out: Array = plain**2 / (plain**2 + vehicle**2) * self._presence
        return out

    def predict(self, stimulus: Stimulus, turning: Array) -> Array:
        """Look ahead; see `AxisModel.predict`."""
        out = self._decay.of(stimulus)
        share = stimulus.share
        small = share < SMALLEST_SHARE or stimulus.gain <= 0.0
        driver = None if small else stimulus.driver
        self._arrives(driver)
        scale = max(share, SMALLEST_SHARE)
        now = np.array([*stimulus.force[:2], turning[2]]) / scale
        at, ahead = np.zeros(3), np.zeros((len(out), 3))
        last = self._last
        steering = 0.0 if last is None else last.steering
        if last is not None:
            self._plant.follow(controls_of(last, stimulus.speed), now[:2], now[2])
            at, ahead = self._plant.ahead(self._course(steering))
            ahead = at + np.clip(ahead - at, -RUNAWAY, RUNAWAY)
        told = self._slow.predict(np.array([*now[:2], *(now[:2] - at[:2]), steering]))
        slow, self._wheel = told[:, :4], told[:, 4]
        decay = self._yaw_decay
        plain = np.column_stack((slow[:, :2], now[2] * decay))
        vehicle = ahead + np.column_stack((slow[:, 2:], (now[2] - at[2]) * decay))
        if not small:
            self._judge(now, plain, vehicle)
        trust = self.trust
        differs = trust * (vehicle - plain) * scale
        out[:, :2] = plain[:, :2] * scale + differs[:, :2]
        # yaw fades as shown, plus what the vehicle's answer adds to a fade
        out[:, 5] += differs[:, 2]
        self._standstill.end(out[:, 0], stimulus)
        self._tell(small, trust)
        return out

    def _course(self, steering: float) -> Array:
        """Wheel angle one delay of the vehicle before each instant; forecast a period ago, (K,)."""
        back = np.maximum(self._instants - self._plant.turn_delay, 0.0)
        course: Array = np.interp(back, self._nodes, np.append(steering, self._wheel))
        return course

    def _arrives(self, driver: Driver | None) -> None:
        step = self._period / COMES
        if driver is not None:
            if self._last is None:
                self._plant.restart()
            self._last = driver
            self._presence = min(1.0, self._presence + step)
            return
        # the last controls are held while the model gives way
        self._presence = max(0.0, self._presence - step)
        if self._presence == 0.0:
            self._last = None

    def _judge(self, now: Array, plain: Array, vehicle: Array) -> None:
        if len(self._told) == self._told.maxlen:
            missed = (self._told[0] - now) ** 2
            self._squares += self._forgets * (missed - self._squares)
            np.maximum(self._squares, 0.1 * PRIOR, out=self._squares)
        self._told.append(np.stack((plain[self._target], vehicle[self._target])))

    def _tell(self, small: bool, trust: Array) -> None:
        if small:
            self.status = "vehicle: cue too small, ar instead"
        elif self._last is None:
            self.status = "vehicle: no driver inputs, ar instead"
        else:
            self.status = (
                f"vehicle: trusted {100 * trust[0]:.0f} % in surge, {100 * trust[1]:.0f} % in sway"
            )
