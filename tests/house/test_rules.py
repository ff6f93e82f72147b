"""The house keeps its rules: imports, sizes, docstrings, words, version."""

import ast
import re
import tomllib
from pathlib import Path

import pytest
from importlinter.api import read_configuration
from importlinter.cli import lint_imports

import motionserver

ROOT = Path(__file__).parents[2]
CODE = sorted(
    path for top in ("motionserver", "protocol", "clients") for path in (ROOT / top).rglob("*.py")
)
OURS = sorted(
    path
    for top in ("motionserver", "protocol", "clients", "tests", "deploy")
    for path in (ROOT / top).rglob("*")
    if path.suffix in {".py", ".md", ".toml", ".js", ".css", ".html", ".h", ".c", ".cs", ".lua"}
    and not {"vendor", "corpus"} & set(path.parts)
    and "__pycache__" not in path.parts
)
LONGEST = 300
LONGER = frozenset[str]()
"""Files that may be longer, each with a reason beside its name."""
FORBIDDEN = tuple("".join(parts) for parts in (("TO", "DO"), ("FIX", "ME"), ("X", "XX")))


def name_of(path):
    return path.relative_to(ROOT).as_posix()


def test_there_is_something_to_look_at():
    assert len(CODE) > 100
    assert len(OURS) > len(CODE)


def test_imports_point_one_way(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    # its way of logging would silence every logger of ours in the tests that follow
    monkeypatch.setattr("logging.config.dictConfig", lambda config: None)
    for folder in (".", "protocol", "clients"):
        monkeypatch.syspath_prepend(str(ROOT / folder))
    assert len(read_configuration("pyproject.toml")["contracts_options"]) >= 6
    status = lint_imports("pyproject.toml", no_cache=True)
    assert status == 0, capsys.readouterr().out


@pytest.mark.parametrize("path", CODE, ids=name_of)
def test_files_are_short_and_say_what_they_are(path):
    text = path.read_text("utf-8")
    assert len(text.splitlines()) <= LONGEST or name_of(path) in LONGER
    assert ast.get_docstring(ast.parse(text)), "no docstring"


def test_files_that_may_be_longer_are():
    for name in LONGER:
        assert len((ROOT / name).read_text("utf-8").splitlines()) > LONGEST, name


def test_nothing_is_left_for_later():
    word = re.compile(r"\b(" + "|".join(FORBIDDEN) + r")\b")
    found = [
        f"{name_of(path)}:{number}"
        for path in OURS
        for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1)
        if word.search(line)
    ]
    assert found == []


def test_one_version_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["version"] == motionserver.__version__
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    headings = re.findall(r"^## \[?([^\]\s]+)", changes, re.MULTILINE)
    assert headings[:1] == ["Unreleased"] or headings[:1] == [motionserver.__version__]
