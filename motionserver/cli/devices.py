"""emulate and replay: the other ends of the wire."""

from __future__ import annotations

import signal
import sys
import threading
import time
from pathlib import Path

from motion_clients.flawed_link import LinkFlaws
from motion_clients.moog_emulator import ENDING, run_emulator
from motion_clients.moog_judged import JudgedLimits
from motion_clients.recording import RecordingError, recording_names, recording_path
from motion_clients.replay import FORMATS
from motion_clients.replay import replay as send_recording

from motionserver.errors import ConfigError
from motionserver.evaluate.files import check_file
from motionserver.settings.config import split_address
from motionserver.telemetry.realtime import take_priority
from motionserver.telemetry.signals import ignore_signals

PUNCTUAL = 20
"""Real-time priority to ask for: a base and a simulator are punctual, an emulated one must be."""
EMULATORS = ("moog-6dof2000e",)


def _address(option: str, text: str) -> tuple[str, int]:
    try:
        return split_address(text)
    except ValueError as error:
        raise ConfigError(option, str(error), "Give HOST:PORT.") from error


def emulate(
    form: str,
    listen: str,
    force_to: str,
    summary: Path | None,
    log: Path | None,
    seconds: float | None,
    seed: int,
    cut_after: float | None,
    may_lose: bool = False,
) -> dict[str, object]:
    """Be a device until a signal, as punctual as permitted; returns the judge's verdict."""
    if form not in EMULATORS:
        raise ConfigError("FORMAT", f"unknown {form!r}", f"Allowed: {', '.join(EMULATORS)}.")
    host, port = _address("--listen", listen)
    to = _address("--force-to", force_to) if force_to else None
    check_file("--summary", summary)
    check_file("--log", log)
    ignore_signals(but=ENDING)
    take_priority(PUNCTUAL, wanted=True)
    cut = LinkFlaws()
    if cut_after is not None:
        begin = time.monotonic() + cut_after
        cut = LinkFlaws(silences=((begin, float("inf")),))
    try:
        return run_emulator(
            host,
            port,
            duration=seconds,
            limits=JudgedLimits(may_lose=may_lose),
            log_path=log,
            summary_path=summary,
            force_to=to,
            seed=seed,
            to_base=cut,
            to_host=cut,
        )
    except OSError as error:
        raise ConfigError("--listen", f"{listen}: {error.strerror}", "Choose another.") from error


def replay(recording: str, to: str, form: str, loop: bool, preview: float) -> str:
    """Send a recording until its end or a signal; returns what was sent, in words."""
    if form not in FORMATS:
        raise ConfigError("--format", f"unknown {form!r}", f"Allowed: {', '.join(FORMATS)}.")
    path = recording_path(recording) if recording in recording_names() else Path(recording)
    host, port = _address("--to", to)
    take_priority(PUNCTUAL, wanted=True)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        counts = send_recording(
            path,
            host,
            port,
            fmt=form,
            stop=stop,
            loop=loop,
            preview=preview,
            tell=lambda text: print(text, file=sys.stderr, flush=True),  # noqa: T201
        )
    except RecordingError as error:
        raise ConfigError("INPUT.csv", str(error), "Correct the file.") from error
    except ValueError as error:
        raise ConfigError("replay", str(error), "Correct the option.") from error
    except OSError as error:
        raise ConfigError(f"--to {to}", str(error.strerror), "Give another HOST:PORT.") from error
    return f"sent {counts.sent} packets in {counts.rounds} rounds, {counts.unsent} not sent"
