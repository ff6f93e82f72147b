"""How tests are spread over workers: those of a file that starts processes stay together.

Written here because the groups of pytest-xdist 3.8 have no effect with pytest 9.2, which makes a
test's name from its place.
"""

import re
from functools import cache
from pathlib import Path

from xdist.scheduler import LoadScopeScheduling

STARTERS = re.compile(
    r"^ *(?:from|import) (?:subprocess|rig|web_process|cabled|far_ends|browser\.chromium)\b", re.M
)
"""Imports by which a test module shows that it starts processes."""
ROOT = Path(__file__).parents[1]


class ProcessesTogether(LoadScopeScheduling):
    """Hands out whole files of tests of real processes, and every other test by itself.

    Such tests mostly wait: with all of them on one worker of two the other one is done long before.
    """

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0]
        return path if starts_processes(path) else nodeid


@cache
def starts_processes(path: str) -> bool:
    """True if the tests of a file start processes."""
    return STARTERS.search((ROOT / path).read_text("utf-8")) is not None
