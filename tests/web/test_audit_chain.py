"""The audit log: tampering is found and named; power cuts, rotation, full disks are borne."""

import hashlib
import json
import resource
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.cli.audit_verify import verify_text
from motionserver.errors import ConfigError
from motionserver.web.audit import Audit
from motionserver.web.audit_chain import RESUME, head_path, read_head, read_lines, rotated, walk
from motionserver.web.auth import Caller, Role

CALLER = Caller(Role.TUNER, "0badcafe", "127.0.0.1")
ROTATING = 1200
"""Size [B] at which a log of these tests is put aside: some five lines."""


def written(path: Path, count: int, largest: int = 1 << 20) -> Audit:
    audit = Audit(path, largest)
    for number in range(count):
        audit.note("tune", CALLER, "done", changes={"scale": number})
    return audit


def walked(path: Path):
    older = rotated(path)
    lines = [*(read_lines(older) if older.exists() else []), *read_lines(path)]
    return walk(lines, read_head(path), older.exists())


def verify(path: Path, head: str = "") -> tuple[str, bool]:
    return verify_text(path, None, head)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "audit.jsonl"


@given(count=st.integers(0, 40), lives=st.integers(1, 4))
@settings(max_examples=30, deadline=None)
def test_an_untouched_log_is_whole_over_restarts_and_rotations(tmp_path_factory, count, lives):
    path = tmp_path_factory.mktemp("audit") / "audit.jsonl"
    for _ in range(lives):
        written(path, count, ROTATING)
    if count:
        found = walked(path)
        assert found.problem == ""
        assert read_head(path).head == found.head
        assert verify(path)[1]
    else:
        with pytest.raises(ConfigError, match="no such file"):
            verify(path)


def texts_of(path: Path) -> list[tuple[Path, bytes]]:
    files = [file for file in (rotated(path), path) if file.exists()]
    return [(file, text) for file in files for text in file.read_bytes().splitlines()]


def put(path: Path, lines: list[tuple[Path, bytes]]) -> None:
    for file in (rotated(path), path):
        if file.exists():
            mine = [text for where, text in lines if where == file]
            file.write_bytes(b"".join(text + b"\n" for text in mine))


def forged(previous: str) -> bytes:
    return json.dumps({"action": "engage", "result": "done", "previous": previous}).encode()


@st.composite
def tamperings(draw):
    return (
        draw(st.sampled_from(["change", "delete", "swap", "insert", "repeat", "blank"])),
        draw(st.integers(0, 10**6)),
        draw(st.integers(0, 10**6)),
        draw(st.integers(1, 255)),
    )


@given(count=st.integers(2, 24), how=tamperings(), rotates=st.booleans())
@settings(max_examples=200, deadline=None)
def test_any_changed_deleted_swapped_or_inserted_line_is_found(
    tmp_path_factory, count, how, rotates
):
    path = tmp_path_factory.mktemp("audit") / "audit.jsonl"
    written(path, count, ROTATING if rotates else 1 << 20)
    lines = texts_of(path)
    what, one, two, flip = how
    at = one % len(lines)
    file, text = lines[at]
    if what == "change":
        bad = bytearray(text)
        bad[two % len(bad)] ^= flip
        lines[at] = (file, bytes(bad))
    elif what == "delete":
        del lines[at]
    elif what == "swap":
        other = two % len(lines)
        if other == at:
            return
        (lines[at], lines[other]) = ((file, lines[other][1]), (lines[other][0], text))
    else:
        after = hashlib.sha256(text).hexdigest()
        new = {"insert": forged(after), "repeat": text, "blank": b""}[what]
        lines.insert(at + 1, (file, new))
    put(path, lines)
    found = walked(path)
    assert found.problem, (how, [text for _, text in lines])


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("change", "audit.jsonl line 4: was changed, or lines between it"),
        ("previous", "audit.jsonl line 4: was changed or inserted"),
        ("delete", "audit.jsonl line 3: was changed, or lines between it and audit.jsonl line 4"),
        ("insert", "audit.jsonl line 5: was inserted, with everything up to audit.jsonl line 5"),
        ("swap", "audit.jsonl line 4: was moved; the line it was written after stands at"),
        ("cut", "the end: the stored head is not in the log"),
        ("last", "the end: the stored head is not in the log"),
        ("append", "the end: 1 lines stand behind the stored head"),
        ("first", "audit.jsonl line 1: lines before it were removed"),
        ("garbage", "audit.jsonl line 4: was changed or inserted; it is no entry"),
    ],
)
def test_the_first_break_is_named(path, what, said):
    written(path, 8)
    lines = path.read_bytes().splitlines()
    if what == "change":
        lines[3] = lines[3].replace(b'"scale":3', b'"scale":9')
    elif what == "previous":
        entry = json.loads(lines[3])
        lines[3] = json.dumps({**entry, "previous": "0" * 64}).encode()
    elif what == "delete":
        del lines[3]
    elif what == "insert":
        lines.insert(4, forged(hashlib.sha256(lines[3]).hexdigest()))
    elif what == "swap":
        lines[3], lines[4] = lines[4], lines[3]
    elif what == "cut":
        lines = lines[:5]
    elif what == "last":
        lines[-1] = lines[-1].replace(b"done", b"none")
    elif what == "append":
        lines.append(forged(hashlib.sha256(lines[-1]).hexdigest()))
    elif what == "first":
        del lines[0]
    else:
        lines[3] = b"\xff\x00 garbage"
    path.write_bytes(b"\n".join(lines) + b"\n")
    text, whole = verify(path)
    assert not whole
    assert f"BROKEN: {said}" in text


def test_a_cut_end_needs_a_head_kept_somewhere(path):
    """Who cuts the stored head too is seen by nobody but an operator with an older head hash."""
    written(path, 3)
    noted = walked(path).head
    written(path, 3)
    assert f"{3} lines before the end" in verify(path, noted)[0]
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:2]))
    head_path(path).unlink()
    text, whole = verify(path)
    assert whole
    assert "no head is stored beside this log" in text
    text, whole = verify(path, noted)
    assert not whole
    assert "the hash given with --head is not in the chain" in text


@pytest.mark.parametrize("left", [b'{"time":"2026-', b"\x00" * 300, b"\xff\xfe\n\x00{"])
def test_a_line_broken_by_a_power_cut_is_said_and_the_writer_goes_on(path, left):
    written(path, 3)
    with path.open("ab") as stream:
        stream.write(left)
    text, whole = verify(path)
    assert whole
    assert "broken last line, as a power cut leaves it; repairable" in text
    written(path, 2)
    text, whole = verify(path)
    assert whole, text
    assert "broken by a power cut; audit.jsonl line" in text
    actions = [line.entry and line.entry["action"] for line in read_lines(path)]
    assert actions[:3] == ["tune"] * 3
    assert actions[-3:] == [RESUME, "tune", "tune"]
    # what the power cut left is guarded from then on
    path.write_bytes(path.read_bytes().replace(left, left + b"x"))
    assert not verify(path)[1]


def test_a_missing_end_of_line_costs_nothing(path):
    written(path, 2)
    path.write_bytes(path.read_bytes()[:-1])
    assert verify(path)[1]
    written(path, 1)
    assert [line.entry["action"] for line in read_lines(path)] == ["tune"] * 3
    assert verify(path)[1]


def test_whole_lines_that_a_power_cut_took_are_told_for_ever(path):
    written(path, 5)
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:3]))
    written(path, 2)
    text, whole = verify(path)
    assert not whole
    assert "line 4: resumed behind an end that is not the stored one" in text


def test_a_head_older_than_the_log_is_caught_up(path):
    written(path, 2)
    head = head_path(path).read_bytes()
    written(path, 1)
    head_path(path).write_bytes(head)
    assert not verify(path)[1]
    written(path, 1)
    text, whole = verify(path)
    assert whole
    assert "the 1 lines before it were not sealed yet" in text


def test_an_empty_log_is_whole_unless_something_was_in_it(path):
    path.touch()
    text, whole = verify(path)
    assert whole
    assert "empty" in text
    written(path, 1)
    assert verify(path)[1]
    path.write_bytes(b"")
    assert not verify(path)[1]


def test_a_restart_after_a_rotation_goes_on_with_the_chain(path):
    written(path, 9, ROTATING)
    assert rotated(path).exists()
    # the power went between putting aside and the first line of the new file
    path.replace(rotated(path))
    written(path, 1, ROTATING)
    first = read_lines(path)[0]
    assert first.previous in {line.digest for line in read_lines(rotated(path))}
    assert "rotated away" in verify(path)[0] or walked(path).problem


def test_a_removed_rotated_file_is_seen(path):
    written(path, 9, ROTATING)
    rotated(path).unlink()
    assert not verify(path)[1]
    head_path(path).unlink()
    assert not verify(path)[1]


def test_a_disk_that_fills_up_in_the_middle_of_a_line_leaves_no_half_line(path):
    audit = written(path, 2)
    size = path.stat().st_size
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 40, limits[1]))
    try:
        audit.note("tune", CALLER, "done")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert audit.lost == 1
    assert path.stat().st_size == size
    audit.note("tune", CALLER, "done")
    assert len(read_lines(path)) == 3
    assert verify(path)[1]
