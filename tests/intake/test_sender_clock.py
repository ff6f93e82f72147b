"""A sender's clock is evidence, not truth: drift, steps and rates, in virtual time."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.intake.sender_clock import SenderClock

MS = 1_000_000
SECOND = 1000 * MS


class Listener:
    """A clock with the patience that a gate would have with packets of this interval [ms]."""

    def __init__(self, interval: int = 10) -> None:
        self.clock = SenderClock()
        self._interval = max(5, interval) * MS
        self.late: list[int] = []
        self.longest = 0
        self._accepted: int | None = None

    def hear(self, arrival: int, stamp: int) -> bool:
        limit = max(50 * MS, 3 * self._interval)
        if self.clock.is_late(arrival, stamp, self._interval, limit):
            self.late.append(arrival)
            return True
        if self._accepted is not None:
            self.longest = max(self.longest, arrival - self._accepted)
        self._accepted = arrival
        return False


def queued(sent: list[int], delays: list[int]) -> list[int]:
    """Arrivals of a way that keeps the order."""
    out: list[int] = []
    for at, delay in zip(sent, delays, strict=True):
        out.append(max(at + delay, out[-1] if out else 0))
    return out


@settings(max_examples=60, deadline=None)
@given(
    ppm=st.integers(-2000, 2000),
    interval=st.sampled_from([4, 10, 16, 20, 33]),
    jitter=st.integers(0, 20),
    step_at=st.integers(0, 280),
    step=st.one_of(
        st.sampled_from([-200 * MS, 200 * MS, 3600 * SECOND, -3600 * SECOND, 0]),
        st.integers(-10 * SECOND, 10 * SECOND),
    ),
    noise=st.randoms(use_true_random=False),
)
def test_a_clock_that_drifts_or_was_set_costs_no_more_than_a_few_packets(
    ppm, interval, jitter, step_at, step, noise
):
    sent = [SECOND + k * interval * MS for k in range(300)]
    arrivals = queued(sent, [noise.randrange(jitter * MS + 1) for _ in sent])
    listener = Listener(interval)
    for k, (at, arrival) in enumerate(zip(sent, arrivals, strict=True)):
        stamp = 10**15 + at + at * ppm // 1_000_000 + (step if k >= step_at else 0)
        listener.hear(arrival, stamp)
    assert len(listener.late) <= 4
    assert not listener.clock.complaint


@pytest.mark.parametrize("ppm", [-10_000, -2000, -500, -200, 200, 500, 2000, 10_000])
def test_drift_is_followed_for_ten_minutes(ppm):
    listener = Listener()
    for k in range(60_000):
        at = k * 10 * MS
        listener.hear(at + 5 * MS, at + at * ppm // 1_000_000)
    assert listener.late == []
    assert not listener.clock.complaint


@pytest.mark.parametrize("step", [-200 * MS, 3600 * SECOND, 200 * MS, -3600 * SECOND, -70 * MS])
def test_a_step_is_learnt_at_once(step):
    listener = Listener()
    for k in range(500):
        listener.hear(10 * k * MS, 10 * k * MS + 7 * SECOND + (step if k >= 300 else 0))
    assert len(listener.late) <= 1
    assert listener.longest <= 20 * MS


@pytest.mark.parametrize("ahead", [200 * MS, SECOND, 3600 * SECOND, 1 << 63])
def test_one_stamp_far_ahead_blinds_nobody(ahead):
    listener = Listener()
    for k in range(500):
        listener.hear(10 * k * MS, 10 * k * MS + (ahead if k == 300 else 0))
    assert len(listener.late) <= 1
    assert listener.longest <= 20 * MS


@pytest.mark.parametrize("behind", [200 * MS, SECOND, 3600 * SECOND])
def test_one_stamp_far_behind_is_old_and_the_next_is_not(behind):
    listener = Listener()
    for k in range(500):
        listener.hear(10 * k * MS, 10 * k * MS - (behind if k == 300 else 0))
    assert listener.late == [3000 * MS]


def test_after_a_step_a_burst_is_still_refused():
    """What is learnt must not cost the judgement it is for."""
    listener = Listener()
    for k in range(300):
        listener.hear(10 * k * MS, 10 * k * MS - (200 * MS if k > 100 else 0))
    for k in range(300, 340):
        listener.hear(3400 * MS, 10 * k * MS - 200 * MS)
    assert 30 <= len(listener.late) <= 36
    assert not listener.hear(3410 * MS, 3410 * MS - 200 * MS)


@settings(max_examples=60, deadline=None)
@given(
    ppm=st.integers(-2000, 2000),
    interval=st.sampled_from([4, 10, 16, 20]),
    jitter=st.integers(0, 10),
    stall=st.integers(150, 1900),
    drain=st.sampled_from([0, 1, 2]),
    noise=st.randoms(use_true_random=False),
)
def test_packets_that_were_really_delayed_beyond_the_limit_are_refused(
    ppm, interval, jitter, stall, drain, noise
):
    """A way that stands still for a while, then delivers all it held, at once or quickly."""
    sent = [k * interval * MS for k in range(4500 // interval)]
    begin = 2 * SECOND
    opens = begin + stall * MS
    arrivals: list[int] = []
    for at in sent:
        arrival = at + 2 * MS + noise.randrange(jitter * MS + 1)
        if begin <= arrival < opens:
            arrival = opens
        least = arrivals[-1] + drain * MS if arrivals and arrivals[-1] >= opens else 0
        arrivals.append(max(arrival, arrivals[-1] if arrivals else 0, least))
    listener = Listener(interval)
    for at, arrival in zip(sent, arrivals, strict=True):
        refused = listener.hear(arrival, at + at * ppm // 1_000_000)
        delay = arrival - at
        if delay > 60 * MS + (jitter + 2 * interval) * MS + stall * MS // 50:
            assert refused, (arrival, delay)
        if delay < 40 * MS:
            assert not refused, (arrival, delay)


def test_a_way_that_became_longer_for_good_is_learnt_after_a_few_packets():
    listener = Listener()
    for k in range(300):
        listener.hear(10 * k * MS, 10 * k * MS)
    for k in range(300, 400):
        listener.hear(10 * k * MS + 400 * MS, 10 * k * MS)
    assert len(listener.late) <= 4


def test_a_longer_way_is_learnt_in_spite_of_loss():
    listener = Listener()
    for k in range(300):
        listener.hear(10 * k * MS, 10 * k * MS)
    for k in range(300, 500):
        if k % 3:
            listener.hear(10 * k * MS + 400 * MS, 10 * k * MS)
    assert len(listener.late) <= 4


def ticks(rate_num, rate_den, seconds=6, interval=10):
    listener = Listener(interval)
    found = []
    for k in range(seconds * 1000 // interval):
        at = k * interval * MS
        listener.hear(at + 3 * MS, 77 + at * rate_num // rate_den)
        found.append(listener.clock.complaint)
    return listener, found


@pytest.mark.parametrize(
    ("num", "den", "said"),
    [
        (0, 1, "does not advance, it is 77 in every packet"),
        (1, 1000, "is it in microseconds?"),
        (1, 1_000_000, "is it in milliseconds?"),
        (1, 1_000_000_000, "is it in seconds?"),
        (1000, 1, "is it in picoseconds?"),
        (1, 2, "runs at 0.5 times the rate of time."),
        (3, 2, "runs at 1.5 times the rate of time."),
        (-1, 1, "went backwards"),
    ],
)
@pytest.mark.parametrize("interval", [5, 10, 50, 100])
def test_a_stamp_that_is_no_clock_is_named_and_costs_nothing(num, den, said, interval):
    listener, found = ticks(num, den, interval=interval)
    assert said in found[-1], found[-1]
    assert listener.late == []
    assert next(k for k, text in enumerate(found) if text) * interval <= 3000


def test_a_clock_that_is_given_up_in_the_midst_is_named_for_what_it_became():
    listener = Listener()
    found = set()
    for k in range(900):
        listener.hear(10 * k * MS, 0 if k > 350 else 10**15 + 10 * k * MS)
        found.add(listener.clock.complaint)
    assert len(found) == 2
    assert "does not advance, it is 0" in max(found)
    assert len(listener.late) <= 1


def test_garbage_is_named_and_costs_nothing():
    noise = random.Random(4)
    listener = Listener()
    for k in range(600):
        listener.hear(10 * k * MS, noise.randrange(1 << 64))
    assert "went backwards" in listener.clock.complaint
    assert listener.longest <= 20 * MS, "never two in a row are refused"
    assert max(listener.late) < 3000 * MS


def test_a_stamp_that_begins_to_advance_is_used_again():
    listener = Listener()
    for k in range(1000):
        listener.hear(10 * k * MS, 0 if k < 500 else 10 * k * MS)
    assert not listener.clock.complaint
    for k in range(1000, 1040):
        listener.hear(10_400 * MS, 10 * k * MS)
    assert len(listener.late) >= 30


def test_stalls_and_bursts_are_no_fault_of_the_stamp():
    """One second stands the way, one second it delivers: both are no rate of the clock."""
    listener = Listener()
    for k in range(2000):
        at = 10 * k * MS
        stalls = at > 3 * SECOND and (at // SECOND) % 2 == 1
        listener.hear((at // SECOND + 1) * SECOND if stalls else at, at)
        assert not listener.clock.complaint


def test_only_a_usable_stamp_tells_old_from_new():
    clock = SenderClock()
    assert clock.is_older(None) is None
    assert clock.is_older(5) is None
    clock.is_late(0, 10, 10 * MS, 50 * MS)
    assert clock.is_older(9) is True
    assert clock.is_older(10) is False
    assert clock.is_older(None) is None
    for k in range(400):
        clock.is_late(10 * k * MS, 10, 10 * MS, 50 * MS)
    assert clock.is_older(9) is None
