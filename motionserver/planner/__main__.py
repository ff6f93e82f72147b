"""Entry of the planner process: ``python -m motionserver.planner RUN_DIR``."""

from __future__ import annotations

import asyncio
import logging
import signal
import sys
from pathlib import Path

from motionserver.errors import MotionServerError
from motionserver.planner.loop import PRIORITY, PlannerLoop
from motionserver.planner.options import PlannerOptions, read_options
from motionserver.telemetry.log_output import start_log
from motionserver.telemetry.parent import follow_parent
from motionserver.telemetry.realtime import take_priority
from motionserver.telemetry.signals import ignore_signals


def main() -> int:
    """Run one planner."""
    # SIGTERM waits until the loop handles it
    ignore_signals(but=(signal.SIGTERM,))
    follow_parent()
    run_dir = Path(sys.argv[1])
    try:
        options = read_options(run_dir)
        start_log(prepare_thread=lambda: take_priority(PRIORITY, options.realtime))
        return asyncio.run(_run(options, run_dir))
    except (MotionServerError, OSError) as error:
        logging.getLogger("motionserver.planner").error("cannot start: %s", error)
        return 2


async def _run(options: PlannerOptions, run_dir: Path) -> int:
    return await PlannerLoop(options, run_dir).run()


if __name__ == "__main__":
    sys.exit(main())
