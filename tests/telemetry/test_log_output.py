"""Log lines by a thread of their own: order, bounds, an output that takes none, and the end."""

import logging
import os
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from motionserver.telemetry.log_output import BackgroundHandler

DIES = """
import logging, sys
from motionserver.telemetry.log_output import start_log
start_log()
class Cross:
    def __del__(self):
        raise KeyError("left behind")
logging.getLogger("motionserver.guard").info("last %s", "line")
del (cross := [Cross()])[0]
raise ValueError("nobody caught it")
"""


def record(text: str, *values: object) -> logging.LogRecord:
    return logging.LogRecord("motionserver.guard", logging.INFO, __file__, 1, text, values, None)


def filled(descriptor: int) -> int:
    """Fill a pipe; how many bytes it took."""
    os.set_blocking(descriptor, False)
    taken = 0
    for size in (4096, 1):
        while True:
            try:
                taken += os.write(descriptor, b"x" * size)
            except BlockingIOError:
                break
    return taken


def read_lines(descriptor: int, count: int) -> list[bytes]:
    found = b""
    while found.count(b"\n") < count:
        found += os.read(descriptor, 65536)
    return found.splitlines()


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    out, into = os.pipe()
    yield out, into
    os.close(out)


def test_lines_arrive_whole_and_in_order(pipe):
    out, into = pipe
    handler = BackgroundHandler(into)
    for number in range(300):
        handler.handle(record("line %d of ä", number))
    lines = read_lines(out, 300)
    assert [line.split()[-3:] for line in lines] == [
        [str(n).encode(), b"of", "ä".encode()] for n in range(300)
    ]


@pytest.mark.parametrize("is_blocking", [True, False])
def test_a_full_output_delays_nobody_and_tells_what_was_left_out(pipe, is_blocking):
    out, into = pipe
    taken = filled(into)
    os.set_blocking(into, is_blocking)
    handler = BackgroundHandler(into, most_lines=10)
    for number in range(25):
        # on a handler that waits this would never come back
        handler.handle(record("line %d", number))
    handler.flush()
    while taken:
        taken -= len(os.read(out, min(taken, 65536)))
    lines = [line.split(b"motionserver.guard ")[-1] for line in read_lines(out, 11)]
    assert lines[0] == b"line 0"
    assert lines[1] == b"15 log lines were left out: the output took none"
    assert lines[2:] == [f"line {n}".encode() for n in range(1, 10)]


def test_a_line_that_cannot_be_formatted_is_told_and_stops_nothing(pipe):
    out, into = pipe
    handler = BackgroundHandler(into)
    handler.handle(record("%d", "no number"))
    handler.handle(record("next"))
    first, second = read_lines(out, 2)
    assert b"a log line of" in first
    assert second.endswith(b"next")


def test_an_output_that_is_gone_stops_nothing():
    out, into = os.pipe()
    os.close(out)
    handler = BackgroundHandler(into)
    for _ in range(3):
        handler.handle(record("nobody hears it"))
    handler.flush()
    assert handler._written == 3


def test_the_last_lines_and_the_reason_of_death_are_written():
    died = subprocess.run([sys.executable, "-c", DIES], capture_output=True, text=True, check=False)
    assert died.returncode == 1
    assert "motionserver.guard last line" in died.stderr
    assert "KeyError: 'left behind'" in died.stderr
    assert died.stderr.rstrip().endswith("ValueError: nobody caught it")


def test_a_process_ends_although_its_output_takes_nothing(pipe):
    _, into = pipe
    filled(into)
    os.set_blocking(into, True)
    process = subprocess.Popen([sys.executable, "-c", DIES], stderr=into)
    began = time.monotonic()
    while process.poll() is None and time.monotonic() - began < 60.0:
        time.sleep(0.05)
    is_ended = process.poll() is not None
    process.kill()
    process.wait()
    assert is_ended
