"""The kernel's order of killing, asked for in a child so that the tests' own stays."""

import subprocess
import sys

PROGRAM = """
import sys
from motionserver.telemetry.oom import set_oom_score
print(set_oom_score(int(sys.argv[1])))
print(open("/proc/self/oom_score_adj").read().strip())
"""


def asked_for(score: int) -> tuple[str, int]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(score)],
        env={"PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    told, found = done.stdout.splitlines()
    return told, int(found)


def test_a_helper_may_always_be_killed_first() -> None:
    assert asked_for(600) == ("OOM score 600", 600)


def test_what_is_in_force_is_told_whether_it_was_permitted_or_not() -> None:
    told, found = asked_for(-900)
    assert told in (f"OOM score {found}", f"OOM score {found}, no permission for -900")
    assert found == -900 or "no permission" in told
