"""What is sent in FAULT and SAFE: the plan to its rest, then the way home, or nothing at all."""

from __future__ import annotations

from typing import Final

from motionserver.core.axes import Array
from motionserver.core.device import Order
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.safety.own_moves import OwnMoves, ends_at_neutral
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.return_decision import Step
from motionserver.core.safety.states import State
from motionserver.core.safety.supervisor import Supervisor

_ORDERS: Final = {
    Step.WAIT: Order.WAIT,
    Step.DOWN: Order.WAIT,
    Step.PARK: Order.PARK,
    Step.HOME: Order.FOLLOW,
    Step.BEGIN: Order.FOLLOW,
}


class FaultReturn:
    """Acts in a latched state as `ReturnDecision` decides.

    Args:
        record: The guard's state.
        supervisor: What is known of the device.
        moves: Makes the move to neutral.
    """

    def __init__(self, record: GuardRecord, supervisor: Supervisor, moves: OwnMoves) -> None:
        self._record, self._supervisor, self._moves = record, supervisor, moves

    def sent(self, order: Order, legs: Array) -> None:
        """Note a setpoint that goes out.

        Args:
            order: What is asked of the device.
            legs: Leg lengths of its pose, (6,) [m].
        """
        if order is Order.FOLLOW:
            self._record.sent_legs = legs
        elif order is Order.RAISE:
            self._record.sent_legs = None

    def order(self, now_ns: int) -> Order:
        """What is asked of the device now; `Order.FOLLOW` plays ``record.playback``."""
        record, decision = self._record, self._supervisor.return_decision
        is_reset = record.reset_until_ns > now_ns
        if not self._comes_down():
            # an open stop is followed: nothing is played against it, not even to its rest
            record.playback = None
            return Order.RESET if is_reset else Order.WAIT
        playback = record.playback
        if playback is not None and not playback.is_at_rest:
            return Order.FOLLOW
        is_neutral = playback is not None and ends_at_neutral(playback)
        legs = record.sent_legs
        if playback is not None:
            legs = leg_lengths(self._moves.machine, playback.playing.plan.rest_pose)
        step = decision.decide(legs, playback is not None, is_neutral, now_ns)
        if is_reset:
            return Order.RESET
        if step in (Step.BEGIN, Step.HOME):
            refusal = self._go_home(step)
            if refusal:
                decision.wait_again(refusal)
                step = Step.WAIT
        elif step is Step.DOWN:
            record.playback = record.sent_legs = None
        elif step is Step.PARK and not is_neutral:
            # it moves by itself from here: where the plan ended is no place to go on from
            record.playback = None
        news = decision.news(now_ns)
        if news:
            record.note(now_ns, f"{record.state}: {news}")
        return _ORDERS[step]

    def _comes_down(self) -> bool:
        """Whether the platform is brought down in this state although it is latched.

        SAFE is followed, never fought: only a service that ends brings it down, and only once the
        stop is closed.
        """
        record, newest = self._record, self._supervisor.device.newest
        if record.state is State.FAULT:
            return True
        return record.leaving and newest is not None and not newest.estop

    def _go_home(self, step: Step) -> str | None:
        """Begin the way home; what forbids it, None if nothing does."""
        record = self._record
        refusal = self._moves.start_from_measured() if step is Step.BEGIN else ""
        if refusal:
            return refusal
        assert record.playback is not None
        self._supervisor.device.forgive()
        ahead = self._moves.homeward(record.playback)
        if isinstance(ahead, str):
            return ahead
        record.playback = ahead
        return None
