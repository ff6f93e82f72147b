"""The emulated base at any frame rate, as a process that logs every datagram with its arrival.

Run as ``python -m motionserver.evaluate.bench.base PORT RATE_HZ LOG``; it ends on SIGTERM.
"""

from __future__ import annotations

import sys
from pathlib import Path

from motion_clients.moog_config import MoogConfig
from motion_clients.moog_emulator import run_emulator

from motionserver.evaluate.bench.processes import say


def main(arguments: list[str]) -> int:
    """Be a base until a signal, then say what its judge saw."""
    port, rate_hz, log = int(arguments[0]), float(arguments[1]), Path(arguments[2])
    config = MoogConfig(frame_period=1.0 / rate_hz)
    verdict = run_emulator("127.0.0.1", port, config, log_path=log, on_ready=lambda _: say("ready"))
    say(verdict)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
