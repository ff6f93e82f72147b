"""The native cue: what its flags and blocks become inside."""

from pathlib import Path

import numpy as np
import pytest
from motion_protocol import Cue, Flags, Mode, Motion, Preview, encode_cue

from motionserver.core.axes import GRAVITY
from motionserver.core.state import DriveMode, VehicleMotion
from motionserver.sources.base import SourceError
from motionserver.sources.native import NativeSource

VECTORS = Path(__file__).parents[2] / "protocol" / "vectors"
UNSIGNED = sorted(p for p in VECTORS.glob("cue_*.bin") if p.stem != "cue_signed")
TILT = 0.2


def decoded(motion: Motion | None, key: bytes | None = None, **more: object) -> VehicleMotion:
    cue = Cue(7, 3, 0, 555, motion, **more)  # type: ignore[arg-type]
    return NativeSource(key).decode(encode_cue(cue, key), 999)


def test_acceleration_becomes_specific_force_level() -> None:
    sample = decoded(Motion((1.0, 2.0, -0.5), (0.1, 0.2, 0.3), speed=8.0))
    assert sample.force == pytest.approx([1.0, 2.0, GRAVITY - 0.5])
    assert sample.rates == pytest.approx([0.1, 0.2, 0.3])
    assert (sample.arrival_ns, sample.session, sample.sequence) == (999, 7, 3)
    assert (sample.sender_ns, sample.speed) == (555, 8.0)
    assert (sample.mode, sample.at_platform, sample.preview) == (DriveMode.DRIVE, False, None)


@pytest.mark.parametrize(
    ("attitude", "expected"),
    [
        ((TILT, 0.0), (0.0, GRAVITY * np.sin(TILT), GRAVITY * np.cos(TILT))),
        ((0.0, TILT), (-GRAVITY * np.sin(TILT), 0.0, GRAVITY * np.cos(TILT))),
    ],
)
def test_a_slope_is_felt_through_the_attitude(
    attitude: tuple[float, float], expected: tuple[float, ...]
) -> None:
    sample = decoded(Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), attitude))
    assert sample.force == pytest.approx(expected, rel=1e-6)


def test_specific_force_is_taken_as_it_is_whatever_the_attitude() -> None:
    motion = Motion((0.5, 0.0, 9.0), (0.0, 0.0, 0.0), (TILT, TILT))
    sample = decoded(motion, flags=Flags.GRAVITY_INCLUDED)
    assert sample.force == pytest.approx([0.5, 0.0, 9.0])


def test_the_preview_gets_the_same_gravity() -> None:
    preview = Preview(0.05, 0.1, ((1.0, 0.0, 0.0, 0.1, 0.0, 0.0), (2.0, 0.0, 0.0, 0.2, 0.0, 0.0)))
    motion = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, TILT))
    ahead = decoded(motion, preview=preview).preview
    assert ahead is not None
    assert ahead.times == pytest.approx([0.1, 0.15])
    assert ahead.force[:, 0] == pytest.approx(np.array([1.0, 2.0]) - GRAVITY * np.sin(TILT))
    assert ahead.rates[:, 0] == pytest.approx([0.1, 0.2])
    with_gravity = decoded(motion, preview=preview, flags=Flags.GRAVITY_INCLUDED).preview
    assert with_gravity is not None
    assert with_gravity.force[:, 2] == pytest.approx([0.0, 0.0])


def test_bye_has_no_motion_and_is_level() -> None:
    sample = decoded(None, mode=Mode.BYE)
    assert sample.mode is DriveMode.BYE
    assert sample.force == pytest.approx([0.0, 0.0, GRAVITY])
    assert not sample.rates.any()


@pytest.mark.parametrize("mode", list(Mode))
def test_modes_carry_over_by_number(mode: Mode) -> None:
    assert decoded(Motion((0, 0, 0), (0, 0, 0)), mode=mode).mode.name == mode.name


def test_a_sensor_on_the_platform_says_so() -> None:
    assert decoded(Motion((0, 0, 0), (0, 0, 0)), flags=Flags.MEASURED_AT_PLATFORM).at_platform


def test_only_what_is_signed_is_believed_where_there_is_a_key() -> None:
    key = bytes(range(32))
    assert decoded(Motion((0, 0, 0), (0, 0, 0)), key).session == 7
    with pytest.raises(SourceError) as refused:
        NativeSource(key).decode(encode_cue(Cue(7, 3, 0, 0, None, Mode.BYE)), 0)
    assert refused.value.reason == "hmac_missing"


@pytest.mark.parametrize("path", UNSIGNED, ids=lambda path: path.stem)
def test_golden_packets_decode(path: Path) -> None:
    sample = NativeSource().decode(path.read_bytes(), 1)
    assert np.isfinite(sample.force).all()


@pytest.mark.parametrize("path", sorted(VECTORS.glob("bad_*.bin")), ids=lambda path: path.stem)
def test_every_bad_packet_is_refused_with_a_reason(path: Path) -> None:
    source = NativeSource(bytes(32) if path.stem == "bad_hmac_missing" else None)
    with pytest.raises(SourceError) as refused:
        source.decode(path.read_bytes(), 1)
    assert refused.value.reason
