from pathlib import Path

from motionserver.core.safety.states import diagram

ROOT = Path(__file__).parents[2]


def test_the_documented_diagram_is_the_table():
    assert diagram() in (ROOT / "deploy" / "states.md").read_text("utf-8")
