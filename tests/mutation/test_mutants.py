"""The mutants of a source file: what is changed, what is left alone, and names that last."""

import os
import subprocess
import sys

import pytest
from mutation.__main__ import ROOT, files_under, named
from mutation.children import each
from mutation.farm import Mutated, module_name
from mutation.mutants import mutants_of, unchanged

SOURCE = '''"""Prose."""
import os

LIMIT: int = 3


class Box:
    def room(self, used: int = 1) -> int:
        """More prose."""
        assert used >= 0
        if used > LIMIT:
            raise ValueError("too much of it")
        return LIMIT - used
'''
CHANGES = [
    ": LIMIT: int = 3 -> LIMIT: int = 4",
    ": LIMIT: int = 3 -> LIMIT: int = 0",
    "Box.room: used > LIMIT -> used >= LIMIT",
    "Box.room: used > LIMIT -> used <= LIMIT",
    "Box.room: raise ValueError('too much of it') -> pass",
    "Box.room: return LIMIT - used -> return None",
    "Box.room: LIMIT - used -> LIMIT + used",
]


@pytest.fixture
def names(tmp_path):
    def find(text):
        (tmp_path / "box.py").write_text(text)
        return {mutant.name for mutant in mutants_of(tmp_path, "box.py")}

    return find


def test_every_change_is_found_and_prose_is_left_alone(names):
    found = names(SOURCE)
    assert {f"box.py:{change}" for change in CHANGES} <= found
    assert len(found) == len(CHANGES) + 2  # the default argument, more and none
    assert not any("prose" in name or "assert" in name for name in found)


def test_names_last_when_lines_shift(names):
    assert names(SOURCE) == names(
        "# one more line\n\n" + SOURCE.replace("\nLIMIT:", "\n\n\nLIMIT:")
    )


def test_the_same_change_twice_has_two_names(names):
    found = names("def both(a, b):\n    return a + 1 if b else a + 1\n")
    assert {name for name in found if "#2" in name} == {
        f"box.py:both: a + 1 -> {new} #2" for new in ("a - 1", "a + 2", "a + 0")
    }


def test_a_mutant_behaves_as_its_name_says(tmp_path):
    (tmp_path / "box.py").write_text(SOURCE)
    by_name = {mutant.name: mutant for mutant in mutants_of(tmp_path, "box.py")}
    space = {}
    exec(by_name["box.py:Box.room: LIMIT - used -> LIMIT + used"].code, space)
    assert space["Box"]().room(2) == 5
    exec(unchanged(tmp_path, "box.py").code, space)
    assert space["Box"]().room(2) == 1


def test_a_module_is_imported_with_its_mutant(tmp_path, monkeypatch):
    (tmp_path / "box.py").write_text(SOURCE)
    mutant = next(m for m in mutants_of(tmp_path, "box.py") if "= 4" in m.name)
    monkeypatch.setattr(sys, "meta_path", [Mutated(tmp_path, mutant), *sys.meta_path])
    import box

    monkeypatch.delitem(sys.modules, "box")
    assert box.LIMIT == 4


def test_children_say_their_word_or_die():
    def work(task):
        return "yes" if task else str(1 / task)

    assert dict(each([0, 1, 2], work, 2, 60.0)) == {0: "died", 1: "yes", 2: "yes"}


def test_modules_bear_the_names_they_are_imported_by():
    assert module_name("protocol/motion_protocol/__init__.py") == "motion_protocol"
    assert module_name("motionserver/core/plan.py") == "motionserver.core.plan"


def test_every_named_mutant_exists_and_has_a_reason():
    known = named()
    files = {name.split(":")[0] for name in known}
    assert files <= set(files_under([]))
    assert known.keys() <= {mutant.name for file in files for mutant in mutants_of(ROOT, file)}
    assert all(len(reason) > 20 for reason in known.values())


def test_the_tool_tries_a_mutant_in_its_own_process():
    """However many workers tests have by default: those would run the code as it is."""
    paths = os.pathsep.join(str(ROOT / part) for part in (".", "protocol", "clients", "tests"))
    command = ["mutation", "run", "protocol/motion_protocol/sequence.py"]
    chosen = ["--match", "newer - older -> newer + older"]
    tests = ["--tests", "tests/protocol/test_codec.py", "--workers", "1"]
    done = subprocess.run(
        [sys.executable, "-m", *command, *chosen, *tests],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": paths},
        text=True,
        capture_output=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 tried" in done.stdout
