"""The golden packets: .bin equals its commented .hex, and is read or refused as the index says."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from motion_protocol import (
    Cue,
    DriverInputs,
    Flags,
    Mode,
    Motion,
    Notices,
    PlatformState,
    Preview,
    ProtocolError,
    Reference,
    Status,
    TimedPreview,
    decode_cue,
    decode_status,
    encode_cue,
    encode_status,
)

VECTORS = Path(__file__).parents[2] / "protocol" / "vectors"
INDEX = tomllib.loads((VECTORS / "index.toml").read_text(encoding="utf-8"))["vector"]
KEY = bytes(range(32))
DECODE = {"cue": decode_cue, "status": decode_status}
PLAIN = Motion((1.0, -2.0, 0.5), (0.0, 0.0, 0.25))
HEADER = {"session": 0x11223344, "sim_time_ns": 10**9, "sender_time_ns": 2 * 10**9}
COUNTS = (10**8, 10**7, 5, 6, 7, 8, 9, 0.75)
STATUS = Status(0x11223344, 1, 10**9, 2 * 10**9, *COUNTS, PlatformState.RUN)
FULL = Cue(
    sequence=1,
    motion=Motion((1.0, -2.0, 0.5), (0.125, -0.5, 0.25), (0.125, 0.25), 3.0, 12.5, Reference.SEAT),
    flags=Flags.REPLAY | Flags.STANDSTILL | Flags.CRASH,
    preview=Preview(
        0.05000000074505806,
        0.10000000149011612,
        ((1.0, -2.0, 0.5, 0.0, 0.0, 0.25), (1.5, -1.0, -0.5, 0.125, -0.5, 0.5)),
    ),
    driver=DriverInputs(0.75, 0.0, 1.0, -1.5, -1),
    **HEADER,
)
TIMED = TimedPreview(
    (0.01, 0.02, 0.2),
    (
        (1.0, -2.0, 0.5, 0.0, 0.0, 0.25),
        (1.5, -1.0, -0.5, 0.125, -0.5, 0.5),
        (2.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ),
)
MEANT = {
    "cue_minimal": Cue(sequence=1, motion=PLAIN, **HEADER),
    "cue_full": FULL,
    "cue_signed": Cue(sequence=1, motion=PLAIN, **HEADER),
    "cue_pause": Cue(sequence=2, motion=Motion((0.0,) * 3, (0.0,) * 3), mode=Mode.PAUSE, **HEADER),
    "cue_teleport": Cue(sequence=2**32 - 1, motion=PLAIN, mode=Mode.TELEPORT, **HEADER),
    "cue_bye": Cue(sequence=3, motion=None, mode=Mode.BYE, **HEADER),
    "cue_imu": Cue(
        sequence=1,
        motion=Motion((0.0, 0.0, 9.8100004196167), (0.0,) * 3, reference=Reference.PLATFORM),
        flags=Flags.GRAVITY_INCLUDED | Flags.MEASURED_AT_PLATFORM,
        **HEADER,
    ),
    "cue_newer_minor": Cue(sequence=1, motion=PLAIN, **HEADER),
    "cue_timed_preview": Cue(sequence=1, motion=PLAIN, preview=TIMED, **HEADER),
    "cue_both_previews": Cue(sequence=1, motion=PLAIN, preview=TIMED, **HEADER),
    "status_run": STATUS,
    "status_signed": replace(STATUS, state=PlatformState.SAFE),
    "status_notice": replace(
        STATUS, notices=Notices.TOO_SLOW | Notices.SENDER_TIME, notice_text="2 Hz: too slow \u2713"
    ),
}
REWRITTEN = sorted(MEANT.keys() - {"cue_newer_minor", "cue_both_previews"})


def name_of(vector):
    return vector["file"].removesuffix(".bin")


def key_of(vector):
    return KEY if vector["key"] else None


@pytest.mark.parametrize("vector", INDEX, ids=name_of)
def test_vector_bytes_equal_their_hex(vector):
    path = VECTORS / vector["file"]
    text = re.sub(r"#.*", "", path.with_suffix(".hex").read_text(encoding="utf-8"))
    assert path.read_bytes() == bytes.fromhex(text)


@pytest.mark.parametrize("vector", INDEX, ids=name_of)
def test_vector_is_read_or_refused_as_the_index_says(vector):
    data = (VECTORS / vector["file"]).read_bytes()
    decode = DECODE[vector["kind"]]
    if "reason" not in vector:
        assert decode(data, key_of(vector)) == MEANT[name_of(vector)]
        return
    with pytest.raises(ProtocolError) as refusal:
        decode(data, key_of(vector))
    assert refusal.value.reason == vector["reason"]
    assert refusal.value.field == vector.get("field")


@pytest.mark.parametrize("name", REWRITTEN)
def test_vector_is_written_byte_for_byte(name):
    encode = encode_status if isinstance(MEANT[name], Status) else encode_cue
    key = KEY if name.endswith("signed") else None
    assert encode(MEANT[name], key) == (VECTORS / f"{name}.bin").read_bytes()


def test_index_lists_every_file_and_nothing_else():
    listed = {name_of(vector) for vector in INDEX}
    assert listed == {path.stem for path in VECTORS.glob("*.bin")}
    assert listed == {path.stem for path in VECTORS.glob("*.hex")}
    assert MEANT.keys() == {name_of(vector) for vector in INDEX if "reason" not in vector}


def test_vectors_cover_every_reason_a_receiver_can_give():
    reasons = {kind.reason for kind in ProtocolError.__subclasses__()}
    assert {vector["reason"] for vector in INDEX if "reason" in vector} == reasons - {"field"}
