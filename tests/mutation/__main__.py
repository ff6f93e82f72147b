"""`python -m mutation run FILE...`: the mutants of these files, and what became of them."""

import argparse
import json
import os
import sys
import tempfile
import time
import tomllib
import traceback
from collections import Counter
from pathlib import Path

import pytest
from mutation import farm
from mutation.children import each
from mutation.mutants import Mutant, mutants_of, unchanged

ROOT = Path(__file__).parents[2]
ALIVE = ("survived", farm.NEVER)
NAMED = Path(__file__).with_name("equivalent.toml")
INTAKE = "motionserver/core/intake"
SAFETY = "motionserver/core/safety"
SUITES = {
    "protocol/motion_protocol": ["tests/protocol"],
    f"{INTAKE}/agreement.py": ["tests/intake/test_agreement.py"],
    f"{INTAKE}/freshness.py": ["tests/intake/test_freshness.py"],
    f"{INTAKE}/gate.py": [
        "tests/intake/test_gate.py",
        "tests/intake/test_gate_limits.py",
        "tests/intake/test_plausibility.py",
        "tests/intake/test_sequence_order.py",
        "tests/intake/test_spoilage.py",
    ],
    f"{INTAKE}/intake.py": [
        "tests/intake/test_intake.py",
        "tests/intake/test_intake_limits.py",
    ],
    f"{INTAKE}/plausibility.py": [
        "tests/intake/test_gravity_at_standstill.py",
        "tests/intake/test_plausibility.py",
    ],
    f"{INTAKE}/ranges.py": [
        "tests/intake/test_gate.py",
        "tests/intake/test_gate_limits.py",
        "tests/intake/test_ranges.py",
    ],
    f"{INTAKE}/sender_clock.py": [
        "tests/intake/test_gate.py",
        "tests/intake/test_gate_limits.py",
        "tests/intake/test_late_packets.py",
        "tests/intake/test_sender_clock.py",
    ],
    f"{INTAKE}/sequence_order.py": [
        "tests/intake/test_gate.py",
        "tests/intake/test_sequence_order.py",
    ],
    f"{INTAKE}/spoilage.py": ["tests/intake/test_spoilage.py"],
    f"{INTAKE}/stamp_rate.py": ["tests/intake/test_stamp_rate.py"],
    f"{INTAKE}/standstill.py": ["tests/intake/test_standstill_force.py"],
    INTAKE: ["tests/intake"],
    "motionserver/core/plan.py": [
        "tests/core/test_plan.py",
        "tests/core/safety/test_shape.py",
        "tests/core/safety/test_verify.py",
    ],
    "motionserver/core/motion": ["tests/core/motion"],
    "motionserver/guard/send_grid.py": ["tests/guard/test_send_grid.py"],
    "motionserver/planner/handover.py": ["tests/planner/test_handover.py"],
    "motionserver/planner/open_proposals.py": ["tests/planner/test_open_proposals.py"],
    f"{SAFETY}/patient.py": ["tests/core/safety/test_patient.py"],
    f"{SAFETY}/slices.py": ["tests/core/safety/test_slices.py"],
    f"{SAFETY}/accept.py": [
        "tests/core/safety/test_accept.py",
        "tests/core/safety/test_accept_bounds.py",
    ],
    f"{SAFETY}/act.py": [
        "tests/core/safety/test_act.py",
        "tests/core/safety/test_act_enters.py",
        "tests/core/safety/test_act_told.py",
        "tests/core/safety/test_ending.py",
        "tests/core/safety/test_guard_restarts.py",
    ],
    f"{SAFETY}/edges.py": ["tests/core/safety/test_edges.py"],
    f"{SAFETY}/ending.py": ["tests/core/safety/test_ending.py"],
    f"{SAFETY}/fault_return.py": [
        "tests/core/safety/test_fault_orders.py",
    ],
    f"{SAFETY}/given.py": ["tests/core/safety/test_record.py"],
    f"{SAFETY}/inherit.py": ["tests/core/safety/test_inherit_rules.py"],
    f"{SAFETY}/own_moves.py": [
        "tests/core/safety/test_act_enters.py",
        "tests/core/safety/test_fault_return.py",
        "tests/core/safety/test_guard_resets.py",
        "tests/core/safety/test_guard_restarts.py",
    ],
    f"{SAFETY}/record.py": ["tests/core/safety/test_record.py"],
    f"{SAFETY}/return_decision.py": ["tests/core/safety/test_return_decision.py"],
    f"{SAFETY}/shape.py": ["tests/core/safety/test_shape.py", "tests/core/safety/test_verify.py"],
    f"{SAFETY}/source_reason.py": ["tests/core/safety/test_supervisor_source.py"],
    f"{SAFETY}/states.py": [
        "tests/core/safety/test_states.py",
        "tests/house/test_state_diagram.py",
    ],
    f"{SAFETY}/supervisor.py": [
        "tests/core/safety/test_leave_reason.py",
        "tests/core/safety/test_supervisor.py",
        "tests/core/safety/test_supervisor_source.py",
    ],
    f"{SAFETY}/verdict.py": ["tests/core/safety/test_verdict.py"],
    f"{SAFETY}/verify.py": [
        "tests/core/safety/test_verify.py",
        "tests/core/safety/test_verify_limits.py",
        "tests/core/safety/test_verify_slices.py",
        "tests/core/safety/test_verify_told.py",
    ],
    f"{SAFETY}/watchdog.py": ["tests/core/safety/test_watchdog.py"],
    f"{SAFETY}/will.py": ["tests/core/safety/test_will.py"],
    SAFETY: ["tests/core/safety"],
}
"""Which tests must kill the mutants of which files: those near them; the first that fits counts."""


def files_under(names: list[str]) -> list[str]:
    """Source files that are meant, all judged ones if none is named."""
    paths = [ROOT / name for name in names or SUITES]
    found = [file for path in paths for file in (sorted(path.glob("*.py")) or [path])]
    return list(dict.fromkeys(str(file.relative_to(ROOT)) for file in found))


def suite_of(file: str) -> list[str]:
    """The tests for a file."""
    return next(tests for part, tests in SUITES.items() if file.startswith(part))


def named() -> dict[str, str]:
    """Mutants that change no behaviour, with the reason."""
    groups = tomllib.loads(NAMED.read_text("utf-8"))["equivalent"]
    return {
        f"{group['in']}: {change}": group["reason"]
        for group in groups
        for change in group["changes"]
    }


def tried(mutants: list[Mutant], tests: list[str], workers: int) -> dict[str, str]:
    """What became of each: the test that killed it, "died", "late", "survived"..."""
    with tempfile.NamedTemporaryFile(suffix=".jsonl") as out:
        pid = os.fork()
        if not pid:
            try:
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                plugin = farm.Collected(ROOT, mutants, workers, Path(out.name))
                os._exit(int(pytest.main([*farm.OPTIONS, *tests], plugins=[plugin])))
            except BaseException:
                traceback.print_exc()
            os._exit(2)
        if os.waitpid(pid, 0)[1]:
            sys.exit(f"the tests {tests} do not pass as they are, or cannot be collected")
        lines = Path(out.name).read_text().splitlines()
    seconds, passed = json.loads(lines[0])
    fates = dict(json.loads(line) for line in lines[1:])

    def anew(mutant: Mutant) -> str:
        near = {name for names in passed[mutant.file].values() for name in names}
        order = sorted(seconds, key=lambda name: (name not in near, seconds[name]))
        return farm.try_anew(ROOT, mutant, order, seconds)

    # what lives may have done its work at import, before it was exchanged
    outer = [m for m in mutants if not m.function or fates[m.name] in ALIVE]
    for _, said in each([unchanged(ROOT, m.file) for m in outer[:1]], anew, 1, farm.PATIENCE):
        if said != "survived":
            sys.exit(f"fails without any change: {said}")
    return fates | {mutant.name: said for mutant, said in each(outer, anew, workers, farm.PATIENCE)}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m mutation", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, about in (("run", "try the mutants"), ("list", "write the mutants down")):
        command = commands.add_parser(name, help=about)
        command.add_argument("files", nargs="*", help="files or folders; all judged ones if none")
        command.add_argument(
            "--match", default="", help="only mutants with this text in their name"
        )
    commands.choices["run"].add_argument("--again", help="only those a saved report shows as open")
    commands.choices["run"].add_argument("--tests", nargs="+", help="instead of the suite")
    commands.choices["run"].add_argument("--workers", type=int, default=2)
    commands.choices["run"].add_argument("--named", action="store_true", help="named ones as well")
    commands.choices["run"].add_argument("--killers", action="store_true", help="who killed what")
    given = parser.parse_args()
    os.chdir(ROOT)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    known, files = named(), files_under(given.files)
    mutants = [m for file in files for m in mutants_of(ROOT, file) if given.match in m.name]
    if given.command == "list":
        print(*(f"{m.name}  [line {m.line}]" for m in mutants), sep="\n")
        return 0
    names = {mutant.name for mutant in mutants}
    if given.again:
        once = Path(given.again).read_text("utf-8").split("\nopen:\n")[1]
        mutants = [m for m in mutants if f"  {m.name}  [" in once]
    gone = [name for name in known if name.split(":")[0] in files and name not in names]
    gone = [] if given.match else gone
    farm.preload()
    fates: dict[str, str] = {}
    began = time.monotonic()
    suites = {m.name: tuple(given.tests or suite_of(m.file)) for m in mutants}
    for tests in dict.fromkeys(suites.values()):
        mine = [m for m in mutants if suites[m.name] == tests]
        mine = [m for m in mine if given.named or m.name not in known]
        fates |= tried(mine, list(tests), given.workers) if mine else {}
    alive = {name for name, said in fates.items() if said in ALIVE}
    wrong = [name for name in known if name in fates and name not in alive]
    _table(mutants, fates, known, alive)
    print(f"{len(fates)} tried in {time.monotonic() - began:.0f} s")
    if given.killers:
        print(*(f"{name}  <- {said}" for name, said in fates.items()), sep="\n")
    for title, some in (
        ("open", [f"{m.name}  [line {m.line}] {fates[m.name]}" for m in mutants
                  if m.name in alive - known.keys()]),
        ("named as equivalent, but killed", wrong),
        ("named as equivalent, but there is no such mutant", gone),
    ):  # fmt: skip
        if some:
            print(f"\n{title}:", *some, sep="\n  ")
    return 1 if alive - known.keys() or wrong or gone else 0


def _table(mutants: list[Mutant], fates: dict[str, str], known: dict[str, str], alive: set[str]):
    print(f"{'file':48s} {'mutants':>8s} {'killed':>7s} {'equivalent':>11s} {'open':>5s}")
    rows: dict[str, Counter[str]] = {}
    for mutant in mutants:
        row = rows.setdefault(mutant.file, Counter())
        name = mutant.name
        kind = "equivalent" if name in known else "open" if name in alive else "killed"
        row.update(["mutants", kind])
    rows["all"] = sum(rows.values(), Counter())
    for file, row in rows.items():
        print(
            f"{file:48s} {row['mutants']:8d} {row['killed']:7d} {row['equivalent']:11d} "
            f"{row['open']:5d}"
        )


if __name__ == "__main__":
    sys.exit(main())
