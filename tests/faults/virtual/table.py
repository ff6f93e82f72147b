"""The table of faults with measured reactions, as Markdown: python table.py FILE.jsonl."""

import json
import statistics
import sys
from pathlib import Path

from fault_list import FAULTS, FORESEEN

HEAD = """# What can go wrong, and what was measured

Each fault of the list is played on a clock of its own: the server's own loops, a client, and the
emulated base with its own state machine and faults, by seed. Reaction times are from the onset of
the fault, or, where the table says so, from the last packet or the end of a stall, and are in
milliseconds of that clock. Violations are those the base's judge counted. Written by

    MOTION_CAMPAIGN=FILE pytest -m campaign tests/faults/virtual/test_faults_campaign.py
    python tests/faults/virtual/table.py FILE

| fault | detection | reaction | recovery | bound | median | worst | scenes | violations |
|---|---|---|---|---|---|---|---|---|
"""


def rows(outcomes):
    for number, cls in sorted(FAULTS.items()):
        mine = [one for one in outcomes if one["names"] == [f"F{number}"]]
        took = [1e3 * v for one in mine for v in one["took"].values() if v is not None]
        bound = [1e3 * v for one in mine for v in one["bounds"].values()]
        figures = ("-", "-", "-")
        if getattr(cls, "is_unseen", False):
            figures = ("none", "none", "none")
        elif took:
            figures = tuple(f"{v:.0f} ms" for v in (max(bound), statistics.median(took), max(took)))
        cells = (
            f"F{number} {cls.title}",
            cls.detection,
            cls.reaction,
            cls.recovery,
            *figures,
            str(len(mine)),
            str(sum(one["violations"] for one in mine)),
        )
        yield "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"


def markdown(outcomes):
    """The whole document."""
    two = [one for one in outcomes if len(one["names"]) == 2]
    out = HEAD + "\n".join(rows(outcomes)) + "\n"
    if two:
        violations = sum(one["violations"] for one in two)
        out += f"\n{len(two)} random pairs of faults that overlap: {violations} violations.\n"
        for numbers, why in FORESEEN.items():
            names = [f"F{number}" for number in numbers]
            seen = sum(one["violations"] for one in two if one["names"] == names)
            out += f"\n{seen} of them are foreseen, {' with '.join(names)}: {why}.\n" * bool(seen)
    return out


if __name__ == "__main__":
    lines = Path(sys.argv[1]).read_text("utf-8").splitlines()
    sys.stdout.write(markdown([json.loads(line) for line in lines]))
