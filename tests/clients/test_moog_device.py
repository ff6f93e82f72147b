import struct
from itertools import pairwise
from math import nan, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moog_host import NEUTRAL, VirtualHost, frame, parse
from motion_clients.moog_config import MoogConfig
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_machine import STEP
from motion_clients.moog_wire import CommandMode, DiscreteIo, Fault, MachineState

ENGAGE, START, NEW_POSITION, PARK, RESET = 180, 175, 130, 210, 160
S = MachineState


def host(config=None, **kwargs):
    return VirtualHost(MoogDevice(config, **kwargs))


def engaged(config=None, mode=170):
    moog = host(config)
    moog.engage(mode)
    assert moog.device.state is S.ENGAGED
    return moog


def states(moog):
    return [state.name for _, state in moog.device.transitions]


# --- start, lift, park ---------------------------------------------------------------------------


@pytest.mark.parametrize("engage", [ENGAGE, START])
def test_whole_session_walks_through_every_state(engage):
    moog = host()
    moog.engage(engage=engage)
    moog.repeat(1.0, NEW_POSITION)
    moog.repeat(4.0, PARK)
    assert states(moog) == ["POWER_UP", "IDLE", "STANDBY", "ENGAGED", "PARKING", "IDLE"]
    faults, io, machine, words = parse(moog.replies[-1])
    assert (faults, io, machine) == (0, 0x01, 0xA1)
    assert words[2] == pytest.approx(-0.2286 + 0.17, abs=1e-4)


def test_power_up_takes_half_a_second_and_lift_its_time():
    moog = engaged()
    (_, start), (idle_at, _), (standby_at, _), (engaged_at, _) = moog.device.transitions
    assert start is S.POWER_UP
    assert idle_at == pytest.approx(0.5, abs=2 * STEP)
    assert engaged_at - standby_at == pytest.approx(3.0, abs=0.02)


def test_legs_are_bounded_in_lift_and_park():
    speeds = []
    moog = host(on_step=lambda _now, _legs, rates: speeds.append(rates))
    moog.engage()
    moog.repeat(5.0, PARK)
    assert max(abs(v) for rates in speeds for v in rates) < 0.102
    # Per step of the model, so with the servo's own ripple on top of the bound.
    changes = [
        abs(b - a) / STEP for one, two in pairwise(speeds) for a, b in zip(one, two, strict=True)
    ]
    assert max(changes) < 1.0


def test_engage_word_the_base_does_not_take_is_refused():
    moog = host(MoogConfig(engage_words=frozenset({START})))
    moog.engage(engage=ENGAGE)
    assert moog.device.state is S.IDLE
    assert moog.device.counters["refused"] > 0
    moog.repeat(4.0, START)
    assert moog.device.state is S.ENGAGED


def test_lift_goes_on_whatever_the_host_sends_but_park():
    moog = host()
    moog.repeat(1.0, 170)
    moog.repeat(0.5, ENGAGE)
    moog.repeat(1.0, NEW_POSITION)
    assert moog.device.state is S.STANDBY
    moog.repeat(4.0, PARK)
    assert states(moog)[-2:] == ["PARKING", "IDLE"]


def test_parking_is_not_called_off_by_engage():
    moog = engaged()
    moog.repeat(0.2, PARK)
    moog.repeat(1.0, ENGAGE)
    assert moog.device.state is S.PARKING


# --- modes and position --------------------------------------------------------------------------


def test_mode_changes_in_idle_only():
    moog = engaged()
    moog.repeat(0.1, 172)
    assert moog.device.mode is CommandMode.DOF
    moog.repeat(4.0, PARK)
    moog.repeat(0.1, 172)
    assert moog.device.mode is CommandMode.LENGTH
    _, _, machine, words = parse(moog.replies[-1])
    assert machine == 0x01
    assert words == pytest.approx(moog.device.config.home, abs=1e-6)


def test_position_moves_nothing_unless_engaged():
    moog = host()
    moog.repeat(1.0, 170)
    moog.repeat(1.0, NEW_POSITION, (0.1, 0.1, -0.2, 0.1, 0.1, 0.1))
    moog.repeat(1.0, NEW_POSITION, (9.0, 0, 0, 0, 0, 0))
    assert moog.device.is_parked
    assert moog.device.state is S.IDLE


def test_engaged_base_moves_for_new_position_only():
    moog = engaged()
    legs = list(moog.device.legs.extensions)
    for mcw in (ENGAGE, 170, 190, 200):
        moog.repeat(0.2, mcw, (0.05, 0, -0.2286, 0, 0, 0))
    assert moog.device.state is S.ENGAGED
    assert moog.device.legs.extensions == pytest.approx(legs, abs=1e-6)


def test_dof_feedback_follows_late():
    moog = engaged()

    def surge(t):
        return (0, 0, -0.2286, 0.03 * sin(pi * t) ** 2, 0, 0)

    moog.play(0.5, surge)
    reported = parse(moog.replies[-1])[3][3]
    assert 0.001 < 0.03 - reported < 0.01
    moog.repeat(0.5, NEW_POSITION, (0, 0, -0.2286, 0.03, 0, 0))
    assert parse(moog.replies[-1])[3] == pytest.approx((0, 0, -0.2286, 0.03, 0, 0), abs=1e-4)


def test_length_mode_takes_and_reports_lengths():
    moog = engaged(mode=172)
    legs = moog.device.target
    lengths = tuple(x + 0.001 * i for i, x in enumerate(legs))
    moog.repeat(0.5, NEW_POSITION, lengths)
    assert moog.device.legs.extensions == pytest.approx(lengths, abs=1e-5)
    _, _, machine, words = parse(moog.replies[-1])
    assert machine == 0x03
    assert words == pytest.approx(lengths, abs=1e-4)


def test_replies_once_per_command_and_never_to_another_length():
    moog = host()
    assert moog.send(b"") is None
    assert moog.send(bytes(31)) is None
    assert moog.send(frame(170) + b"\0") is None
    assert len(moog.send(frame(170))) == 40
    assert moog.device.counters["wrong_size"] == 3


# --- faults --------------------------------------------------------------------------------------


def test_silence_while_raised_faults_parks_and_resets_only_parked():
    moog = engaged()
    moog.be_silent(0.6)
    assert moog.device.state is S.FAULT2
    moog.repeat(0.2, RESET)
    assert moog.device.state is S.FAULT2
    moog.be_silent(3.0)
    assert moog.device.is_parked
    faults, io, machine, _ = parse(moog.send(frame(170)))
    assert (faults, io, machine) == (Fault.COMM, DiscreteIo.BASE_AT_HOME, 0xA9)
    moog.repeat(0.1, RESET)
    assert moog.device.state is S.IDLE
    assert moog.device.faults == 0


def test_silence_in_lift_faults_and_silence_in_idle_does_not():
    moog = host()
    moog.repeat(1.0, 170)
    moog.be_silent(5.0)
    assert moog.device.state is S.IDLE
    moog.repeat(1.0, ENGAGE)
    moog.be_silent(0.6)
    assert moog.device.state is S.FAULT2
    assert moog.device.faults == Fault.COMM


@pytest.mark.parametrize(
    "words",
    [
        (0.6, 0, -0.2286, 0, 0, 0),
        (0, 0.6, -0.2286, 0, 0, 0),
        (0, 0, 0.1, 0, 0, 0),
        (0, 0, -0.5, 0, 0, 0),
        (0, 0, -0.2286, 0.4, 0, 0),
        (0, 0, -0.2286, 0, 0.6, 0),
        (0, 0, -0.2286, 0, 0, -0.4),
        (0.3, 0.3, -0.2286, 0.2, 0, 0),  # within every clamp, beyond the legs
        (1e38, 0, 0, 0, 0, 0),
    ],
)
def test_pose_out_of_range_faults_before_it_moves(words):
    moog = engaged()
    before = list(moog.device.legs.extensions)
    moog.send(frame(NEW_POSITION, words))
    assert moog.device.state is S.FAULT2
    assert moog.device.faults == Fault.COMMAND_RANGE
    assert moog.device.legs.extensions == pytest.approx(before, abs=1e-6)


@pytest.mark.parametrize("length", [-0.001, 0.2790])
def test_length_out_of_stroke_faults(length):
    moog = engaged(mode=172)
    moog.send(frame(NEW_POSITION, (length, *moog.device.target[1:])))
    assert moog.device.faults == Fault.COMMAND_RANGE


def test_end_of_stroke_itself_is_allowed_as_float32():
    moog = engaged(MoogConfig(jump_max=1.0), mode=172)
    moog.send(frame(NEW_POSITION, (0.0, 0.2789, 0.2789, 0.0, 0.1, 0.1)))
    assert moog.device.state is S.ENGAGED


def test_jump_beyond_the_envelope_faults():
    moog = engaged(mode=172)
    legs = moog.device.target
    moog.send(frame(NEW_POSITION, (legs[0] + 0.019, *legs[1:])))
    assert moog.device.state is S.ENGAGED
    moog.send(frame(NEW_POSITION, (legs[0] - 0.002, *legs[1:])))
    assert moog.device.faults == Fault.ENVELOPE


@pytest.mark.parametrize(
    "bad", [frame(1), frame(0), frame(255), frame(NEW_POSITION, (nan, *NEUTRAL[1:]))]
)
def test_invalid_frame_is_answered_and_faults(bad):
    moog = engaged()
    reply = moog.send(bad)
    assert parse(reply)[0] == Fault.INVALID_FRAME
    assert moog.device.state is S.FAULT2
    moog.repeat(4.0, NEW_POSITION)
    assert moog.device.is_parked
    moog.send(frame(RESET))
    assert moog.device.state is S.IDLE


def test_file_number_above_the_command_is_ignored():
    moog = host()
    moog.repeat(0.6, 170 + (102 << 8))
    assert moog.device.faults == 0


def test_estop_parks_and_resets_only_when_released():
    moog = engaged()
    moog.device.press_estop()
    moog.repeat(4.0, NEW_POSITION)
    faults, io, machine, _ = parse(moog.replies[-1])
    assert (faults, io, machine & 15) == (0x8000, 0x81, 9)
    moog.repeat(0.1, RESET)
    assert moog.device.state is S.FAULT2
    moog.device.release_estop()
    moog.repeat(0.1, RESET)
    assert moog.device.state is S.IDLE


def test_estop_without_batteries_stands_until_released():
    moog = engaged(MoogConfig(estop_lowers=False))
    legs = list(moog.device.legs.extensions)
    moog.device.press_estop()
    moog.repeat(3.0, NEW_POSITION)
    assert moog.device.is_at_rest
    assert moog.device.legs.extensions == pytest.approx(legs, abs=1e-6)
    moog.device.release_estop()
    moog.repeat(4.0, NEW_POSITION)
    assert moog.device.is_parked


def test_fault3_stands_until_power_is_cycled():
    moog = engaged()
    moog.device.latch_fault(Fault.AMPLIFIER, severity=3)
    for mcw in (RESET, PARK, ENGAGE):
        moog.repeat(1.0, mcw)
    assert moog.device.state is S.FAULT3
    assert moog.device.is_at_rest
    assert not moog.device.is_at_home
    moog.device.reboot()
    assert moog.device.faults == 0
    moog.repeat(4.0, 170)
    assert states(moog)[-2:] == ["POWER_UP", "IDLE"]
    assert moog.device.is_parked


def test_fault1_stands_until_park():
    moog = engaged()
    moog.device.latch_fault(Fault.MOTOR_THERMAL, severity=1)
    moog.repeat(1.0, NEW_POSITION)
    assert moog.device.is_at_rest
    moog.repeat(4.0, PARK)
    assert moog.device.state is S.FAULT1
    assert moog.device.is_parked
    moog.send(frame(RESET))
    assert moog.device.state is S.IDLE


def test_graver_fault_overrules_a_lesser_one_and_not_the_reverse():
    moog = engaged()
    moog.device.latch_fault(Fault.MOTOR_THERMAL, severity=1)
    moog.device.latch_fault(Fault.AMPLIFIER, severity=3)
    moog.device.latch_fault(Fault.COMM, severity=2)
    assert moog.device.state is S.FAULT3
    assert moog.device.faults == Fault.MOTOR_THERMAL | Fault.AMPLIFIER | Fault.COMM


def test_option_the_base_lacks_and_inhibit_after_disable_are_refused():
    moog = engaged()
    moog.send(frame(140))
    moog.send(frame(220))
    moog.send(frame(150))
    assert moog.device.state is S.DISABLED
    assert moog.device.counters["refused"] == 2


def test_legs_that_contradict_each_other_repeat_the_last_pose():
    moog = engaged()
    moog.device.stick_leg(0)
    moog.device.stick_leg(3)
    moog.device.legs.extensions[0] = 0.2789
    moog.device.legs.extensions[1] = 0.0
    moog.repeat(4.0, PARK)
    assert len(moog.replies[-1]) == 40


def test_disable_comes_down_and_inhibit_stands():
    moog = engaged()
    moog.repeat(0.5, 150)
    assert moog.device.state is S.INHIBITED
    moog.repeat(1.0, NEW_POSITION)
    assert not moog.device.is_at_home
    moog.repeat(0.1, 220)
    moog.repeat(4.0, ENGAGE)
    assert moog.device.state is S.DISABLED
    assert moog.device.is_parked
    moog.send(frame(RESET))
    assert moog.device.state is S.IDLE


def test_inhibited_base_parks_when_told():
    moog = engaged()
    moog.repeat(0.5, 150)
    moog.repeat(4.0, PARK)
    assert states(moog)[-3:] == ["INHIBITED", "PARKING", "IDLE"]


def test_reboot_while_raised_sinks_before_it_is_idle():
    moog = engaged()
    moog.device.reboot()
    moog.repeat(1.0, NEW_POSITION)
    assert moog.device.state is S.POWER_UP
    assert not moog.device.is_at_home
    moog.repeat(3.0, NEW_POSITION)
    assert moog.device.state is S.IDLE


def test_stuck_leg_keeps_the_base_from_coming_home_until_freed():
    moog = engaged()
    moog.device.stick_leg(3)
    moog.repeat(5.0, PARK)
    assert moog.device.state is S.PARKING
    moog.device.free_leg(3)
    moog.repeat(4.0, PARK)
    assert moog.device.state is S.IDLE


def test_fault_at_full_speed_brakes_within_the_drives_limits():
    rates = []
    moog = host(on_step=lambda _now, _legs, speeds: rates.append(speeds))
    moog.engage(172)
    legs = moog.device.target
    moog.play(0.2, lambda t: [x + 0.5 * t for x in legs])
    moog.device.latch_fault(Fault.DRIVE_BUS)
    moog.repeat(5.0, NEW_POSITION)
    assert moog.device.is_parked
    assert max(abs(v) for speeds in rates for v in speeds) <= 0.78
    changes = [abs(b - a) for x, y in pairwise(rates) for a, b in zip(x, y, strict=True)]
    assert max(changes) <= 10.4 * STEP + 1e-9


# --- anything at all -----------------------------------------------------------------------------

commands = st.one_of(
    st.binary(max_size=64),
    st.binary(min_size=32, max_size=32),
    st.builds(
        lambda mcw, words: struct.pack("!I6fI", mcw, *words, 0),
        st.sampled_from([130, 150, 160, 170, 172, 175, 180, 210, 220]),
        st.tuples(*[st.floats(width=32)] * 6),
    ),
    st.builds(frame, st.sampled_from([130, 150, 160, 170, 172, 175, 180, 210, 220])),
)


@given(script=st.lists(st.tuples(commands, st.sampled_from([0.0, 0.01, 0.3, 2.5])), max_size=12))
@settings(max_examples=25, deadline=None)
def test_no_datagram_breaks_the_base_or_its_limits(script):
    seen = []
    moog = host(on_step=lambda _now, legs, speeds: seen.append((*legs, *speeds)))
    moog.engage()
    for datagram, pause in script:
        reply = moog.send(datagram)
        assert (reply is None) == (len(datagram) != 32)
        assert reply is None or len(reply) == 40
        moog.be_silent(pause)
    stroke = moog.device.config.geometry.stroke
    assert all(0.0 <= x <= stroke for row in seen for x in row[:6])
    assert all(abs(v) <= 0.78 + 1e-9 for row in seen for v in row[6:])
    moog.be_silent(6.0)
    assert moog.device.is_at_rest


def test_figures_no_base_could_have_are_refused():
    with pytest.raises(ValueError, match="2 to 5 s"):
        MoogConfig(lift_duration=1.0)
    with pytest.raises(ValueError, match="stroke"):
        MoogConfig(home_heave=-0.2286)
