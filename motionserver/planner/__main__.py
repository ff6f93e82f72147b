"""Entry of the planner process: ``python -m motionserver.planner RUN_DIR``."""

from __future__ import annotations

import asyncio
import logging
import signal
import sys
from pathlib import Path

from motionserver.errors import MotionServerError
from motionserver.planner.loop import PlannerLoop
from motionserver.planner.options import read_options
from motionserver.telemetry.parent import follow_parent
from motionserver.telemetry.signals import ignore_signals


def main() -> int:
    """Run one planner."""
    # SIGTERM waits until the loop handles it
    ignore_signals(but=(signal.SIGTERM,))
    follow_parent()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s %(message)s")
    run_dir = Path(sys.argv[1])
    try:
        return asyncio.run(_run(run_dir))
    except (MotionServerError, OSError) as error:
        logging.getLogger("motionserver.planner").error("cannot start: %s", error)
        return 2


async def _run(run_dir: Path) -> int:
    return await PlannerLoop(read_options(run_dir), run_dir).run()


if __name__ == "__main__":
    sys.exit(main())
