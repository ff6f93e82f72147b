"""The vehicle's own rotation on the platform, kept apart from tilt coordination.

The platform's angle is tilt plus this part. Only the tilt is bound by the perception threshold, so
the split must survive the governor's blending: the part is remembered for every proposed plan.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState
from motionserver.cueing.filters import FilterSet, rate_high_pass
from motionserver.cueing.horizon import Grid, condense
from motionserver.cueing.stopping import with_stop

REMEMBERED: Final = 16
"""Plans whose rotation part is kept; the accepted one is at most a few proposals old."""
_ANGLES: Final = slice(3, 6)


class RotationPart:
    """Third-order high-pass of the body rates: roll, pitch, yaw.

    Args:
        filters: Its corner and lags.
        grid: Where inputs change and plans have knots.
    """

    def __init__(self, filters: FilterSet, grid: Grid) -> None:
        self._parts: OrderedDict[int, Plan] = OrderedDict()
        self._candidate: Plan | None = None
        self.rebuild(filters, grid)

    def rebuild(self, filters: FilterSet, grid: Grid) -> None:
        """Take other corners or another grid; what is remembered stays valid."""
        self._grid = grid
        corners = (filters.rotation, filters.rotation, filters.yaw.omega)
        maps = [condense(rate_high_pass(corner, filters.rotation_tau), grid) for corner in corners]
        self._phi: Array = np.stack([each.phi for each in maps])
        self._gamma: Array = np.stack([each.gamma for each in maps])

    def at(self, parent: Plan, takeover: float) -> PlatformState:
        """The part within a plan at an instant of its time; zero for a plan not from here."""
        part = self._parts.get(parent.plan_id)
        if part is None:
            return PlatformState.at_rest(np.zeros(6))
        return part.state(takeover)

    def ahead(
        self, parent: Plan, takeover: float, rates: Array, stop: float
    ) -> tuple[Array, Array, Array, Array]:
        """The part over the horizon, with its smooth stop.

        Args:
            parent: The accepted plan.
            takeover: Hand-over in its time [s].
            rates: Wanted roll, pitch, yaw rate on each piece, (M, 3) [rad/s].
            stop: Duration of the stop [s].

        Returns:
            Times (K + 2,) from 0, and pose, velocity, acceleration, each (K + 2, 6).
        """
        begin = self.at(parent, takeover)
        start = np.stack((begin.pose, begin.velocity, begin.acceleration))[:, _ANGLES]
        states = self._phi @ start.T[:, None, :, None] + self._gamma @ rates.T[:, None, :, None]
        tables = np.zeros((3, states.shape[1] + 1, 6))
        tables[:, 0, _ANGLES] = start
        tables[:, 1:, _ANGLES] = states[..., 0].T
        times = np.concatenate(([0.0], self._grid.knots))
        out = with_stop(times, tables[0], tables[1], tables[2], stop)
        times, pose, velocity, acceleration = (frozen(table) for table in out)
        self._candidate = Plan(0, parent.plan_id, takeover, times, pose, velocity, acceleration)
        return out

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Blend the part as the governor blended the plan, and remember it."""
        old = self._parts.get(plan.parent_id)
        new = self._candidate if kappa > 0.0 else None
        if old is None and new is None:
            return
        if new is not None and kappa == 1.0 and len(new.times) == len(plan.times):
            self._remember(plan.plan_id, new)
            return
        still = np.zeros((len(plan.times), 6))
        before = still, still, still
        if old is not None:
            before = old.evaluate(plan.takeover + plan.times)
        after = before
        if new is not None:
            after = new.evaluate(plan.times)
        pose, velocity, acceleration = (
            frozen(a + kappa * (b - a)) for a, b in zip(before, after, strict=True)
        )
        blended = Plan(0, 0, plan.takeover, plan.times, pose, velocity, acceleration)
        self._remember(plan.plan_id, blended)

    def _remember(self, plan_id: int, part: Plan) -> None:
        self._parts[plan_id] = part
        while len(self._parts) > REMEMBERED:
            self._parts.popitem(last=False)
