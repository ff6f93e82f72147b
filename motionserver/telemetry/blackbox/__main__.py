"""Entry of the black box: ``python -m motionserver.telemetry.blackbox RUN_DIR FOLDER KEPT``."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from motionserver.telemetry.blackbox.dump import Trigger
from motionserver.telemetry.blackbox.room import FOLDER, free_memory
from motionserver.telemetry.blackbox.watch import Watch
from motionserver.telemetry.link import GuardClock
from motionserver.telemetry.log_output import start_log
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.oom import HELPER, set_oom_score
from motionserver.telemetry.parent import follow_parent
from motionserver.telemetry.run_files import located
from motionserver.telemetry.signals import ignore_signals, let_through

POLL: Final = 0.1
"""Pause between two looks [s]; nothing is lost meanwhile."""
SILENT: Final = 1.0
"""A guard that says nothing for longer has ended [s]."""
LONGEST: Final = 120.0
"""Longest wait for a guard that parks after the service's death [s]."""
_POLITE: Final = 10
"""Nice value: whatever it looks at comes first."""


def main() -> int:
    """Watch until SIGINT, by which the service ends it; after its death until the guard ends."""
    told: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: told.append(number))
    # also sent to all processes at once, and while the service's last threads still live: whether
    # the service has died is asked, not concluded
    signal.signal(signal.SIGTERM, lambda *_: None)
    ignore_signals(but=(signal.SIGINT, signal.SIGTERM))
    let_through()
    parent = os.getppid()
    follow_parent()
    with contextlib.suppress(OSError):
        os.nice(_POLITE)
    set_oom_score(HELPER)
    start_log()
    run_dir, folder, kept = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    watch = Watch(run_dir, folder, kept, lambda: datetime.now(UTC))
    room = (run_dir / FOLDER).resolve()
    clock = MappedFile(located(run_dir, "clock.map"))
    while not told and os.getppid() == parent:
        watch.look(time.monotonic_ns())
        watch.tell(time.monotonic_ns(), os.getpid())
        time.sleep(POLL)
    watch.look(0)
    if not told:
        died = time.monotonic_ns()
        watch.add(Trigger(died, "died-service", "the service died"))
        while time.monotonic_ns() - died < LONGEST * 1e9 and _is_heard(clock):
            time.sleep(POLL)
        watch.look(0)
    watch.finish(time.monotonic_ns())
    if not told:
        # nobody else would, before another server starts here
        free_memory(room)
    return 0


def _is_heard(clock: MappedFile) -> bool:
    message = clock.read()
    if message is None:
        return False
    return time.monotonic_ns() - GuardClock.unpack(message[1]).written_ns < SILENT * 1e9


if __name__ == "__main__":
    sys.exit(main())
