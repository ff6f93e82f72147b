"""Both algorithms move the base in both modes, softly, and park when told to end."""

import signal
from pathlib import Path

import pytest
from rig import Rig, assert_soft

WAY = [
    ("OFFLINE", "PARKED"),
    ("PARKED", "RAISING"),
    ("RAISING", "READY"),
    ("READY", "RUN"),
]


@pytest.mark.parametrize("mode", ["length", "dof"])
@pytest.mark.parametrize("algorithm", ["classical", "thondel2014"])
def test_a_drive_moves_the_base_within_its_limits(
    tmp_path: Path, algorithm: str, mode: str
) -> None:
    config = {"cueing": {"algorithm": algorithm}, "platform": {"mode": mode}}
    number = signal.SIGTERM if mode == "length" else signal.SIGINT
    with Rig(tmp_path, config) as rig:
        rig.run()
        rig.wait_plans(120)
        assert rig.shown("planner")["algorithm"] == algorithm
        assert rig.end(number) == 0
        assert rig.transitions()[:4] == WAY
        assert rig.transitions()[-1] == ("PARKING", "PARKED")
        assert rig.leftovers() == []
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert verdict["speed_max"] > 0.02
    assert verdict["positions_obeyed"] > 120
