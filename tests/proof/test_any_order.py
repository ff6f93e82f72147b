"""Packets, plans, mishaps and operators in any order against the guard and the emulated base.

A longer run, ten thousand steps and more:

    pytest -m campaign tests/proof/test_any_order.py
"""

import struct

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)
from moog_scene import KINDS, LATCHED, Scene, scene_in
from motion_clients.moog_wire import Fault
from motion_protocol import Mode

from motionserver.core.safety.states import CUED, State
from motionserver.core.safety.supervisor import is_standing

LEAST = {"print_blob": True, "deadline": None, "suppress_health_check": list(HealthCheck)}
FAULTS = (Fault.DRIVE_BUS, Fault.LIMIT_SWITCH, Fault.COMM, Fault.TORQUE_MONITOR, Fault.ENVELOPE)
seconds = st.sampled_from((0.02, 0.1, 0.3, 1.0))
AFTER = st.sampled_from((0.004, 0.1, 0.4))


class AnyOrder(RuleBasedStateMachine):
    """What anybody may do; `account` judges after every step."""

    @initialize(state=st.sampled_from((State.RUN, State.RUN, State.READY, State.RAISING)))
    def begin(self, state):
        self.scene = scene_in(state).clone()

    # the client

    @rule(mode=st.sampled_from(tuple(Mode)), after=AFTER)
    def client_speaks(self, mode, after):
        self.scene.client, self.scene.mode = "good", mode
        self.scene.run(after)

    @rule(after=seconds)
    def client_is_silent(self, after):
        self.scene.client = "silent"
        self.scene.run(after)

    @rule(data=st.binary(max_size=120))
    def client_sends_rubbish(self, data):
        self.scene.heard(data)
        self.scene.run(0.01)

    @rule(at=st.integers(0, 80), value=st.sampled_from((float("nan"), float("inf"), 1e30, -1e9)))
    def client_sends_no_number(self, at, value):
        def spoil(data):
            at_most = min(at, len(data) - 4)
            return data[:at_most] + struct.pack("<f", value) + data[at_most + 4 :]

        self.scene.cue(spoil=spoil)
        self.scene.run(0.01)

    @rule(shift=st.integers(0, 100), delay=st.floats(0.0, 3.0))
    def client_is_late(self, shift, delay):
        self.scene.cue(shift=shift, delay_ns=int(delay * 1e9))
        self.scene.run(0.01)

    # the planner

    @rule(kinds=st.lists(st.sampled_from(KINDS), min_size=1, max_size=4), after=seconds)
    def planner_proposes(self, kinds, after):
        self.scene.planner, self.scene.proposals.kinds = True, tuple(kinds)
        self.scene.run(after)

    @rule(after=seconds)
    def planner_dies(self, after):
        self.scene.planner = False
        self.scene.run(after)

    @rule(after=seconds)
    def planner_drives(self, after):
        self.scene.planner, self.scene.proposals.kinds = True, ("gentle", "dash")
        self.scene.client, self.scene.mode = "good", Mode.DRIVE
        self.scene.run(after)

    # the base

    @rule(fault=st.sampled_from(FAULTS), severity=st.sampled_from((1, 2)), after=AFTER)
    def base_faults(self, fault, severity, after):
        self.scene.base.latch_fault(fault, severity)
        self.scene.run(after)

    @rule(press=st.booleans(), after=AFTER)
    def stop(self, press, after):
        base = self.scene.base
        base.press_estop() if press else base.release_estop()
        self.scene.run(after)
        if press:
            assert self.scene.state not in CUED | {State.RAISING}

    @rule(leg=st.integers(0, 5), free=st.booleans(), after=AFTER)
    def leg_jams(self, leg, free, after):
        base = self.scene.base
        base.free_leg(leg) if free else base.stick_leg(leg)
        self.scene.run(after)

    @rule(after=AFTER)
    def base_reboots(self, after):
        self.scene.base.reboot()
        self.scene.run(after)

    @rule(to_base=st.booleans(), to_host=st.booleans(), after=AFTER)
    def cable(self, to_base, to_host, after):
        self.scene.to_base, self.scene.to_host = to_base, to_host
        self.scene.run(after)

    # the operator

    @rule(op=st.sampled_from(("engage", "park", "reset")), after=AFTER)
    def operator(self, op, after):
        self.scene.tick(op)
        self.scene.run(after)

    @rule()
    def operator_repairs(self):
        """Everything is put in order, and it is reset until it is down."""
        scene, base = self.scene, self.scene.base
        scene.to_base = scene.to_host = True
        base.release_estop()
        for leg in range(6):
            base.free_leg(leg)
        for _ in range(12):
            scene.run(0.5)
            if scene.state is State.PARKED:
                break
            scene.tick("reset")

    # time

    @rule(after=seconds)
    def time_passes(self, after):
        self.scene.run(after)

    @rule(gap=st.floats(0.001, 2.0))
    def loop_stalls(self, gap):
        self.scene.stall(gap)
        self.scene.run(0.02)

    @invariant()
    def holds(self):
        scene = self.scene
        scene.account()
        if scene.state in (State.PARKED, State.OFFLINE, State.SAFE):
            assert scene.record.playback is None
        if scene.state in CUED:
            assert scene.record.playback is not None

    def teardown(self):
        """Whatever happened: left alone, with its cable, it comes to rest."""
        if not hasattr(self, "scene"):
            return
        scene = self.scene
        scene.client, scene.planner = "silent", False
        scene.to_base = scene.to_host = True
        ended = (*LATCHED, State.PARKED)
        for _ in range(30):
            if scene.state in ended and is_standing(scene.record.playback):
                break
            scene.run(1.0)
        scene.account()
        assert scene.state in (*LATCHED, State.PARKED, State.OFFLINE), scene.state
        assert is_standing(scene.record.playback)


def play(examples, steps):
    profile = settings(max_examples=examples, stateful_step_count=steps, **LEAST)
    run_state_machine_as_test(AnyOrder, settings=profile)


def test_in_any_order():
    play(examples=3, steps=10)


@pytest.mark.campaign
@pytest.mark.timeout(0)
def test_in_any_order_for_long():
    play(examples=300, steps=40)


def test_the_scene_itself_lives():
    scene = scene_in(State.RUN).clone()
    scene.run(1.0)
    assert scene.counted["follows"] > 50
    assert scene.is_moving
    scene.tick("park")
    scene.until(State.PARKED, 20.0)
    scene.account()
    assert isinstance(scene, Scene)
