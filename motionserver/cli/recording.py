"""record: a process of its own that reads what the others show."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

from motionserver.cli.running import NotRunningError, find_server
from motionserver.core.limits import machine_from_mapping
from motionserver.cueing.registry import algorithms
from motionserver.errors import ConfigError
from motionserver.telemetry.cue_history import CueReader
from motionserver.telemetry.link import GuardClock, Maps
from motionserver.telemetry.recorder import SILENT_NS, Recorder, write_recording
from motionserver.telemetry.run_files import read_run_file
from motionserver.telemetry.ticker import now_ns

_POLITE = 10
"""Nice value: whatever is recorded comes first."""


def record(path: Path | None, out: Path, seconds: float | None, run_dir: Path | None = None) -> str:
    """Record a running server until Ctrl-C, SIGTERM, its end, or for ``seconds`` [s].

    Returns:
        What was written, in words.

    Raises:
        NotRunningError: No server runs with this configuration.
        RecordError: The file cannot be written.
    """
    if seconds is not None and not seconds > 0.0:
        raise ConfigError("--seconds", f"{seconds:g}", "Give a positive number.")
    run_dir = find_server("record", path, run_dir).run_dir
    try:
        maps = Maps(run_dir)
        shown = json.loads(read_run_file(run_dir, "config.json"))
        clock = maps.clock.read()
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise NotRunningError(
            f"record: the server in {run_dir} cannot be read ({why}); it may be starting or "
            "ending: try again"
        ) from error
    if clock is None or now_ns() - GuardClock.unpack(clock[1]).written_ns > SILENT_NS:
        raise NotRunningError(f"record: no server runs in {run_dir}; its guard says nothing")
    over = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())
    with contextlib.suppress(OSError):
        os.nice(_POLITE)
    names = algorithms()
    recorder = Recorder(
        maps,
        machine_from_mapping(shown["machine"]),
        names,
        CueReader(run_dir),
        settings_of(shown),
    )
    begun = time.monotonic()

    def is_over() -> bool:
        late = seconds is not None and time.monotonic() - begun >= seconds
        return late or over.is_set()

    why = write_recording(
        recorder, names, out, now_ns=now_ns, pause=lambda s: time.sleep(s), is_over=is_over
    )
    took = time.monotonic() - begun
    missed = f" ({recorder.missed} more came too fast)" if recorder.missed else ""
    return (
        f"{recorder.rows} rows and {recorder.cue_rows} of the simulator{missed} in {took:.1f} s "
        f"to {out}; {why}"
    )


def settings_of(shown: dict[str, Any]) -> dict[str, Any]:
    """What a drive is judged by later, of what the processes were told."""
    planner = shown["planner"]
    return {
        "machine": shown["machine"],
        "vehicle_head_m": planner["arm"],
        "planner_period_s": planner["period"],
        "budget_s": planner["budget"],
        "platform_rate_hz": shown["platform"]["rate_hz"],
    }
