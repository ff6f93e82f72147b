"""From the newest packet to a stimulus."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import motion, preview

from motionserver.core.axes import GRAVITY, frozen
from motionserver.core.intake.gate import Gate
from motionserver.core.intake.intake import FORCE_MAX, RATE_MAX, SLEW, Head, Intake
from motionserver.core.state import STILL, DriveMode, Preview, Stimulus, VehicleMotion

PERIOD = 1 / 60
STEP_MS = 1e3 * PERIOD
SEAT = Head(frozen(np.zeros(3)), 1.0)


def periods(intake: Intake, count: int, *, wanted: bool = True, head: Head = SEAT) -> Stimulus:
    for _ in range(count):
        stimulus = intake.stimulus(head, PERIOD, wanted)
    return stimulus


def full(x: float = 2.0, **more: object) -> Intake:
    """An intake whose gain is 1, driving."""
    intake = Intake(gain=1.0)
    intake.offer(motion(0, x=x, **more))  # type: ignore[arg-type]
    periods(intake, 5)
    return intake


def test_before_the_first_packet_it_is_still() -> None:
    intake = Intake()
    assert intake.stimulus(SEAT, PERIOD, True) is STILL
    assert intake.newest is None


def test_a_drive_fades_in_over_a_second() -> None:
    intake = Intake()
    intake.offer(motion(x=2.0))
    gains = [intake.stimulus(SEAT, PERIOD, True).gain for _ in range(70)]
    assert gains[0] == pytest.approx(PERIOD)
    assert gains[29] == pytest.approx(0.5)
    assert gains[59] == pytest.approx(1.0)
    assert periods(intake, 1).force == pytest.approx([2.0, 0.0, 0.0])


@pytest.mark.parametrize("why", ["not wanted", "pause", "bye"])
def test_it_fades_out_in_three_tenths_and_holds_what_was_felt(why: str) -> None:
    intake = full()
    if why != "not wanted":
        mode = DriveMode.PAUSE if why == "pause" else DriveMode.BYE
        intake.offer(motion(10, mode=mode))
    forces = [periods(intake, 1, wanted=why != "not wanted").force[0] for _ in range(20)]
    assert forces[8] == pytest.approx(2.0 * (1 - 9 * PERIOD / 0.3))
    assert forces[17] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(forces) <= 1e-9)


def test_scale_is_a_share_of_force_and_rates() -> None:
    intake = full(rates=(0.1, 0.0, -0.2))
    stimulus = intake.stimulus(Head(SEAT.arm, 0.25), PERIOD, True)
    assert stimulus.force == pytest.approx([0.5, 0.0, 0.0])
    assert stimulus.rates == pytest.approx([0.025, 0.0, -0.05])
    assert stimulus.gain == 1.0


def test_the_force_is_cut_to_three_g_and_the_rates_to_200_degrees() -> None:
    intake = full(force=(50.0, -50.0, GRAVITY + 40.0), rates=(5.0, -5.0, 1.0))
    stimulus = periods(intake, 3)
    assert stimulus.force == pytest.approx([FORCE_MAX, -FORCE_MAX, FORCE_MAX])
    assert stimulus.rates == pytest.approx([RATE_MAX, -RATE_MAX, 1.0])
    assert intake.clipped > 0


def test_a_spike_moves_the_force_no_faster_than_the_slew() -> None:
    intake = full(x=0.0)
    intake.offer(motion(20, x=29.0))
    stimulus = intake.stimulus(SEAT, 0.005, True)
    assert stimulus.force[0] == pytest.approx(SLEW * 0.005)


@pytest.mark.parametrize(
    ("omega_dot", "arm", "expected"),
    [
        ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    ],
)
@pytest.mark.parametrize("every", [1, 2, 3])
def test_turning_accelerates_the_head(
    omega_dot: tuple[float, ...], arm: tuple[float, ...], expected: tuple[float, ...], every: int
) -> None:
    # omega' x r; whether packets come every period or every third makes no difference
    intake, head = Intake(gain=1.0), Head(frozen(arm), 1.0)
    for k in range(2, 40):
        if k % every == 0:
            rates = tuple(PERIOD * (k - 12) * w for w in omega_dot)
            intake.offer(motion(STEP_MS * k, rates=rates))  # type: ignore[arg-type]
        stimulus = intake.stimulus(head, PERIOD, True)
        if k == 12:
            assert stimulus.force == pytest.approx(np.array(expected), abs=1e-4)


def test_turning_steadily_pulls_the_head_inwards() -> None:
    intake = Intake(gain=1.0)
    for k in range(5):
        intake.offer(motion(STEP_MS * k, rates=(0.0, 0.0, 0.5)))
        stimulus = intake.stimulus(Head(frozen([2.0, 0.0, 1.0]), 1.0), PERIOD, True)
    assert stimulus.force == pytest.approx([-0.5, 0.0, 0.0])


def test_the_first_packet_and_the_first_after_a_pause_turn_nothing() -> None:
    intake, head = Intake(gain=1.0), Head(frozen([0.0, 0.0, 1.0]), 1.0)
    intake.offer(motion(0, rates=(0.0, 1.0, 0.0)))
    assert intake.stimulus(head, PERIOD, True).force == pytest.approx([0.0, 0.0, -1.0])
    intake.offer(motion(20, mode=DriveMode.PAUSE))
    intake.stimulus(head, PERIOD, True)
    intake.offer(motion(40, rates=(0.0, 1.0, 0.0)))
    assert intake.stimulus(head, PERIOD, True).force[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("how", ["said", "seen"])
def test_a_teleport_fades_out_holds_and_begins_anew(how: str) -> None:
    intake = full(speed=20.0)
    mode = DriveMode.TELEPORT if how == "said" else DriveMode.DRIVE
    intake.offer(motion(10, x=-3.0, speed=20.0 if how == "said" else 0.0, mode=mode))
    assert intake.teleports == 1
    speed = 20.0 if how == "said" else 0.0
    forces = []
    for k in range(90):
        intake.offer(motion(20 + 16 * k, x=-3.0, speed=speed))
        stimulus = periods(intake, 1)
        forces.append(stimulus.force[0])
        assert stimulus.preview is None
    assert forces[0] == pytest.approx(2.0 * (1 - PERIOD / 0.3))
    assert min(forces[:17]) >= 0.0
    assert forces[17] == pytest.approx(0.0, abs=1e-9)
    assert forces[-1] == pytest.approx(-3.0)
    assert np.max(np.abs(np.diff(forces))) < 0.13


def test_braking_hard_is_no_teleport() -> None:
    intake = full(speed=20.0)
    intake.offer(motion(100, x=-9.0, speed=19.1))
    assert intake.teleports == 0


def test_a_preview_is_scaled_and_seen_from_the_head() -> None:
    intake = Intake(gain=1.0)
    ahead = Preview(
        frozen([0.1, 0.2, 0.3]),
        frozen(np.tile([1.0, 0.0, GRAVITY], (3, 1))),
        frozen([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.2, 0.0]]),
    )
    intake.offer(motion(preview=ahead))
    stimulus = intake.stimulus(Head(frozen([0.0, 0.0, 1.0]), 0.5), PERIOD, True)
    assert stimulus.preview is not None
    # omega' = 1 rad/s2 about y, one metre up: +1 m/s2 forward
    assert stimulus.preview.force[:, 0] == pytest.approx([1.0, 1.0, 1.0])
    assert stimulus.preview.force[:, 2] == pytest.approx([0.0, -0.005, -0.02])
    assert stimulus.preview.rates[:, 1] == pytest.approx([0.0, 0.05, 0.1])


def test_a_preview_of_one_sample_is_cut_like_the_rest() -> None:
    intake = Intake(gain=1.0)
    intake.offer(motion(preview=preview([0.1], x=80.0, rate=60.0)))
    stimulus = intake.stimulus(SEAT, PERIOD, True)
    assert stimulus.preview is not None
    assert stimulus.preview.force[0] == pytest.approx([FORCE_MAX, 0.0, 0.0])
    assert stimulus.preview.rates[0] == pytest.approx([RATE_MAX, 0.0, 0.0])


anything = st.floats(width=32)
three = st.tuples(anything, anything, anything)
mild = st.tuples(*[st.floats(-120.0, 120.0)] * 3)


@st.composite
def packets(draw: st.DrawFn) -> VehicleMotion:
    ahead = None
    if draw(st.booleans()):
        count = draw(st.integers(1, 4))
        times = draw(st.lists(anything, min_size=count, max_size=count))
        rows = st.lists(three | mild, min_size=count, max_size=count)
        ahead = Preview(frozen(times), frozen(draw(rows)), frozen(draw(rows)))
    return motion(
        draw(st.floats(0.0, 5000.0)),
        draw(st.none() | st.integers(0, 0xFFFFFFFF)),
        force=draw(three | mild),
        rates=draw(three | mild),
        sent_ms=draw(st.none() | st.floats(0.0, 1e6)),
        session=draw(st.integers(0, 2)),
        speed=draw(anything),
        mode=draw(st.sampled_from(DriveMode)),
        preview=ahead,
    )


@given(
    st.lists(st.tuples(packets(), st.booleans(), st.sampled_from("ab")), max_size=25),
    st.floats(0.005, 0.02),
    st.tuples(*[st.floats(-10.0, 10.0)] * 3),
)
def test_whatever_arrives_the_stimulus_is_finite_and_bounded(
    arrivals: list[tuple[VehicleMotion, bool, str]], period: float, arm: tuple[float, ...]
) -> None:
    gate, intake, head = Gate(), Intake(), Head(frozen(arm), 1.0)
    last = np.zeros(3)
    gain = 0.0
    for packet, wanted, address in sorted(arrivals, key=lambda a: a[0].arrival_ns):
        if gate.refuse("native", address, packet) is None:
            intake.offer(packet)
        stimulus = intake.stimulus(head, period, wanted)
        assert 0.0 <= stimulus.gain <= 1.0
        assert abs(stimulus.gain - gain) <= period / 0.3 + 1e-12
        assert np.all(np.abs(stimulus.force) <= FORCE_MAX)
        assert np.all(np.abs(stimulus.rates) <= RATE_MAX)
        bound = SLEW * period + FORCE_MAX * abs(stimulus.gain - gain) + 1e-9
        assert np.all(np.abs(stimulus.force - last) <= bound)
        if stimulus.preview is not None:
            assert np.all(np.abs(stimulus.preview.force) <= FORCE_MAX)
            assert np.all(np.abs(stimulus.preview.rates) <= RATE_MAX)
        last, gain = stimulus.force, stimulus.gain
