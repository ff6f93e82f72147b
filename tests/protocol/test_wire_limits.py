"""The edges of the wire contract: longest packets, last samples, every field by its name."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from motion_protocol import (
    DEFAULT_PORT,
    MAX_DATAGRAM,
    BlockLengthError,
    ByteOrderError,
    Cue,
    FieldError,
    Flags,
    Mode,
    Motion,
    NotFiniteError,
    Notices,
    PlatformState,
    Preview,
    Reference,
    SizeError,
    Status,
    decode_cue,
    decode_status,
    encode_cue,
    encode_status,
)
from motion_protocol.blocks import DRIVER_LAYOUT, MOTION_LAYOUT, PREVIEW, PREVIEW_LAYOUT
from motion_protocol.cue import CUE
from motion_protocol.framing import BLOCK_HEAD, HEADER, block, close_frame
from motion_protocol.layout import Layout
from motion_protocol.status import BODY, STATUS_KIND

KEY = bytes(range(32))
HEAD = {"session": 1, "sequence": 2, "sim_time_ns": 3, "sender_time_ns": 4}
SAMPLE = (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)
DRIVE = Cue(motion=Motion((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)), **HEAD)
OPTIONAL = 0x0005
"""A block type that nobody knows and nobody needs to."""


def test_a_packet_is_of_the_protocols_own_version_unless_told():
    assert list(bye(b"")[4:6]) == [1, 0]


def bye(payload, key=None, flags=0):
    return close_frame(CUE, payload, key, flags=flags, mode=Mode.BYE, **HEAD)


def test_the_documented_numbers():
    assert (DEFAULT_PORT, MAX_DATAGRAM) == (4600, 1200)
    assert [flag.value for flag in Flags] == [0x01, 0x02, 0x04, 0x08, 0x10]
    text = (Path(__file__).parents[2] / "protocol" / "README.md").read_text(encoding="utf-8")
    assert "port **4600**" in text
    assert "at most **1200 bytes**" in text
    assert "n, 1 to 40" in text


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
def test_the_longest_packet_is_written_and_read_and_one_byte_more_is_not(key):
    room = 1200 - 44 - 4 - (0 if key is None else 16)
    longest = bye(block(OPTIONAL, bytes(room)), key)
    assert len(longest) == 1200
    assert decode_cue(longest, key).mode is Mode.BYE
    with pytest.raises(SizeError):
        bye(block(OPTIONAL, bytes(room + 1)), key)


def test_a_datagram_beyond_the_limit_is_refused_by_its_size_alone():
    with pytest.raises(SizeError):
        decode_cue(bye(block(OPTIONAL, bytes(1152))) + b"\0")


def test_forty_samples_ahead_are_written_and_read():
    cue = replace(DRIVE, preview=Preview(0.05, 0.0, (SAMPLE,) * 40))
    assert len(decode_cue(encode_cue(cue)).preview.samples) == 40


def test_forty_one_samples_are_neither_written_nor_read():
    with pytest.raises(FieldError):
        encode_cue(replace(DRIVE, preview=Preview(0.05, 0.0, (SAMPLE,) * 41)))
    body = PREVIEW_LAYOUT.pack(41, 0.05, 0.0) + bytes(41 * 24)
    with pytest.raises(BlockLengthError) as refusal:
        decode_cue(bye(block(PREVIEW, body)))
    assert refusal.value.field == "preview.count"


def test_every_known_flag_is_kept_and_every_other_bit_ignored():
    cue = decode_cue(bye(b"", flags=0xFFFF))
    assert cue.flags == Flags(0x1F)


def test_an_unknown_block_that_need_not_be_understood_is_skipped():
    assert decode_cue(bye(block(OPTIONAL, b"news"))).mode is Mode.BYE


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
def test_a_length_written_backwards_is_told_from_a_wrong_one(key):
    data = bytearray(encode_cue(DRIVE, key))
    data[8:10] = data[9:7:-1]
    with pytest.raises(ByteOrderError):
        decode_cue(bytes(data), key)


FIELDS = [
    (
        HEADER,
        "magic version_major version_minor incompat compat payload_length flags mode session "
        "sequence sim_time_ns sender_time_ns crc",
    ),
    (BLOCK_HEAD, "type length"),
    (
        MOTION_LAYOUT,
        "acceleration.x acceleration.y acceleration.z rates.p rates.q rates.r roll pitch yaw "
        "speed reference valid",
    ),
    (PREVIEW_LAYOUT, "count dt start"),
    (DRIVER_LAYOUT, "throttle brake clutch steering gear"),
    (
        BODY,
        "echo_sender_time_ns receive_time_ns echo_sequence accepted_sequence lost reordered "
        "rejected scale state",
    ),
]
RECORDS = ["header", "block", "motion", "preview", "driver", "status"]


@pytest.mark.parametrize(("layout", "names"), FIELDS, ids=RECORDS)
def test_a_value_that_does_not_fit_is_named_as_in_the_byte_tables(layout, names, request):
    record = request.node.callspec.id
    sound = [b"MCUE" if name == "magic" else 0 for name in names.split()]
    layout.pack(*sound)
    for index, name in enumerate(names.split()):
        with pytest.raises(FieldError) as refusal:
            layout.pack(*sound[:index], "words", *sound[index + 1 :])
        assert refusal.value.field == f"{record}.{name}"


@pytest.mark.parametrize(("index", "name"), list(enumerate(("ax", "ay", "az", "p", "q", "r"))))
def test_a_sample_that_is_not_finite_is_named(index, name):
    bad = (*SAMPLE[:index], math.nan, *SAMPLE[index + 1 :])
    with pytest.raises(NotFiniteError) as refusal:
        encode_cue(replace(DRIVE, preview=Preview(0.05, 0.0, (SAMPLE, bad))))
    assert refusal.value.field == f"preview[1].{name}"


def test_only_the_floats_of_a_record_are_asked_whether_they_are_finite():
    layout = Layout("example", (("before", "4s"), ("x", "f"), ("y", "f"), ("after", "4s")))
    data = layout.pack(b"abcd", 1.0, 2.0, b"efgh")
    assert layout.unpack(data, 0) == (b"abcd", 1.0, 2.0, b"efgh")
    for values, field in (((math.inf, 0.0), "example.x"), ((0.0, math.nan), "example.y")):
        with pytest.raises(NotFiniteError) as refusal:
            layout.pack(b"abcd", *values, b"efgh")
        assert refusal.value.field == field


def test_every_point_of_reference_has_its_number():
    assert [point.name for point in Reference] == [
        "UNSPECIFIED", "CENTRE_OF_GRAVITY", "SEAT", "CAB", "HEAD", "PLATFORM",
    ]  # fmt: skip
    assert [point.value for point in Reference] == [0, 1, 2, 3, 4, 5]


def test_notice_text_of_240_bytes_is_written_and_one_more_is_not():
    status = Status(*range(1, 12), 0.5, PlatformState.RUN, notices=Notices.TOO_SLOW)
    longest = replace(status, notice_text="é" * 120)
    assert decode_status(encode_status(longest)).notice_text == "é" * 120
    with pytest.raises(FieldError, match=r"notice.text has 241 bytes, at most 240 fit") as refusal:
        encode_status(replace(status, notice_text="é" * 120 + "e"))
    assert refusal.value.field == "notice.text"


def test_every_kind_of_notice_has_its_bit():
    assert {kind.name: kind.value for kind in Notices} == {
        "SENDER_TIME": 1, "TOO_SLOW": 2, "VALUES": 4, "OUT_OF_RANGE": 8, "BAD_SHARE": 16,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("notices", "text"),
    [
        (Notices.NONE, "in words only"),
        (Notices.VALUES, ""),
        (Notices(1 << 15), "a newer kind"),
        (Notices.NONE, ""),
    ],
)
def test_a_notice_of_kinds_or_words_alone_is_a_notice(notices, text):
    status = Status(*range(1, 12), 0.5, PlatformState.RUN, notices, text)
    data = encode_status(status)
    assert data[5] == (1 if notices or text else 0)
    assert decode_status(data) == status


def test_kinds_of_notices_that_do_not_fit_are_named():
    status = Status(*range(1, 12), 0.5, PlatformState.RUN, Notices(1 << 16))
    with pytest.raises(FieldError, match=r"notice.kinds") as refusal:
        encode_status(status)
    assert refusal.value.field == "notice.kinds"


def test_words_of_a_notice_that_are_no_utf_8_are_shown_as_well_as_can_be():
    status = encode_status(Status(*range(1, 12), 0.5, PlatformState.RUN))
    payload = status[44:] + block(65, bytes([2, 0, 0, 0]) + b"2 \xff Hz")
    data = close_frame(
        STATUS_KIND, payload, None, flags=0, mode=0, session=1, sequence=2, sim_time_ns=3,
        sender_time_ns=4, minor=1,
    )  # fmt: skip
    assert decode_status(data).notice_text == "2 \N{REPLACEMENT CHARACTER} Hz"
