from dataclasses import asdict

import numpy as np
import pytest
from machines import compact
from own_kinematics import lengths

from motionserver.core.device import Feedback, Phase
from motionserver.core.safety.watchdog import CueStatus, DeviceWatch, Patience, SourceWatch
from motionserver.core.state import DriveMode

MS = 1_000_000
ZERO = np.zeros(6)


def watch(period=1 / 60):
    return DeviceWatch(compact(), Patience(), period)


def answer(at_ms, **more):
    return Feedback(at_ms * MS, Phase.UP, "ENGAGED", **more)


def test_before_the_first_answer():
    device = watch()
    assert device.age(5) == float("inf")
    assert device.is_lost(5)
    assert device.current(5) is None
    assert device.valid_for(5) == 0.0
    assert device.legs() is None
    device.excuse(5)
    assert device.is_lost(6)
    assert device.track(5, ZERO, ZERO) is False
    assert device.error == 0.0


@pytest.mark.parametrize(("period", "late_ms"), [(1 / 60, 100), (0.02, 120), (0.05, 300)])
def test_lost_is_older_than_100_ms_and_six_periods(period, late_ms):
    device = watch(period)
    device.answered(answer(1000))
    assert not device.is_lost((1000 + late_ms) * MS)
    assert device.current((1000 + late_ms) * MS) is device.newest
    assert device.current((1000 + late_ms) * MS + 1) is None
    assert device.is_lost((1000 + late_ms) * MS + 1)


def test_validity_begins_anew_after_a_break():
    device = watch()
    for at in (0, 90, 180):
        device.answered(answer(at))
    assert device.valid_for(190 * MS) == pytest.approx(0.19)
    assert device.valid_for(281 * MS) == 0.0
    device.answered(answer(290))
    assert device.valid_for(300 * MS) == pytest.approx(0.01)


def test_an_excuse_holds_once_and_for_one_answer():
    device = watch()
    device.answered(answer(0))
    device.excuse(500 * MS)
    assert not device.is_lost(600 * MS)
    device.excuse(590 * MS)
    assert device.is_lost(601 * MS)
    device.answered(answer(595))
    assert not device.is_lost(650 * MS)
    assert device.valid_for(600 * MS) == pytest.approx(0.6)


def test_a_stall_of_the_guard_is_no_time_of_a_tracking_error():
    device = watch()
    legs = lengths(compact(), ZERO)[0]
    device.excuse(0, 0.3)
    device.answered(answer(0, legs=legs))
    assert not device.track(0, legs + 0.02, ZERO)
    assert not device.track(90 * MS, legs + 0.02, ZERO)
    # nothing was sent for 60 ms: 90 ms of error are known when it goes on
    device.excuse(150 * MS, 0.06)
    assert not device.track(160 * MS, legs + 0.02, ZERO)
    assert device.track(161 * MS, legs + 0.02, ZERO)


def test_tracking_is_by_leg_with_room_for_speed_and_time():
    device = watch()
    legs = lengths(compact(), ZERO)[0]
    device.answered(answer(0, legs=legs))
    wanted = legs + 0.0099
    assert not device.track(0, wanted, ZERO)
    assert device.error == pytest.approx(0.0099)
    far = legs + np.array([0.0, 0.0, 0.012, 0.0, 0.0, 0.0])
    assert not device.track(0, far, ZERO)
    assert not device.track(100 * MS, far, ZERO)
    assert device.track(101 * MS, far, ZERO)
    assert not device.track(102 * MS, far, np.full(6, 0.02))
    assert not device.track(103 * MS, far, ZERO)
    device.forgive()
    assert device.error == 0.0
    assert not device.track(300 * MS, far, ZERO)


def test_a_platform_stands_once_its_legs_have_quivered_no_more_than_2_mm_for_a_while():
    device = watch()
    assert device.stands(0), "nothing is measured"
    device.answered(answer(0, legs=ZERO + 0.002))
    assert not device.stands(299 * MS)
    assert device.stands(300 * MS)
    quiver = np.array([0.0, 0.0, 0.002, 0.0, 0.0, -0.002])
    for at in (90, 180, 270):
        device.answered(answer(at, legs=0.002 + quiver))
    assert device.stands(300 * MS)
    device.answered(answer(310, legs=0.002 + 1.05 * np.abs(quiver)))
    assert not device.stands(609 * MS)
    assert device.stands(610 * MS)


def test_after_a_silence_it_must_stand_anew_and_what_is_not_measured_stands():
    device = watch()
    device.answered(answer(0, legs=ZERO))
    device.answered(answer(500, legs=ZERO))
    assert not device.stands(799 * MS)
    device.answered(answer(900))
    assert device.stands(900 * MS)


def test_the_age_of_an_answer():
    device = watch()
    device.answered(answer(1000))
    assert device.age(1050 * MS) == pytest.approx(0.05)


def test_a_platform_that_is_astray_from_the_first_moment_is_told():
    device = watch()
    device.answered(answer(0, legs=ZERO))
    assert not device.track(0, ZERO + 0.011, ZERO)
    assert device.track(101 * MS, ZERO + 0.011, ZERO)


def test_the_room_for_speed_is_by_leg_and_its_edge_is_allowed():
    device = watch()
    speeds = np.array([0.0, -1.0, 2.0, 0.0, 0.0, 0.0])
    assert device.allowed(speeds).tolist() == pytest.approx([0.01, 0.16, 0.31, 0.01, 0.01, 0.01])
    device.answered(answer(0, legs=ZERO))
    assert not device.track(0, -device.allowed(speeds), speeds)
    assert device.error == pytest.approx(0.31)
    assert not device.track(200 * MS, -device.allowed(speeds), speeds)


def test_legs_are_believed_before_a_pose_and_nothing_is_made_up():
    device = watch()
    device.answered(answer(0, legs=ZERO + 1.2, pose=ZERO))
    assert (device.legs() == 1.2).all()
    device.answered(answer(10))
    assert device.legs() is None


def test_a_pose_is_as_good_as_legs():
    device = watch()
    pose = np.array([0.05, 0.0, 0.02, 0.1, 0.0, 0.1])
    device.answered(answer(0, pose=pose))
    assert device.legs() == pytest.approx(lengths(compact(), pose)[0], abs=1e-12)


def test_a_source_is_stale_by_age_and_no_claim_beats_300_ms():
    assert CueStatus().is_stale(10**15)
    status = CueStatus(1000 * MS, 150 * MS)
    assert not status.is_stale(1150 * MS)
    assert status.is_stale(1150 * MS + 1)
    patient = CueStatus(1000 * MS, 10**15)
    assert not patient.is_stale(1300 * MS)
    assert patient.is_stale(1300 * MS + 1)


def test_a_source_of_which_nothing_came_is_stale_at_once():
    assert CueStatus(0, 150 * MS).is_stale(100 * MS)
    assert CueStatus(5).is_stale(6), "no patience was told"


def test_silence_counts_from_its_beginning_and_ends_with_a_packet():
    source = SourceWatch()
    for at in (100, 300, 500):
        source.update(at * MS, None)
    assert source.silent_for(600 * MS) == 0.5
    source.update(700 * MS, CueStatus(700 * MS, 150 * MS))
    assert source.silent_for(700 * MS) == 0.0
    for at in (851, 900):
        source.update(at * MS, None)
    assert source.silent_for(951 * MS) == 0.1


def test_what_came_just_before_a_gap_is_excused_once_and_what_was_silent_is_not():
    source = SourceWatch()
    source.update(1000 * MS, CueStatus(1000 * MS, 50 * MS))
    # its arrival is told in the tick after the gap only
    source.update(1110 * MS, CueStatus(1010 * MS, 50 * MS), is_excused=True)
    assert source.is_fresh(1160 * MS)
    assert not source.is_fresh(1160 * MS + 1)
    assert source.driving_for(1110 * MS) == pytest.approx(0.11)
    source.update(1150 * MS, None, is_excused=True)
    assert not source.is_fresh(1160 * MS + 1), "once"
    source.update(1170 * MS, None)
    source.update(1180 * MS, CueStatus(1015 * MS, 50 * MS), is_excused=True)
    assert not source.is_fresh(1180 * MS), "it was silent before"
    source.update(1190 * MS, CueStatus(1190 * MS, 50 * MS))
    assert source.is_fresh(1240 * MS)
    never = SourceWatch()
    never.update(1000 * MS, CueStatus(0, 50 * MS), is_excused=True)
    assert not never.is_fresh(1000 * MS)


def fresh_source(until_ms=1000):
    """A source that drives, its newest packet at ``until_ms``, stale 150 ms later."""
    source = SourceWatch()
    for at in range(10, until_ms + 1, 10):
        source.update(at * MS, CueStatus(at * MS, 150 * MS))
    return source


def test_after_a_gap_of_our_own_a_fresh_source_is_waited_for_anew():
    source = fresh_source()
    source.update(1250 * MS, None, True)
    assert source.is_fresh(1400 * MS)
    assert not source.is_fresh(1400 * MS + 1)
    source.update(1390 * MS, None)
    assert source.driving_for(1390 * MS) == pytest.approx(1.38)
    assert source.silent_for(1390 * MS) == 0.0


def test_a_second_gap_does_not_excuse_the_same_packet_again():
    source = fresh_source()
    source.update(1100 * MS, None, True)
    source.update(1200 * MS, None, True)
    assert not source.is_fresh(1251 * MS)


def test_the_next_packet_is_excused_as_the_one_before_was():
    source = fresh_source()
    source.update(1100 * MS, None, True)
    source.update(1110 * MS, CueStatus(1110 * MS, 150 * MS))
    source.update(1350 * MS, None, True)
    assert source.is_fresh(1500 * MS)


def test_a_gap_excuses_no_source_that_was_silent_before():
    source = fresh_source()
    source.update(1160 * MS, None)
    source.update(1250 * MS, None, True)
    assert not source.is_fresh(1250 * MS)
    assert source.silent_for(1260 * MS) == 0.1


def test_a_gap_excuses_no_source_of_which_nothing_ever_came():
    source = SourceWatch()
    source.update(250 * MS, None, True)
    assert not source.is_fresh(250 * MS)


def test_how_long_each_silence_is_borne():
    assert asdict(Patience()) == {
        "valid": 0.3,
        "feedback": 0.1,
        "fresh": 0.5,
        "plans": 3,
        "hold": 2.0,
        "pause": 600.0,
        "silence": 30.0,
        "raising": 20.0,
        "lowering": 10.0,
        "gap": 0.3,
        "reset": 2.0,
        "track": 0.010,
        "track_lag": 0.15,
        "track_time": 0.1,
        "still": 0.3,
        "quiver": 0.002,
        "sound": 1.0,
        "spared": 8.0,
    }


def test_a_source_drives_or_is_silent():
    source = SourceWatch()
    assert (source.driving_for(0), source.silent_for(0)) == (0.0, 0.0)
    source.update(0, None)
    assert source.silent_for(500 * MS) == 0.5
    for at in range(1000, 2000, 10):
        source.update(at * MS, CueStatus(at * MS, 150 * MS))
    assert source.driving_for(1990 * MS) == pytest.approx(0.99)
    assert source.silent_for(1990 * MS) == 0.0
    assert source.is_fresh(1990 * MS)
    for mode in (DriveMode.PAUSE, DriveMode.BYE):
        source.update(2000 * MS, CueStatus(2000 * MS, 150 * MS, mode))
        assert source.driving_for(2000 * MS) == 0.0
        assert source.is_paused is (mode is DriveMode.PAUSE)
    source.update(2010 * MS, CueStatus(2010 * MS, 150 * MS, DriveMode.TELEPORT))
    source.update(2100 * MS, None)
    assert source.driving_for(2100 * MS) == pytest.approx(0.09)
    source.update(2161 * MS, None)
    assert source.driving_for(2161 * MS) == 0.0
    assert not source.is_fresh(2161 * MS)


def test_answers_are_sound_from_the_first_without_a_fault_until_they_are_missing():
    watch = DeviceWatch(compact(), Patience(), 1 / 60)
    assert watch.sound_for(0) == 0.0
    for ms, faults in ((1000, ("bus",)), (1050, ()), (1100, ())):
        watch.answered(Feedback(ms * MS, Phase.UP, "UP", faults=faults))
    assert watch.sound_for(1150 * MS) == pytest.approx(0.1)
    assert watch.sound_for(1201 * MS) == 0.0
    watch.answered(Feedback(1300 * MS, Phase.UP, "UP"))
    assert watch.sound_for(1350 * MS) == pytest.approx(0.05)


@pytest.mark.parametrize(
    "unsound",
    [{"faults": ("bus",)}, {"estop": True}, {"phase": Phase.FAULTED}, {"phase": Phase.DISABLED}],
)
def test_a_fault_or_an_open_stop_is_unsound_for_as_long_as_it_is_answered(unsound):
    watch = DeviceWatch(compact(), Patience(), 1 / 60)
    watch.answered(Feedback(1000 * MS, Phase.UP, "UP"))
    assert watch.sound_for(1020 * MS) == pytest.approx(0.02)
    watch.answered(Feedback(1050 * MS, **({"phase": Phase.UP, "state": "UP"} | unsound)))
    assert watch.sound_for(1060 * MS) == 0.0
    watch.answered(Feedback(1080 * MS, Phase.UP, "UP"))
    assert watch.sound_for(1090 * MS) == pytest.approx(0.01)


def test_before_the_planner_has_reported_nothing_is_known_of_the_source():
    status = CueStatus()
    assert (status.newest_ns, status.heard_ns, status.looked_ns) == (0, 0, 0)
    assert (status.mode, status.trouble) == (DriveMode.DRIVE, "")


def test_when_the_planner_looked_is_no_news_of_the_source():
    assert CueStatus(5, 7, looked_ns=1) == CueStatus(5, 7, looked_ns=2)
    assert CueStatus(5, 7, heard_ns=1) != CueStatus(5, 7, heard_ns=2)


def test_an_excuse_that_tells_of_no_stall_moves_no_tracking_error():
    device = watch()
    device.answered(answer(1000, legs=ZERO + 0.02))
    assert not device.track(1000 * MS, ZERO, ZERO)
    device.excuse(1050 * MS)
    assert not device.track(1100 * MS, ZERO, ZERO)
    assert device.track(1101 * MS, ZERO, ZERO)
