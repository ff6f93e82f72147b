"""The numbers of the intake, what it counts, and how it begins anew after a jump."""

import numpy as np
import pytest
from motions import motion

from motionserver.core.axes import GRAVITY, frozen
from motionserver.core.intake.intake import Head, Intake
from motionserver.core.state import DriveMode, Preview

PERIOD = 0.005
SEAT = Head(frozen(np.zeros(3)), 1.0)
ABOVE = Head(frozen([0.0, 0.0, 1.0]), 1.0)


def driving(*packets, periods=1, head=SEAT):
    """An intake at full gain and its last stimulus after these packets, some periods each."""
    intake = Intake(gain=1.0)
    for packet in packets:
        intake.offer(packet)
        for _ in range(periods):
            stimulus = intake.stimulus(head, PERIOD, True)
    return intake, stimulus


def test_the_documented_limits_of_a_wish():
    wild = motion(force=(98.0, -98.0, GRAVITY), rates=(60.0, -60.0, 0.0))
    _, stimulus = driving(wild, periods=20)
    assert stimulus.force == pytest.approx([3.0 * 9.81, -3.0 * 9.81, 0.0], rel=1e-12)
    assert stimulus.rates == pytest.approx([np.radians(200.0), -np.radians(200.0), 0.0], rel=1e-12)


def test_the_force_changes_by_two_thousand_a_second():
    _, stimulus = driving(motion(0.0), motion(5.0, x=29.0))
    assert stimulus.force[0] == pytest.approx(10.0, rel=1e-12)


@pytest.mark.parametrize(
    ("force", "rates", "cut"),
    [
        ((1.0, 2.0, GRAVITY), (0.1, 0.2, 0.3), 0),
        ((1.0, 50.0, GRAVITY), (0.1, 0.2, 0.3), 4),
        ((1.0, 2.0, GRAVITY), (0.1, 5.0, 0.3), 4),
        ((1.0, 50.0, GRAVITY), (0.1, 5.0, 0.3), 4),
    ],
    ids=["nothing", "force", "rates", "both"],
)
def test_every_period_whose_wish_is_cut_is_counted_once(force, rates, cut):
    intake, _ = driving(motion(force=force, rates=rates), periods=4)
    assert intake.clipped == cut


def test_a_first_packet_that_pauses_asks_for_nothing():
    _, stimulus = driving(motion(mode=DriveMode.PAUSE, rates=(1.0, 1.0, 1.0)))
    assert stimulus.force.tolist() == stimulus.rates.tolist() == [0.0, 0.0, 0.0]


def test_the_newest_packet_is_kept():
    last = motion(10.0)
    intake, _ = driving(motion(0.0), last)
    assert intake.newest is last


@pytest.mark.parametrize(
    ("last_ms", "now_ms", "gained", "is_jump"),
    [
        (100.0, 100.0, 2.0, False),
        (100.0, 100.0, np.nextafter(2.0, 3.0), True),
        (100.0, 100.0, -2.01, True),
        (100.0, 90.0, 2.0, False),
        (1000.0, 1100.0, 4.9, False),
        (1000.0, 1100.0, 5.0, True),
        (1000.0, 1500.0, 10.0, False),
    ],
)
def test_a_jump_is_2_m_s_beyond_what_3_g_can_do_since_the_last_packet(
    last_ms, now_ms, gained, is_jump
):
    intake, _ = driving(motion(last_ms, speed=0.0), motion(now_ms, speed=gained))
    assert intake.teleports == int(is_jump)


def test_the_rates_before_a_jump_and_after_it_make_no_spin():
    intake = Intake(gain=0.0)
    intake.offer(motion(0.0))
    intake.stimulus(ABOVE, PERIOD, False)
    intake.offer(motion(5.0, rates=(0.0, 1.0, 0.0), speed=50.0))
    for _ in range(10):
        stimulus = intake.stimulus(ABOVE, PERIOD, True)
    assert stimulus.gain > 0.0
    assert stimulus.force[0] == pytest.approx(0.0, abs=1e-12)


def test_after_a_jump_the_new_force_is_there_at_once():
    intake = Intake(gain=0.0)
    intake.offer(motion(0.0, x=-25.0))
    for _ in range(10):
        intake.stimulus(SEAT, PERIOD, False)
    intake.offer(motion(50.0, x=25.0, speed=50.0))
    intake.stimulus(SEAT, PERIOD, False)
    stimulus = intake.stimulus(SEAT, PERIOD, True)
    assert stimulus.force[0] == pytest.approx(stimulus.gain * 25.0)


def ahead(rates):
    times = 0.1 * np.arange(1, len(rates) + 1)
    force = np.tile([0.0, 0.0, GRAVITY], (len(rates), 1))
    return Preview(frozen(times), frozen(force), frozen([[0.0, q, 0.0] for q in rates]))


def test_two_samples_ahead_are_enough_to_see_the_head_turn():
    _, stimulus = driving(motion(preview=ahead([0.0, 0.1])), head=ABOVE)
    assert stimulus.preview.force[:, 0] == pytest.approx([1.0, 1.0])


def test_one_sample_ahead_turns_nothing():
    _, stimulus = driving(motion(preview=ahead([0.1])), head=ABOVE)
    assert stimulus.preview.force[0] == pytest.approx([0.0, 0.0, -0.01])
