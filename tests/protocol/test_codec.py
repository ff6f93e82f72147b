"""Round trips and refusals of the codec, for any values and any bytes."""

import math
from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_protocol import (
    MAX_DATAGRAM,
    PREVIEW_MAX,
    BlockMissingError,
    Cue,
    DriverInputs,
    FieldError,
    Flags,
    HmacMissingError,
    HmacUnexpectedError,
    Mode,
    Motion,
    NotFiniteError,
    PlatformState,
    Preview,
    ProtocolError,
    Reference,
    SizeError,
    Status,
    decode_cue,
    decode_status,
    encode_cue,
    encode_status,
    sequence_delta,
)
from motion_protocol.cue import CUE
from motion_protocol.framing import close_frame
from motion_protocol.status import STATUS_KIND

KEY = b"an example key of 32 bytes......"
u32 = st.integers(0, 2**32 - 1)
u64 = st.integers(0, 2**64 - 1)
f32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
vector3 = st.tuples(f32, f32, f32)
keys = st.none() | st.binary(min_size=1, max_size=40)
motions = st.builds(
    Motion,
    vector3,
    vector3,
    st.none() | st.tuples(f32, f32),
    st.none() | f32,
    st.none() | f32,
    st.sampled_from(Reference),
)
previews = st.builds(
    Preview,
    f32,
    f32,
    st.lists(st.tuples(f32, f32, f32, f32, f32, f32), min_size=1, max_size=PREVIEW_MAX).map(tuple),
)
drivers = st.builds(DriverInputs, f32, f32, f32, f32, st.integers(-128, 127))
cues = st.builds(
    Cue,
    u32,
    u32,
    u64,
    u64,
    motions,
    st.sampled_from(Mode),
    st.integers(0, 31).map(Flags),
    st.none() | previews,
    st.none() | drivers,
)
byes = st.builds(Cue, u32, u32, u64, u64, st.none(), st.just(Mode.BYE))
statuses = st.builds(
    Status, u32, u32, u64, u64, u64, u64, u32, u32, u32, u32, u32, f32,
    st.sampled_from(PlatformState),
)  # fmt: skip
MOTION = Motion((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
CUE_EXAMPLE = Cue(1, 2, 3, 4, MOTION)
STATUS_EXAMPLE = Status(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 0.5, PlatformState.HOLD)


@given(cue=cues | byes, key=keys)
def test_cue_round_trip(cue, key):
    data = encode_cue(cue, key)
    assert len(data) <= MAX_DATAGRAM
    assert decode_cue(data, key) == cue


@given(status=statuses, key=keys)
def test_status_round_trip(status, key):
    assert decode_status(encode_status(status, key), key) == status


@given(data=st.binary(max_size=1300), key=keys)
def test_random_bytes_are_refused_with_a_protocol_error(data, key):
    for decode in (decode_cue, decode_status):
        with pytest.raises(ProtocolError):
            decode(data, key)


@given(payload=st.binary(max_size=200), mode=st.integers(0, 255), flags=st.integers(0, 65535))
def test_random_payload_in_a_sound_frame_never_raises_anything_else(payload, mode, flags):
    head = {"flags": flags, "mode": mode, "session": 1, "sequence": 2}
    times = {"sim_time_ns": 3, "sender_time_ns": 4}
    for kind, decode in ((CUE, decode_cue), (STATUS_KIND, decode_status)):
        data = close_frame(kind, payload, None, **head, **times)
        with suppress(ProtocolError):
            decode(data)


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
@pytest.mark.parametrize("flip", [0x01, 0x80, 0xFF])
def test_any_single_damaged_byte_is_refused(key, flip):
    preview = Preview(0.05, 0.0, ((0.0,) * 6,) * 3)
    for data, decode in (
        (encode_cue(replace(CUE_EXAMPLE, preview=preview), key), decode_cue),
        (encode_status(STATUS_EXAMPLE, key), decode_status),
    ):
        for position in range(len(data)):
            damaged = bytearray(data)
            damaged[position] ^= flip
            with pytest.raises(ProtocolError):
                decode(bytes(damaged), key)


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
def test_any_truncation_or_addition_is_refused(key):
    for data, decode in (
        (encode_cue(CUE_EXAMPLE, key), decode_cue),
        (encode_status(STATUS_EXAMPLE, key), decode_status),
    ):
        for length in range(len(data)):
            with pytest.raises(ProtocolError):
                decode(data[:length], key)
        with pytest.raises(ProtocolError):
            decode(data + b"\0", key)


def test_datagram_above_the_limit_is_refused():
    with pytest.raises(SizeError):
        decode_cue(b"MCUE" + bytes(MAX_DATAGRAM))
    with pytest.raises(SizeError):
        close_frame(CUE, bytes(MAX_DATAGRAM), None, flags=0, mode=3, session=1, sequence=1,
                    sim_time_ns=0, sender_time_ns=0)  # fmt: skip


def test_signing_must_agree_on_both_sides():
    with pytest.raises(HmacMissingError):
        decode_cue(encode_cue(CUE_EXAMPLE), KEY)
    with pytest.raises(HmacUnexpectedError):
        decode_cue(encode_cue(CUE_EXAMPLE, KEY))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_encoding_a_number_that_is_not_finite_names_it(bad):
    cases = {
        "motion.acceleration.y": replace(
            CUE_EXAMPLE, motion=replace(MOTION, acceleration=(0.0, bad, 0.0))
        ),
        "motion.speed": replace(CUE_EXAMPLE, motion=replace(MOTION, speed=bad)),
        "preview.dt": replace(CUE_EXAMPLE, preview=Preview(bad, 0.0, ((0.0,) * 6,))),
        "preview[1].r": replace(
            CUE_EXAMPLE, preview=Preview(0.1, 0.0, ((0.0,) * 6, (0.0, 0.0, 0.0, 0.0, 0.0, bad)))
        ),
        "driver.brake": replace(CUE_EXAMPLE, driver=DriverInputs(0.0, bad, 0.0, 0.0, 0)),
    }
    for field, cue in cases.items():
        with pytest.raises(NotFiniteError, match="must be finite") as refusal:
            encode_cue(cue)
        assert refusal.value.field == field


def test_encoding_a_value_that_does_not_fit_names_it():
    cases = {
        "header.session": replace(CUE_EXAMPLE, session=2**32),
        "header.sequence": replace(CUE_EXAMPLE, sequence=-1),
        "header.flags": replace(CUE_EXAMPLE, flags=1 << 16),
        "motion.rates.p": replace(CUE_EXAMPLE, motion=replace(MOTION, rates=(1e39, 0.0, 0.0))),
        "preview.samples": replace(CUE_EXAMPLE, preview=Preview(0.1, 0.0, ())),
        "driver.gear": replace(CUE_EXAMPLE, driver=DriverInputs(0.0, 0.0, 0.0, 0.0, 300)),
    }
    for field, cue in cases.items():
        with pytest.raises(FieldError) as refusal:
            encode_cue(cue)
        assert refusal.value.field == field
    for samples in (((1e39,) * 6,), ((0.0,) * 5,), ((0.0,) * 6,) * (PREVIEW_MAX + 1)):
        with pytest.raises(FieldError) as refusal:
            encode_cue(replace(CUE_EXAMPLE, preview=Preview(0.1, 0.0, samples)))
        assert refusal.value.field == "preview.samples"


@pytest.mark.parametrize("mode", [Mode.DRIVE, Mode.PAUSE, Mode.TELEPORT])
def test_only_bye_may_be_written_without_motion(mode):
    with pytest.raises(BlockMissingError):
        encode_cue(Cue(1, 2, 3, 4, None, mode))


@given(older=u32, step=st.integers(-(2**31), 2**31 - 1))
def test_sequence_delta_is_exact_across_the_wrap(older, step):
    assert sequence_delta((older + step) % 2**32, older) == step
