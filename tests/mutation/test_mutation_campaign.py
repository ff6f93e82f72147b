"""Every mutant of the judged code is killed by a test or named as a change of nothing."""

import os
import subprocess
import sys

import pytest
from mutation.__main__ import ROOT


@pytest.mark.campaign
@pytest.mark.timeout(0)
def test_no_mutant_lives():
    """MUTATION_FILES chooses files or folders; all that are judged if it is empty."""
    paths = os.pathsep.join(str(ROOT / part) for part in (".", "protocol", "clients", "tests"))
    files = os.environ.get("MUTATION_FILES", "").split()
    done = subprocess.run(
        [sys.executable, "-m", "mutation", "run", *files],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": paths},
        text=True,
        capture_output=True,
    )
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
