import json
from math import nan, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moog_host import VirtualHost, frame
from motion_clients.moog_config import MoogConfig
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_judge import MoogJudge
from motion_clients.moog_judged import JudgedLimits

NEW_POSITION, PARK = 130, 210


def session(mode=170, config=None, limits=None):
    device = MoogDevice(config)
    host = VirtualHost(device, MoogJudge(device.config, limits))
    host.engage(mode)
    return host


def verdict(host):
    summary = host.judge.summary(host.device)
    assert json.loads(json.dumps(summary)) == summary
    return summary


def by_kind(host):
    return {k: n for k, n in verdict(host)["violations_by_kind"].items() if n}


def swing(amplitude, rate):
    """A quintic-soft start into a sinusoid of heave [m, rad/s]."""

    def words(t):
        u = min(1.0, t / 3.0)
        soft = u**3 * (10 - 15 * u + 6 * u * u)
        return 0, 0, -0.2286 + soft * amplitude * sin(rate * t), 0, 0, 0

    return words


def test_honest_session_is_acquitted():
    host = session()
    # At 3 s the swing stands at its top, so that it can be played backwards from there.
    host.play(6.0, lambda t: swing(0.06, 2 * pi * 0.75)(min(t, 6.0 - t)))
    host.repeat(1.0, NEW_POSITION)
    assert not verdict(host)["ended_safe"]
    host.repeat(5.0, PARK)
    summary = verdict(host)
    assert summary["violations"] == 0
    assert summary["ended_safe"]
    assert summary["states_visited"] == [
        "POWER_UP",
        "IDLE",
        "STANDBY",
        "ENGAGED",
        "PARKING",
        "IDLE",
    ]


def test_soft_swing_has_no_offence_and_true_figures():
    host = session()
    host.play(8.0, swing(0.06, 2 * pi * 0.8))
    summary = verdict(host)
    assert summary["violations"] == 0
    # Heave and legs are not quite parallel: a leg moves 0.7 of the heave at neutral.
    assert 0.15 < summary["speed_max"] < 0.30
    assert 0.8 < summary["acceleration_max"] < 1.6
    assert summary["mean_rate_hz"] == pytest.approx(60.0)
    assert summary["gap_ms"]["max"] == pytest.approx(1000 / 60)
    assert summary["positions"] == summary["positions_obeyed"] == 480
    assert not summary["ended_safe"]


def test_bad_stream_is_convicted_though_the_base_is_never_harmed():
    host = session(config=MoogConfig(jump_max=1.0))
    host.play(2.0, lambda t: (0, 0, -0.2286 + 0.19 * sin(2 * pi * 3 * t), 0, 0, 0))
    kinds = by_kind(host)
    assert set(kinds) == {"speed", "acceleration"}
    assert verdict(host)["speed_max"] > 2.0
    assert max(abs(v) for v in host.device.legs.speeds) <= 0.78


def test_step_from_standstill_is_convicted_by_acceleration():
    host = session(mode=172)
    legs = host.device.target
    host.send(frame(NEW_POSITION, (legs[0], legs[1], legs[2] + 0.003, *legs[3:])))
    summary = verdict(host)
    assert summary["violations_by_leg"]["acceleration"] == [0, 0, 1, 0, 0, 0]
    assert summary["acceleration_max"] == pytest.approx(0.003 * 3600, rel=1e-3)
    assert summary["step_max_mm"] == pytest.approx(3.0, rel=1e-3)
    assert summary["first_violations"][0]["kind"] == "acceleration"


def test_leg_out_of_stroke_is_counted_per_leg():
    host = session(mode=172, limits=JudgedLimits(speed=1e3, acceleration=1e6))
    host.send(frame(NEW_POSITION, (0.28, 0.2789, 0.0, -0.001, 0.1, 0.1)))
    assert verdict(host)["violations_by_leg"]["stroke"] == [1, 0, 0, 1, 0, 0]
    assert host.judge.violations == 2


def test_unreachable_pose_is_convicted_by_the_judges_own_kinematics():
    host = session(limits=JudgedLimits(speed=1e3, acceleration=1e6))
    host.send(frame(NEW_POSITION, (0.3, 0.3, -0.2286, 0.2, 0, 0)))
    assert set(by_kind(host)) == {"stroke"}


def test_pose_beyond_the_clamps_and_nan_are_offences():
    host = session(limits=JudgedLimits(speed=1e3, acceleration=1e6))
    host.send(frame(NEW_POSITION, (0, 0, 0.01, 0, 0, 0)))
    host.send(frame(NEW_POSITION, (nan, 0, -0.2286, 0, 0, 0)))
    kinds = by_kind(host)
    assert kinds["range"] == 1
    assert kinds["not_finite"] == 1
    assert verdict(host)["invalid"] == 1


def test_jump_over_a_gap_is_convicted_and_a_pause_is_not():
    host = session(mode=172)
    legs = host.device.target
    host.repeat(0.5, NEW_POSITION, legs)
    host.be_silent(0.2)
    host.repeat(0.5, NEW_POSITION, legs)
    assert host.judge.violations == 0
    host.be_silent(0.2)
    host.repeat(0.1, NEW_POSITION, [x + 0.01 for x in legs])
    assert by_kind(host)["acceleration"] >= 6
    assert verdict(host)["gap_jump_max_mm"] == pytest.approx(10.0, rel=1e-3)
    assert verdict(host)["gap_ms"]["max"] > 200


def test_positions_sent_before_the_lift_are_judged_from_neutral_once_obeyed():
    host = session()
    host.repeat(4.0, PARK)
    host.repeat(0.5, NEW_POSITION)
    host.repeat(1.0, 180)
    # From here positions are ignored until the lift ends in the middle of the stretch.
    host.repeat(4.0, NEW_POSITION, (0, 0, -0.2186, 0, 0, 0))
    assert by_kind(host)["acceleration"] == 12
    assert verdict(host)["gap_jump_max_mm"] == 0.0


def test_positions_a_faulted_base_ignores_go_on_in_their_stretch():
    host = session()
    host.repeat(0.5, NEW_POSITION)
    stretches = verdict(host)["stretches"]
    host.device.press_estop()
    host.repeat(5.0, NEW_POSITION)
    summary = verdict(host)
    assert summary["stretches"] == stretches
    assert summary["violations"] == 0
    assert summary["ended_safe"]


def test_wrong_sizes_are_counted_apart():
    host = session()
    host.send(b"hello")
    assert verdict(host)["wrong_size"] == 1
    assert host.judge.violations == 0


def test_jerk_is_judged_only_when_limited():
    legs = MoogConfig().neutral
    for jerk, offences in ((None, 0), (50.0, 6)):
        host = session(mode=172, limits=JudgedLimits(acceleration=100.0, jerk=jerk))
        host.send(frame(NEW_POSITION, [x + 0.001 for x in legs]))
        assert host.judge.violations == offences
        assert verdict(host)["jerk_max"] == pytest.approx(0.001 * 60**3, rel=1e-3)


def test_empty_record_has_a_verdict():
    device = MoogDevice()
    summary = MoogJudge().summary(device)
    assert summary["violations"] == 0
    assert summary["mean_rate_hz"] == 0.0


@given(
    speed=st.floats(0.05, 1.2),
    leg=st.integers(0, 5),
)
@settings(max_examples=25, deadline=None)
def test_ramp_is_convicted_exactly_when_too_fast(speed, leg):
    if abs(speed - 0.6) < 1e-3:
        return
    host = session(mode=172, config=MoogConfig(jump_max=1.0), limits=JudgedLimits(acceleration=1e6))
    start = list(host.device.target)

    def ramp(t):
        legs = list(start)
        legs[leg] += speed * t
        return legs

    host.play(0.1, ramp)
    assert (host.judge.violations > 0) == (speed > 0.6)


@given(datagrams=st.lists(st.binary(min_size=30, max_size=34), max_size=10))
@settings(max_examples=25, deadline=None)
def test_no_datagram_breaks_the_judge(datagrams):
    host = session()
    for datagram in datagrams:
        host.send(datagram)
        host.send(frame(NEW_POSITION)[:8] + datagram[:20] + bytes(4))
    verdict(host)


def after_a_loss(limits, lost, jump=0.0):
    """Heave swings, ``lost`` commands vanish on the way, then the swing goes on where it is."""
    host = session(limits=limits)
    wave = swing(0.06, 2 * pi * 0.75)
    host.play(2.0, wave)
    begin = host.now
    host.be_silent(lost / 60)
    gone = 2.0 + host.now - begin

    def later(t):
        words = list(wave(gone + t))
        words[2] += jump
        return words

    host.play(1.0, later)
    return verdict(host)


@pytest.mark.parametrize("lost", [1, 2, 7])
def test_a_wire_that_loses_commands_excuses_the_steps_it_hides(lost):
    assert after_a_loss(None, lost)["violations"] > 0
    assert after_a_loss(JudgedLimits(may_lose=True), lost)["violations"] == 0


def test_a_wire_that_loses_commands_excuses_no_jump():
    assert after_a_loss(JudgedLimits(may_lose=True), 2, jump=0.03)["violations"] > 0


def move(amplitude=0.04, rate=2 * pi * 0.8):
    """The words of a soft swing at one instant after the other, a period apart."""
    words = swing(amplitude, rate)
    return [words(3.0 + k / 60) for k in range(60)]


def at_instants(instants, limits=None):
    """An engaged base that follows softly, then gets a second of a swing at these instants."""
    host = session(limits=limits)
    host.play(3.0, swing(0.04, 2 * pi * 0.8))
    start = host.now
    for instant, words in zip(instants, move(), strict=True):
        host.now = start + instant
        host.send(frame(NEW_POSITION, words))
    return host


def with_one_late(lateness):
    """Sixty instants, one of them late, the next on the grid again."""
    return [k / 60 + (lateness if k == 30 else 0.0) for k in range(60)]


def test_commands_a_millisecond_apart_are_convicted_in_wall_time():
    """The step in send order is one period's, as ever: 1 ms of wall time makes it 16 times it."""
    host = at_instants(with_one_late(1 / 60 - 0.001))
    told = verdict(host)
    assert told["violations_by_kind"]["spacing"] == 1
    assert told["violations_by_kind"]["speed"] == told["violations_by_kind"]["acceleration"] == 0
    assert told["commands_too_close"] == 1
    assert told["spacing_min_ms"] == pytest.approx(1.0)
    # the step about the late command took a sixteenth of its period
    assert told["wall_speed_max"] > 5 * told["speed_max"]
    assert {one["kind"] for one in told["first_violations"]} == {"spacing", "wall_speed"}


def test_a_step_too_fast_for_its_time_is_convicted_by_leg():
    host = session(mode=172, limits=JudgedLimits(acceleration=1e6))
    legs = host.device.target
    host.now -= 1 / 60 - 0.004
    # 8 mm in 4 ms are 2 m/s, in a period 0.48 m/s
    host.send(frame(NEW_POSITION, (*legs[:4], legs[4] + 0.008, legs[5])))
    told = verdict(host)
    assert told["violations_by_leg"]["wall_speed"] == [0, 0, 0, 0, 1, 0]
    assert told["violations_by_kind"]["speed"] == 0
    assert told["wall_speed_max"] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize(("lateness", "too_close"), [(0.0, 0), (0.003, 0), (0.006, 1)])
def test_what_a_network_may_do_is_no_offence_in_wall_time(lateness, too_close):
    told = verdict(at_instants(with_one_late(lateness)))
    assert told["violations"] == 0
    assert told["commands_too_close"] == too_close


@pytest.mark.parametrize(
    "limits", [JudgedLimits(may_lose=True), JudgedLimits(in_wall_time=False)], ids=["wire", "clock"]
)
def test_where_instants_say_nothing_wall_time_is_recorded_without_judging(limits):
    told = verdict(at_instants(with_one_late(1 / 60 - 0.001), limits))
    assert told["violations"] == 0
    assert not told["judged_in_wall_time"]
    assert told["commands_too_close"] == 1


def test_the_same_word_twice_hides_no_step():
    host = session()
    host.play(3.0, swing(0.04, 2 * pi * 0.8))
    last = swing(0.04, 2 * pi * 0.8)(3.0 - 1 / 60)
    for _ in range(3):
        host.now -= 1 / 60 - 0.001
        host.send(frame(NEW_POSITION, last))
    assert by_kind(host).keys() <= {"acceleration"}
    assert verdict(host)["commands_too_close"] == 3
