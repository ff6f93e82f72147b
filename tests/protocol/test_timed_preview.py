"""Previews with an instant for each sample: what is written, refused, and chosen by senders."""

from itertools import pairwise

import pytest
from motion_protocol import (
    MAX_DATAGRAM,
    Cue,
    DriverInputs,
    Motion,
    NotFiniteError,
    Preview,
    ProtocolError,
    TimedPreview,
    decode_cue,
    encode_cue,
    preview_times,
)

STILL = (0.0,) * 6
MOTION = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def cue(preview, **more):
    return Cue(7, 1, 10**9, 10**9, MOTION, preview=preview, **more)


def timed(*times):
    return TimedPreview(times, (STILL,) * len(times))


def test_forty_samples_fit_beside_all_other_blocks_and_a_signature():
    samples = tuple((i + 0.5, 0.25, -1.0, 0.0, i * 0.125, 2.0) for i in range(40))
    preview = TimedPreview(preview_times(4.0), samples)
    key = b"k" * 32
    driver = DriverInputs(0.5, 0.0, 0.0, 0.25, 3)
    packet = encode_cue(cue(preview, driver=driver), key)
    # by the byte tables: header, motion, timed preview, driver inputs, signature
    assert len(packet) == 44 + 48 + (4 + 4 + 26 * 40) + 24 + 16 <= MAX_DATAGRAM
    found = decode_cue(packet, key)
    assert found.preview.samples == samples
    assert found.preview.times == pytest.approx(preview.times, abs=0.5e-4)
    assert found.driver == driver


def test_only_a_packet_with_a_timed_preview_is_of_the_newer_minor_version():
    old = encode_cue(cue(Preview(0.05, 0.05, (STILL,))))
    assert [encode_cue(one)[5] for one in (cue(None), cue(timed(0.1)))] == [0, 1]
    assert old[5] == 0


@pytest.mark.parametrize("times", [(0.0,), (4.0,), (0.0, 1e-4, 4.0)])
def test_the_first_and_the_last_instant_may_be_sent(times):
    assert decode_cue(encode_cue(cue(timed(*times)))).preview.times == pytest.approx(times)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ((0.02, 0.01), "sample 1 at 0.01 s does not come after the one before it at 0.02 s"),
        ((0.1, 0.10004), "0.1 ms apart at least"),
        ((-0.001, 0.1), "sample 0 is at -0.001 s; allowed are increasing times from 0 to 4 s"),
        ((0.1, 4.0001), "sample 1 is at 4.0001 s"),
        ((1e308,), "sample 0 is at 1e.308 s; allowed"),
        ((-1e308,), "sample 0 is at -1e.308 s; allowed"),
    ],
)
def test_instants_that_cannot_be_are_not_written(times, words):
    with pytest.raises(ProtocolError, match=words) as refusal:
        encode_cue(cue(timed(*times)))
    assert (refusal.value.reason, refusal.value.field) == ("field", "timed_preview.times")


@pytest.mark.parametrize("time", [float("nan"), float("inf")])
def test_an_instant_that_is_no_number_is_not_written(time):
    with pytest.raises(NotFiniteError) as refusal:
        encode_cue(cue(timed(0.1, time)))
    assert refusal.value.field == "timed_preview.times[1]"


@pytest.mark.parametrize(
    ("preview", "field"),
    [
        (TimedPreview((0.1, 0.2), (STILL,)), "timed_preview.times"),
        (TimedPreview((), ()), "timed_preview.samples"),
        (timed(*(0.01 * k for k in range(1, 42))), "timed_preview.samples"),
        (TimedPreview((0.1,), ((1e39, 0.0, 0.0, 0.0, 0.0, 0.0),)), "timed_preview.samples"),
        (TimedPreview((0.1,), ((float("nan"), 0.0, 0.0, 0.0, 0.0, 0.0),)), "timed_preview[0].ax"),
    ],
)
def test_samples_that_cannot_be_sent_are_named(preview, field):
    with pytest.raises(ProtocolError) as refusal:
        encode_cue(cue(preview))
    assert refusal.value.field == field


@pytest.mark.parametrize(
    ("horizon", "count", "last"),
    [(0.0, 0, None), (0.009, 0, None), (0.01, 1, 0.01), (0.2, 20, 0.2), (0.4, 40, 0.4),
     (0.41, 40, 0.41), (2.0, 40, 2.0), (4.0, 40, 4.0)],
)  # fmt: skip
def test_chosen_instants_are_close_at_first_and_reach_to_the_end(horizon, count, last):
    times = preview_times(horizon)
    assert len(times) == count
    if count:
        assert times[-1] == pytest.approx(last)
        assert times[: min(20, count)] == pytest.approx(
            [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1,
             0.11, 0.12, 0.13, 0.14, 0.15, 0.16, 0.17, 0.18, 0.19, 0.2][: min(20, count)]
        )  # fmt: skip
        encode_cue(cue(timed(*times)))
    # 1.8 s in 20 steps
    later = [b - a for a, b in pairwise(preview_times(2.0)[19:])]
    assert later == pytest.approx([0.09] * 20)


@pytest.mark.parametrize(("horizon", "count"), [(0.29, 29), (0.57, 40), (0.4, 40), (0.389, 38)])
def test_chosen_instants_do_not_hang_on_rounding(horizon, count):
    times = preview_times(horizon)
    assert len(times) == count
    if horizon <= 0.4:
        assert times == tuple(0.01 * step for step in range(1, count + 1))


@pytest.mark.parametrize("horizon", [-0.1, 4.001, float("nan"), float("inf")])
def test_a_horizon_out_of_range_is_refused(horizon):
    with pytest.raises(ValueError, match="give a time from 0 to 4 s"):
        preview_times(horizon)
