"""Believed packets from planner to recorder: whole, in order, on an even clock."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_clients import read_recording

from motionserver.core.axes import frozen
from motionserver.core.state import DriveMode, Driver, Preview, VehicleMotion
from motionserver.telemetry.blackbox.history import History
from motionserver.telemetry.cue_clock import CueClock
from motionserver.telemetry.cue_history import (
    CUE_BYTES,
    MOST_AHEAD,
    CueNotes,
    CueReader,
    pack_cue,
    unpack_cue,
)
from motionserver.telemetry.cue_rows import cue_row
from motionserver.telemetry.recorded import CUE, columns

MS = 1_000_000
NUMBERS = st.floats(-90.0, 90.0)
THREE = st.tuples(NUMBERS, NUMBERS, NUMBERS)


@st.composite
def packets(draw):
    ahead = draw(st.lists(st.tuples(THREE, THREE), max_size=5))
    preview = None
    if ahead:
        times = frozen(0.05 * np.arange(1, len(ahead) + 1))
        preview = Preview(times, frozen([a for a, _ in ahead]), frozen([r for _, r in ahead]))
    pedal = st.floats(0.0, 1.0)
    driver = draw(st.none() | st.builds(Driver, pedal, pedal, pedal, NUMBERS, st.integers(-1, 9)))
    whole = st.integers(0, 2**62)
    return VehicleMotion(
        draw(whole), draw(st.integers(0, 2**32 - 1)), draw(st.none() | whole),
        draw(st.none() | whole), frozen(draw(THREE)), frozen(draw(THREE)), draw(NUMBERS),
        draw(st.sampled_from(DriveMode)), False, preview, driver, draw(whole),
        draw(st.none() | st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))),
    )  # fmt: skip


def plain(motion):
    ahead = motion.preview
    told = None if ahead is None else [t.tolist() for t in (ahead.times, ahead.force, ahead.rates)]
    return (
        motion.arrival_ns, motion.session, motion.sequence, motion.sender_ns,
        motion.force.tolist(), motion.rates.tolist(), motion.speed, motion.mode, told,
        motion.driver, motion.sim_time_ns, motion.attitude,
    )  # fmt: skip


@given(packets())
def test_packet_comes_out_as_it_went_in(motion):
    data = pack_cue(motion)
    assert len(data) <= CUE_BYTES
    assert plain(unpack_cue(data)) == plain(motion)


@given(packets())
def test_row_of_a_packet_reads_back_as_a_sample(tmp_path_factory, motion):
    path = tmp_path_factory.mktemp("row") / "drive.csv"
    blank = [""] * (len(columns([])) - len(CUE) - 1)
    blank[:2] = "0.0", ""
    rows = [[*blank, *cue_row(t, motion), ""] for t in (1.0, 2.0)]
    path.write_text("\n".join(",".join(row) for row in [columns([]), *rows]) + "\n")
    sample = read_recording(path).samples[1]
    roll, pitch = motion.attitude or (0.0, 0.0)
    # specific force at rest by hand: nose down turns gravity backwards, left side up to the left
    up = np.cos(pitch) * np.array([0.0, np.sin(roll), np.cos(roll)])
    gravity = 9.81 * (up - np.array([np.sin(pitch), 0.0, 0.0]))
    assert np.array(sample.acceleration) + gravity == pytest.approx(motion.force, abs=2e-6)
    assert sample.rates == pytest.approx(motion.rates, abs=1e-7)
    assert (int(sample.mode), sample.attitude) == (
        motion.mode, pytest.approx((roll, pitch), abs=1e-7),
    )  # fmt: skip
    assert (sample.driver is None) == (motion.driver is None)
    if motion.driver is not None:
        assert sample.driver.steering == pytest.approx(motion.driver.steering, rel=1e-4)
        assert sample.driver.gear == motion.driver.gear
    count = 0 if motion.preview is None else len(motion.preview.times)
    assert len(sample.preview) == count
    if count:
        last = np.array(sample.preview[-1].acceleration) + gravity
        assert last == pytest.approx(motion.preview.force[-1], abs=2e-2, rel=1e-4)


@pytest.mark.parametrize("data", [b"", b"x", b"\xff" * 150])
def test_other_bytes_are_no_packet(data):
    with pytest.raises(ValueError, match="not a packet"):
        unpack_cue(data)


def heard(at_ms, sent_ms, session=1, sequence=0, **more):
    return VehicleMotion(
        round(at_ms * MS), session, sequence, None if sent_ms is None else round(sent_ms * MS),
        frozen([0.0, 0.0, 9.81]), frozen(np.zeros(3)), **more,
    )  # fmt: skip


def test_reader_gets_each_packet_once_and_counts_those_it_missed(tmp_path: Path):
    History.create(tmp_path / "cues.map", CUE_BYTES, 8).close()
    notes = CueNotes(tmp_path)
    notes.note([heard(1, 1)])
    reader = CueReader(tmp_path)
    assert [one.arrival_ns for one in reader.kept] == [1 * MS]
    assert reader.new() == []
    notes.note([heard(2, 2), heard(3, 3)])
    assert [one.arrival_ns for one in reader.new()] == [2 * MS, 3 * MS]
    notes.note([heard(t, t) for t in range(4, 24)])
    assert [one.arrival_ns for one in reader.new()] == [t * MS for t in range(16, 24)]
    assert reader.missed == 12


def test_a_long_preview_is_cut_and_a_strange_field_costs_its_packet_only(tmp_path: Path):
    History.create(tmp_path / "cues.map", CUE_BYTES, 8).close()
    notes, reader = CueNotes(tmp_path), CueReader(tmp_path)
    table = frozen(np.zeros((200, 3)))
    long = Preview(frozen(np.arange(200.0)), table, table)
    notes.note([heard(1, 1, preview=long), heard(2, 2, speed="fast"), heard(3, 3)])
    first, last = reader.new()
    assert len(first.preview.times) == MOST_AHEAD
    assert last.arrival_ns == 3 * MS
    assert notes.unreadable == 1
    # without a history nothing is noted, and nothing fails
    CueNotes(tmp_path / "none").note([heard(1, 1)])
    assert CueReader(tmp_path / "none").new() == []


def looked_at(count, period_ms, look_ms, way_ms, session=1, start=0.0):
    """Packets sent evenly, stamped when a slower reader looks; the sender's clock is 5 s behind."""
    out = []
    for k in range(count):
        sent = start + k * period_ms
        arrived = np.ceil((sent + way_ms) / look_ms) * look_ms
        out.append(heard(arrived, sent - 5000.0 + 10000.0, session, k))
    return out


def test_times_are_even_though_packets_are_read_in_pairs():
    clock = CueClock()
    timed = [t for t, _ in clock.timed(looked_at(300, 10.0, 16.9, 0.4))]
    assert len(timed) == 300
    assert np.diff(timed) == pytest.approx(10 * MS, abs=1)
    assert timed[0] == pytest.approx(0.4 * MS, abs=1.0 * MS)


def test_first_packets_wait_until_the_delay_is_known_and_the_last_are_not_lost():
    clock = CueClock()
    packets = looked_at(30, 10.0, 1000.0 / 60.0, 0.4)
    assert clock.timed(packets) == []
    assert len(clock.flush()) == 30
    known = CueClock(looked_at(300, 10.0, 1000.0 / 60.0, 0.4))
    later = looked_at(310, 10.0, 1000.0 / 60.0, 0.4)[300:]
    assert len(known.timed(later)) == 10


def test_another_sender_and_one_without_a_clock_have_increasing_times():
    clock = CueClock()
    first = looked_at(100, 10.0, 16.0, 0.4)
    second = looked_at(100, 10.0, 16.0, 0.4, session=2, start=1000.0)
    third = [heard(2100.0 + 16.0 * (k // 2), None, 3) for k in range(10)]
    timed = clock.timed([*first, *second, *third]) + clock.flush()
    assert [p.session for _, p in timed] == [1] * 100 + [2] * 100 + [3] * 10
    assert np.all(np.diff([t for t, _ in timed]) > 0)


def test_a_sender_whose_clock_drifts_is_followed():
    clock = CueClock()
    # 500 ppm slow: after 100 s it is 50 ms behind
    packets = [heard(10.0 * k, 10.0 * k * (1 - 5e-4), 1, k) for k in range(10_000)]
    timed = clock.timed(packets)
    late = [t - p.arrival_ns for t, p in timed]
    assert max(map(abs, late)) < 8 * MS
    assert np.all(np.diff([t for t, _ in timed]) > 0)
