"""How tests are spread over workers: those that start processes run one after the other.

Written here because the groups of pytest-xdist 3.8 have no effect with pytest 9.2, which makes a
test's name from its place.
"""

import re
from functools import cache
from pathlib import Path

from xdist.scheduler import LoadScopeScheduling

PROCESSES = "tests that start processes"
STARTERS = re.compile(
    r"^ *(?:from|import) (?:subprocess|rig|web_process|cabled|far_ends|browser\.chromium)\b", re.M
)
"""Imports by which a test module shows that it starts processes."""
ROOT = Path(__file__).parents[1]


class ProcessesTogether(LoadScopeScheduling):
    """Gives one worker all tests of real processes, and hands out every other test by itself."""

    def _split_scope(self, nodeid: str) -> str:
        return PROCESSES if starts_processes(nodeid.partition("::")[0]) else nodeid


@cache
def starts_processes(path: str) -> bool:
    """True if the tests of a file start processes."""
    return STARTERS.search((ROOT / path).read_text("utf-8")) is not None
