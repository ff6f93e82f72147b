"""States and legs of an emulated Moog 6DOF2000E, moved by commands, mishaps and time.

No socket and no clock: the caller says what time it is, so a park sequence tests in
milliseconds. What no readable source states (the silence that trips the comm fault, what FAULT1
does, the leg geometry) is assumed, in :class:`MoogConfig` or where it is decided.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from .hexapod_legs import Six
from .leg_servos import LegServos
from .moog_config import MoogConfig
from .moog_wire import CommandMode, Fault, MachineState, Mcw
from .position_feedback import PositionFeedback

STEP = 0.002
"""Integration step of the model [s]."""

MOST_TRANSITIONS = 4096
"""States entered that are remembered: a host may ask for others as often as it likes."""

_HOME_TOLERANCE = 1e-3  # [m], a home switch
_FAULTED = (MachineState.FAULT1, MachineState.FAULT2, MachineState.FAULT3)
_RAISED = (MachineState.STANDBY, MachineState.ENGAGED, MachineState.INHIBITED)
_OPERABLE = (MachineState.IDLE, *_RAISED, MachineState.PARKING)

LegObserver = Callable[[float, Six, Six], None]


class MoogMachine:
    """One base; instants given to it must not run backwards.

    Attributes:
        config: The machine.
        counters: Events by name: ``wrong_size``, ``invalid``, ``refused``, ``resets``.
        faults: Latched fault bits.
        is_estopped: Whether the E-stop is held.
        legs: The drives.
        mode: Command mode in force.
        now: Instant up to which the model has been advanced [s].
        state: Machine state.
        transitions: The newest states entered, with their instants [s].
    """

    def __init__(
        self, config: MoogConfig | None = None, *, on_step: LegObserver | None = None
    ) -> None:
        """A base just switched on, parked.

        Args:
            config: The machine.
            on_step: Called after every integration step with instant [s], extensions [m] and
                speeds [m/s] of the legs.
        """
        self.config = config = MoogConfig() if config is None else config
        self.counters: Counter[str] = Counter()
        self.faults = Fault(0)
        self.is_estopped = False
        self.mode = config.initial_mode
        self.now = 0.0
        self.state = MachineState.POWER_UP
        self.transitions: list[tuple[float, MachineState]] = []
        self._home, self._neutral = config.home, config.neutral
        self.legs = LegServos(
            self._home,
            stroke=config.geometry.stroke,
            speed=config.leg_speed,
            acceleration=config.leg_acceleration,
        )
        self.feedback = PositionFeedback(
            config.geometry,
            (0.0, 0.0, config.home_heave, 0.0, 0.0, 0.0),
            lag=config.feedback_lag,
            delay=config.feedback_delay,
            step=STEP,
        )
        self._on_step = on_step
        self._is_started = False
        self._is_lowering = False
        self._entered = 0.0
        self._heard = 0.0

    @property
    def target(self) -> Six:
        """Leg extensions the drives are told to reach, six [m]."""
        return self.legs.target

    @property
    def is_at_home(self) -> bool:
        """Whether every leg is at its parked extension."""
        return all(
            abs(x - home) < _HOME_TOLERANCE
            for x, home in zip(self.legs.extensions, self._home, strict=True)
        )

    @property
    def is_at_rest(self) -> bool:
        """Whether the base stands and will stand."""
        return self.legs.is_at_rest and not self._is_lowering

    @property
    def is_parked(self) -> bool:
        """Whether the base is down and stands."""
        return self.is_at_home and self.is_at_rest

    def advance(self, now: float) -> None:
        """Let time pass until ``now`` [s]; the first call sets the origin."""
        if not self._is_started:
            self._is_started = True
            self.now = self._heard = now
            self._enter(self.state)
        while self.now + STEP <= now + 1e-9:
            self.now += STEP
            self._step()

    # What may happen to a base.

    def latch_fault(self, fault: Fault, severity: int = 2) -> None:
        """Latch fault bits.

        Args:
            fault: The bits.
            severity: 1 stands until PARK (assumed), 2 parks itself, 3 stands until power is cycled.
        """
        self.faults |= fault
        worst = _FAULTED[severity - 1]
        if self.state in _FAULTED and self.state >= worst:
            return
        self._enter(worst)
        if worst is MachineState.FAULT2:
            self._lower()
        else:
            self._stand()

    def press_estop(self) -> None:
        """Press and hold the E-stop."""
        self.is_estopped = True
        self.latch_fault(Fault.ESTOP)
        if not self.config.estop_lowers:
            self._stand()

    def release_estop(self) -> None:
        """Let go of the E-stop; the fault stays latched."""
        self.is_estopped = False
        if self.state is MachineState.FAULT2 and not self._is_lowering:
            self._lower()

    def stick_leg(self, leg: int) -> None:
        """Jam leg ``leg`` (0..5) where it is."""
        self.legs.stuck.add(leg)

    def free_leg(self, leg: int) -> None:
        """Free a jammed leg; a base that could not come down for it does so now."""
        self.legs.stuck.discard(leg)
        if self.target == self._home:
            self._lower()

    def reboot(self) -> None:
        """Cycle the power: faults and mode are forgotten, a raised base sinks to its home."""
        self.faults = Fault(0)
        self.mode = self.config.initial_mode
        self._enter(MachineState.POWER_UP)
        self._lower()
        if self.is_estopped:
            self.press_estop()

    # What a command does; never more than its line in the state table allows.

    def go_to(self, words: Six) -> None:
        """NEW_POSITION: follow six words, if they are within range and near the last ones."""
        if self.state is not MachineState.ENGAGED:
            return
        config = self.config
        legs = config.commanded_extensions(words, self.mode)
        if not (config.is_within_clamps(words, self.mode) and config.is_within_stroke(legs)):
            self.latch_fault(Fault.COMMAND_RANGE)
        elif max(abs(b - a) for a, b in zip(self.target, legs, strict=True)) > config.jump_max:
            self.latch_fault(Fault.ENVELOPE)
        else:
            # Over two frames: ending with the frame, the legs would stop for every late command.
            self.legs.follow(legs, 2.0 * config.frame_period)

    def select(self, mode: CommandMode) -> None:
        """DOF_MODE, LENGTH_MODE: only in IDLE."""
        if self.state is MachineState.IDLE:
            self.mode = mode
        elif mode is not self.mode:
            self.counters["refused"] += 1

    def engage(self, mcw: Mcw) -> None:
        """ENGAGE or START, whichever this base accepts: lift, only from IDLE."""
        if mcw not in self.config.engage_words:
            self.counters["refused"] += 1
        elif self.state not in (MachineState.STANDBY, MachineState.ENGAGED) and self._change(
            MachineState.STANDBY, of=(MachineState.IDLE,)
        ):
            self.legs.move(self._neutral, self.config.lift_duration)

    def disable(self) -> None:
        """DISABLE: drives off, the base comes down by itself (assumed)."""
        if self._change(MachineState.DISABLED, of=_OPERABLE):
            self._lower()

    def inhibit(self) -> None:
        """INHIBIT: motion forbidden, the base stands until PARK (assumed)."""
        if self._change(MachineState.INHIBITED, of=_OPERABLE):
            self._stand()

    def park(self) -> None:
        """PARK: brake, then lower."""
        if self.state in _RAISED:
            self._enter(MachineState.PARKING)
            self._lower()
        elif self.state is MachineState.FAULT1 and not self._is_lowering:
            self._lower()

    def reset(self) -> None:
        """RESET: forget faults, only once parked and with the E-stop released."""
        if self.state in (MachineState.IDLE, MachineState.POWER_UP):
            return
        stopped = (
            MachineState.FAULT1,
            MachineState.FAULT2,
            MachineState.DISABLED,
            MachineState.INHIBITED,
        )
        if self.is_estopped or not self.is_parked:
            self.counters["refused"] += 1
        elif self._change(MachineState.IDLE, of=stopped):
            self.faults = Fault(0)
            self.counters["resets"] += 1

    def _change(self, state: MachineState, *, of: tuple[MachineState, ...]) -> bool:
        """Enter ``state`` from one of ``of``; whether that happened."""
        if self.state is state:
            return False
        if self.state not in of:
            self.counters["refused"] += 1
            return False
        self._enter(state)
        return True

    # What time does.

    def _step(self) -> None:
        self.legs.step(STEP)
        if self._is_lowering and self.legs.is_at_rest:
            if self.target == self._home:
                self._is_lowering = False
            else:
                self.legs.move_gently(
                    self._home, self.config.park_speed, self.config.park_acceleration
                )
        self._follow_time()
        self.feedback.update(self.legs.extensions)
        if self._on_step is not None:
            self._on_step(self.now, tuple(self.legs.extensions), tuple(self.legs.speeds))

    def _follow_time(self) -> None:
        state = self.state
        if state is MachineState.POWER_UP:
            age = self.now - self._entered
            if age >= self.config.power_up_duration - 1e-9 and self.is_parked:
                self._enter(MachineState.IDLE)
        elif state is MachineState.PARKING and self.is_parked:
            self._enter(MachineState.IDLE)
        elif state in _RAISED:
            if self.now - self._heard > self.config.silence_max and not self.is_parked:
                self.latch_fault(Fault.COMM)
            elif state is MachineState.STANDBY and self.legs.has_arrived:
                self._enter(MachineState.ENGAGED)

    def _enter(self, state: MachineState) -> None:
        self.state = state
        self._entered = self.now
        if len(self.transitions) >= MOST_TRANSITIONS:
            del self.transitions[0]
        self.transitions.append((self.now, state))

    def _stand(self) -> None:
        self._is_lowering = False
        self.legs.brake()

    def _lower(self) -> None:
        """Brake first; once the legs stand they sink together, from rest to rest."""
        if not self.is_parked:
            self._is_lowering = True
            self.legs.brake()
