"""The pipe of the log is full, or its terminal stopped: motion goes on all the same."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from far_ends import FarRig
from process_hands import is_loaded, kill, replaced
from rig import assert_soft
from setpoint_log import assert_apart

INTO = """
import os, sys
into = os.open(sys.argv[1], os.O_WRONLY)
os.dup2(into, 1), os.dup2(into, 2)
os.execvp(sys.argv[2], sys.argv[2:])
"""
"""Runs a command whose output and errors go into an open pipe of another process."""


class Reader:
    """Reads a pipe into a file, until it is told to stop."""

    def __init__(self, log: Path) -> None:
        self._from, self.into = os.pipe()
        os.set_blocking(self._from, False)
        os.set_blocking(self.into, False)
        self._log, self._stop = log, threading.Event()
        self.begin()

    def begin(self) -> None:
        self._stop.clear()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with self._log.open("ab", buffering=0) as file:
            while not self._stop.wait(0.01):
                self.read_into(file)

    def read_into(self, file: object) -> None:
        while True:
            try:
                file.write(os.read(self._from, 65536))  # type: ignore[attr-defined]
            except BlockingIOError:
                return

    def stop_and_fill(self) -> None:
        """From now on every write waits."""
        self._stop.set()
        self._thread.join()
        for size in (4096, 1):
            while True:
                try:
                    os.write(self.into, b"\n" * size)
                except BlockingIOError:
                    break


@contextmanager
def rig_with_pipe(folder: Path) -> Iterator[tuple[FarRig, Reader]]:
    reader = Reader(folder / "server.log")
    try:
        within = (sys.executable, "-c", INTO, f"/proc/{os.getpid()}/fd/{reader.into}")
        with FarRig(folder, within=within) as rig:
            yield rig, reader
    finally:
        reader._stop.set()
        reader._thread.join()
        os.close(reader.into)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_full_pipe_neither_stops_the_drive_nor_the_way_home(tmp_path: Path, number: int) -> None:
    with rig_with_pipe(tmp_path) as (rig, reader):
        rig.run()
        rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
        reader.stop_and_fill()
        # every change of state is a log line: down, and up again
        assert rig.ask("park")["ok"]
        rig.wait_state("PARKED")
        rig.engage()
        rig.wait_state("RUN")
        # a spare that takes over tells so, and the service that one died
        replaced(rig, "guard", kill(rig, "guard"))
        rig.wait_state("RUN")
        rig.wait_plans(30)
        status, verdict = rig.end(number), rig.verdict()
        reader.begin()
    assert status == 0, rig.text()
    assert_soft(verdict)
    assert_apart(tmp_path / "base.log")
