"""What a kept result depends on: all code that makes it, and no other."""

import ast
import tomllib
from pathlib import Path

import motionserver
from motionserver.evaluate.tune import cache

ROOT = Path(motionserver.__file__).parent


def hashed():
    return {path for pattern in cache._SOURCES for path in ROOT.glob(pattern)}


def imported(path):
    """Files of the server that a file imports."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{one.name}" for one in node.names)]
        for name in names:
            parts = name.split(".")
            file = ROOT.joinpath(*parts[1:]).with_suffix(".py")
            if parts[0] == "motionserver" and len(parts) > 1 and file.is_file():
                yield file


def test_all_that_an_outcome_imports_is_part_of_its_key():
    seen, ahead = set(), [ROOT / "evaluate/tune/outcome.py"]
    while ahead:
        path = ahead.pop()
        if path not in seen:
            seen.add(path)
            ahead += imported(path)
    assert len(seen) > 40
    assert {path.relative_to(ROOT).as_posix() for path in seen - hashed()} == set()


def test_what_only_draws_spoils_nothing():
    drawn = {ROOT / "evaluate" / f"{name}.py" for name in ("page", "report", "svg", "options")}
    assert all(path.is_file() for path in drawn)
    assert drawn & hashed() == set()


def test_every_library_that_solves_counts():
    project = tomllib.loads((ROOT.parent / "pyproject.toml").read_text("utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["hpipm"]]
    names = {line.split(">")[0] for line in wanted}
    assert set(cache._LIBRARIES) <= names
    assert {"daqp", "osqp", "piqp", "casadi", "numpy", "scipy"} <= set(cache._LIBRARIES)
