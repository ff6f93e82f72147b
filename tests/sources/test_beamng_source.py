"""MotionSim by hand: X right, Y forward, Z up, the game's signs; genuine: test_beamng_genuine."""

import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_clients.beamng import MotionSimEncoder
from motion_clients.recording import RecordedSample

from motionserver.core.axes import GRAVITY
from motionserver.core.state import DriveMode
from motionserver.sources.base import OtherStreamError, SourceError
from motionserver.sources.beamng import BeamNgSource

SECOND = 1_000_000_000
NAMES = ["position", "velocity", "acceleration", "up", "angles", "rates", "angular"]


def packet(magic: bytes = b"BNG1", **values: tuple[float, float, float]) -> bytes:
    rows = [values.get(name, (0.0, 0.0, 0.0)) for name in NAMES]
    return struct.pack("<4s21f", magic, *(x for row in rows for x in row))


def test_the_axes_by_hand() -> None:
    # accelerating forward is +Y, to the left is -X, up is +Z
    sample = BeamNgSource().decode(
        packet(acceleration=(-2.0, 3.0, 0.5), velocity=(3.0, -4.0, 0.0)), 7
    )
    assert sample.force == pytest.approx([3.0, 2.0, GRAVITY + 0.5])
    assert sample.speed == pytest.approx(5.0)
    assert (sample.arrival_ns, sample.session) == (7, 0)
    assert sample.sequence is sample.sender_ns is None
    assert sample.mode is DriveMode.DRIVE


def test_angles_and_rates_by_hand() -> None:
    # the game's pitch is positive nose up, ours nose down; its yaw is positive to the right
    sample = BeamNgSource().decode(packet(angles=(0.1, 0.2, 9.0), rates=(0.3, 0.4, 0.5)), 0)
    assert sample.rates == pytest.approx([0.3, -0.4, -0.5])
    expected = [
        GRAVITY * math.sin(0.2),
        GRAVITY * math.sin(0.1) * math.cos(0.2),
        GRAVITY * math.cos(0.1) * math.cos(0.2),
    ]
    assert sample.force == pytest.approx(expected, rel=1e-6)


def test_it_reads_what_our_own_replay_writes() -> None:
    recorded = RecordedSample(0.0, (1.0, -2.0, 0.5), (0.1, 0.2, 0.3), 12.0, (0.05, -0.04))
    sample = BeamNgSource().decode(MotionSimEncoder().encode(recorded), 0)
    assert sample.rates == pytest.approx(recorded.rates)
    level = np.array([GRAVITY * math.sin(0.04), GRAVITY * math.sin(0.05) * math.cos(0.04), 0.0])
    level[2] = GRAVITY * math.cos(0.05) * math.cos(0.04)
    assert sample.force - level == pytest.approx(recorded.acceleration, abs=1e-5)
    assert sample.speed == pytest.approx(12.0)
    later = replace(recorded, time=0.01)
    assert BeamNgSource().decode(MotionSimEncoder().encode(later), 0).speed == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("moved", "elapsed", "mode"),
    [
        (2.9, 0.0, DriveMode.DRIVE),
        (3.1, 0.0, DriveMode.TELEPORT),
        (100.0, 1.0, DriveMode.DRIVE),
        (154.0, 1.0, DriveMode.TELEPORT),
    ],
)
def test_a_jump_of_position_is_a_respawn(moved: float, elapsed: float, mode: DriveMode) -> None:
    source = BeamNgSource()
    source.decode(packet(position=(5.0, 5.0, 5.0)), SECOND)
    there = packet(position=(5.0 + moved, 5.0, 5.0))
    assert source.decode(there, SECOND + int(elapsed * SECOND)).mode is mode
    assert source.decode(there, SECOND + int(elapsed * SECOND) + 1).mode is DriveMode.DRIVE


def test_the_extended_packet_is_read_by_its_first_88_bytes() -> None:
    extended = packet(b"BNG2", acceleration=(0.0, 1.0, 0.0)) + bytes(8)
    assert BeamNgSource().decode(extended, 0).force[0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "magic"),
        (b"MCUE" + bytes(84), "magic"),
        (packet()[:-1], "size"),
        (packet() + b"x", "size"),
        (packet(b"BNG2")[:-4], "size"),
        (packet(up=(0.0, math.nan, 0.0)), "not_finite"),
        (packet(position=(math.inf, 0.0, 0.0)), "not_finite"),
    ],
)
def test_what_is_no_packet(data: bytes, reason: str) -> None:
    with pytest.raises(SourceError) as refused:
        BeamNgSource().decode(data, 0)
    assert refused.value.reason == reason


@pytest.mark.parametrize("number", [b"", bytes(4)])
def test_outgauge_is_another_stream_and_says_so(number: bytes) -> None:
    fields = (0, b"beam", 0, 2, 0, 12.5, 3000.0, 0.0, 80.0, 0.5, 0.0, 90.0, 0, 0, 1.0, 0.0, 0.0)
    data = struct.pack("<I4sHBBfffffffIIfff16s16s", *fields, b"", b"") + number
    assert len(data) in (92, 96)
    with pytest.raises(OtherStreamError, match="OutGauge") as ignored:
        BeamNgSource().decode(data, 0)
    assert ignored.value.reason == "outgauge"


@given(st.binary(max_size=100) | st.binary(min_size=84, max_size=84).map(lambda b: b"BNG1" + b))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        sample = BeamNgSource().decode(data, 0)
    except SourceError:
        return
    assert np.isfinite(sample.force).all()
    assert np.isfinite(sample.rates).all()
