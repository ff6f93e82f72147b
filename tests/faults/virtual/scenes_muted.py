"""Faults that pass while the platform is up: F37 and F38; nobody resets until it is down."""

from fittings import SECOND
from motion_clients.flawed_link import LinkFlaws
from motion_clients.moog_wire import MachineState
from scenario import SEND, TICK
from scenes_platform import LOST, PlatformFault

from motionserver.core.safety.states import State
from motionserver.core.safety.watchdog import Patience

SOUND = Patience().sound


class F37(PlatformFault):
    number = 37
    title = "platform's answers are missing for a moment, and nobody resets"
    detection = "age of the newest answer > max(100 ms, 6 T)"
    reaction = "FAULT: the accepted plan to rest; 1 s of sound answers later home and parked"
    recovery = "it parks by itself and stays latched; an operator's reset"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.muted = rng.choice((LOST + 0.5 * SEND, 0.104, 0.150, 0.3, 1.0))
        # nobody resets before it is down
        self.seconds = 12.0
        self.parked_ns = None

    def strike(self):
        self.world.to_host.flaws = LinkFlaws(loss=1.0)
        self.world.after(self.muted, self._answers)

    def _answers(self):
        self.world.to_host.flaws = LinkFlaws()

    def reacted(self):
        # an answer that was under way may have come just before it was too late
        return super().reacted() or (self.muted < LOST + 2 * SEND and self.world.state is State.RUN)

    def look(self):
        super().look()
        world = self.world
        is_down = world.base.state is MachineState.IDLE and world.base.is_parked
        if world.state is State.FAULT and is_down and self.parked_ns is None:
            self.parked_ns = world.now

    @property
    def was_lost(self):
        return any(state is State.FAULT for _, state in self.world.account.states)

    def check(self):
        if not self.was_lost:
            return []
        if self.parked_ns is None:
            return [f"{self.name}: not parked by itself: {self.world.record.events}"]
        took = (self.parked_ns - self.struck_ns) / SECOND
        return [] if took < self.seconds else [f"{self.name}: parked after {took:.1f} s"]

    def bound(self):
        return LOST + SEND + 2 * TICK


class F38(F37):
    number = 38
    title = "the same, and the service is to end"
    reaction = "FAULT; the same way home within the time of parking, then it ends"
    recovery = "none needed: exit status 0"

    def strike(self):
        super().strike()
        self.world.after(self.muted + self.rng.uniform(0.0, 0.5), self._leave)

    def _leave(self):
        self.world.guard.ask_to_leave("terminated")

    def check(self):
        done = self.world.guard._done
        if not done.done():
            return [f"{self.name}: did not end: {self.world.record.events}"]
        return super().check() + ([] if done.status == 0 else [f"{self.name}: {done.status}"])


SCENES = (F37, F38)
