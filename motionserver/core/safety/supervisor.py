"""The supervisor: from ages, answers and requests to events, from events to the next state."""

from __future__ import annotations

from collections.abc import Iterator

from motionserver.core.device import Feedback, Phase
from motionserver.core.limits import Machine
from motionserver.core.motion.player import Playback
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.return_decision import ReturnDecision
from motionserver.core.safety.source_reason import source_reason
from motionserver.core.safety.states import CUED, Event, State, after
from motionserver.core.safety.watchdog import (
    SECOND,
    CueStatus,
    DeviceWatch,
    Patience,
    SourceWatch,
    reports_fault,
)
from motionserver.core.state import DriveMode


class Supervisor:
    """Derives what happened in this tick and looks up what follows."""

    def __init__(
        self,
        machine: Machine,
        patience: Patience,
        send_period: float,
        plan_period: float,
        dry_run: bool = False,
    ) -> None:
        self.patience = patience
        self.dry_run = dry_run
        self.device = DeviceWatch(machine, patience, send_period)
        self.return_decision = ReturnDecision(patience, self.device)
        self.source = SourceWatch()
        self._no_plan_ns = int(patience.plans * plan_period * SECOND)
        self._gap = 2.0 * send_period
        self._paused_ns = 0
        # since when a hold counts, what of it had no reason any more, when that was looked at [ns]
        self._hold_ns = self._spared_ns = self._looked_ns = 0
        self._was_held = False
        # after a gap of our own, plans are waited for anew, once: (accepted, resumed) [ns]
        self._excused = (-1, 0)
        self.inconsistent = ""
        self.leave_reason = ""
        self.astray = False

    def heard(self, now_ns: int, status: CueStatus | None, gap: float) -> None:
        """Take what the planner knows of the source, ``gap`` [s] after the tick before."""
        self.source.update(now_ns, status, self._gap < gap <= self.patience.gap)

    def step(
        self, record: GuardRecord, now_ns: int, gap: float, wishes: frozenset[Event]
    ) -> tuple[State, Event] | None:
        """Find the state that follows.

        Args:
            record: The guard's state.
            now_ns: Now [ns].
            gap: Time since the tick before [s].
            wishes: Operator's edges of this tick: ENGAGE, PARK.

        Returns:
            The next state and the event that led there; None to stay.
        """
        if gap > self._gap:
            self.device.excuse(now_ns, gap)
            # the plan's clock stood still as well
            record.deadline_ns += int(gap * SECOND)
            if self._excused[0] != record.accepted_ns:
                self._excused = (record.accepted_ns, now_ns)
        happened = set(self._events(record, now_ns, gap)) | wishes
        for event in Event:
            if event in happened:
                state = after(record.state, event)
                if state is not record.state:
                    return state, event
        return None

    def _events(self, record: GuardRecord, now_ns: int, gap: float) -> Iterator[Event]:
        if self.inconsistent:
            yield Event.INCONSISTENT
        if self.astray:
            yield Event.TRACKING_ERROR
        if gap > self.patience.gap:
            yield Event.LOOP_GAP
        yield from self._from_device(record, now_ns)
        yield from self._from_source(record, now_ns)
        if now_ns > record.deadline_ns:
            # which of the two it was is the state's affair: see the table
            yield Event.RAISE_TIMEOUT
            yield Event.PARK_TIMEOUT
        if record.leaving:
            yield Event.PARK

    def _from_device(self, record: GuardRecord, now_ns: int) -> Iterator[Event]:
        newest = self.device.current(now_ns)
        if newest is None:
            yield Event.FEEDBACK_LOST
            if record.reset_until_ns > now_ns and is_standing(record.playback):
                yield Event.RESET_BLIND
            return
        if newest.estop:
            yield Event.ESTOP
        came_down = record.state in CUED and newest.phase is not Phase.UP and not self.dry_run
        if reports_fault(newest) or came_down:
            yield Event.DEVICE_FAULT
            return
        if newest.estop or self.device.valid_for(now_ns) < self.patience.valid:
            return
        down, up = newest.phase is Phase.DOWN, newest.phase is Phase.UP
        begins = up and self.device.stands(now_ns)
        if record.reset_until_ns > now_ns and is_standing(record.playback):
            if down:
                yield Event.RESET_DOWN
            elif begins:
                yield Event.RESET_UP
        if down and is_standing(record.playback):
            yield Event.DEVICE_DOWN
        if begins:
            yield Event.DEVICE_UP
        if up or self.dry_run:
            yield Event.RAISED

    def _from_source(self, record: GuardRecord, now_ns: int) -> Iterator[Event]:
        source, patience = self.source, self.patience
        accepted, resumed = self._excused
        since = resumed if accepted == record.accepted_ns else record.accepted_ns
        planned = now_ns - since <= self._no_plan_ns
        fresh = source.is_fresh(now_ns)
        if source.status.mode is DriveMode.BYE and fresh:
            yield Event.PARK
        if not fresh or source.is_paused or not planned:
            yield Event.TROUBLE
        elif source.driving_for(now_ns) >= patience.fresh:
            yield Event.CUEING
        pausing = fresh and source.is_paused and planned
        if pausing:
            self._paused_ns = now_ns
        held = (now_ns - record.since_ns) / SECOND
        # what follows a pause has the patience of a hold that begins when the pause ends
        hold = max(record.since_ns, self._paused_ns)
        if hold != self._hold_ns:
            self._hold_ns, self._spared_ns, self._was_held = hold, 0, False
        elif not fresh or not planned:
            self._was_held = True
        elif self._was_held:
            # its reason is gone, and only the source's half second is waited for
            spared = self._spared_ns + now_ns - self._looked_ns
            self._spared_ns = min(spared, int(patience.spared * SECOND))
        self._looked_ns = now_ns
        waited = (now_ns - hold - self._spared_ns) / SECOND
        if waited > patience.hold or (pausing and held > patience.pause):
            yield Event.HOLD_EXPIRED
        if source.silent_for(now_ns) > patience.silence:
            yield Event.SOURCE_SILENT

    def excuse_plans(self, accepted_ns: int, now_ns: int) -> None:
        """The plan's clock stood still: what was planned on could not be accepted; wait anew."""
        self._excused = (accepted_ns, now_ns)

    def resume(self, feedback: Feedback | None, accepted_ns: int, now_ns: int) -> None:
        """Take the place of a supervisor that ended: answers and plans are waited for anew."""
        if feedback is not None:
            self.device.answered(feedback)
            self.device.excuse(now_ns)
        self.excuse_plans(accepted_ns, now_ns)

    def why(self, record: GuardRecord, event: Event, now_ns: int) -> str:
        """What happened, with its figures, for people."""
        newest = self.device.newest
        if event is Event.INCONSISTENT:
            return self.inconsistent
        if event is Event.PARK and self.leave_reason:
            return f"the service is ending: {self.leave_reason}"
        if event is Event.DEVICE_FAULT and newest is not None:
            return self.why_faulty(newest)
        if event is Event.FEEDBACK_LOST:
            return f"no feedback from the device for {self.device.age(now_ns) * 1e3:.0f} ms"
        if event is Event.TRACKING_ERROR:
            return f"the platform does not follow: {self.device.error * 1e3:.1f} mm off"
        if event is Event.TROUBLE:
            if not self.source.is_fresh(now_ns):
                return f"the source is stale: {source_reason(self.source.status, now_ns)}"
            if self.source.is_paused:
                return "the simulator pauses"
            return no_plan_reason(record)
        return str(event.value)

    def why_not_reset(self, now_ns: int) -> str:
        """What keeps a reset from having an effect, for people."""
        newest = self.device.current(now_ns)
        if newest is None:
            return "the device does not answer"
        if newest.estop:
            return "the emergency stop is open"
        if reports_fault(newest):
            return self.why_faulty(newest)
        if newest.phase in (Phase.UP, Phase.DOWN):
            return "the device's answers came with breaks, or the platform moved"
        return f"the device says {newest.state}, neither up nor down"

    @staticmethod
    def why_faulty(newest: Feedback) -> str:
        """A device's fault in its own words."""
        return f"the device reports {', '.join(newest.faults) or newest.state}"

    def refusal(self, record: GuardRecord, now_ns: int) -> str:
        """Why engaging is not possible now; empty if it is."""
        newest = self.device.newest
        if record.leaving:
            return "the service is ending"
        if record.state is not State.PARKED:
            return f"the state is {record.state}; engaging is possible in PARKED only"
        if newest is None or newest.phase is not Phase.DOWN:
            return "the device does not say that it is down and ready"
        if not self.source.is_fresh(now_ns):
            return f"no fresh source: {source_reason(self.source.status, now_ns)}"
        return ""


def no_plan_reason(record: GuardRecord) -> str:
    """Whether the planner sent none, or what was wrong with the newest."""
    if record.rejections and record.rejections[-1][0] > record.accepted_ns:
        return f"no plan was accepted from the planner; the newest: {record.rejections[-1][1]}"
    return "no plan came from the planner"


def is_standing(playback: Playback | None) -> bool:
    """True if nothing is played, or it has come to rest."""
    return playback is None or playback.is_at_rest
