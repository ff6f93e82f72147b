"""Whom the kernel kills first when memory runs out: the page, then the planner, the guard last."""

from __future__ import annotations

from pathlib import Path
from typing import Final

GUARD: Final = -900
SERVICE: Final = -500
PLANNER: Final = 300
HELPER: Final = 600
"""Page and black box: nothing moves without them, and nothing stops either."""


def set_oom_score(score: int) -> str:
    """Ask for a place in the kernel's order; lowering it takes CAP_SYS_RESOURCE.

    Returns:
        What is in force, for the log and the page.
    """
    path = Path("/proc/self/oom_score_adj")
    try:
        path.write_text(f"{score}\n", "ascii")
    except OSError:
        pass
    else:
        return f"OOM score {score}"
    try:
        return f"OOM score {path.read_text('ascii').strip()}, no permission for {score}"
    except OSError:
        return "OOM score unknown"
