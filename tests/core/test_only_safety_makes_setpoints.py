"""Walks the syntax trees: accepted plans and setpoints are made in core/safety and nowhere else."""

import ast
from pathlib import Path

import motionserver

ROOT = Path(motionserver.__file__).parent
GUARDED = {"AcceptedPlan", "Setpoint"}


def makers(tree):
    """Names of guarded classes that a module calls, also under another name or by `replace`."""
    alias = {name: name for name in GUARDED}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            alias |= {n.asname: n.name for n in node.names if n.asname and n.name in GUARDED}
        value = getattr(node, "value", None)
        if isinstance(node, ast.Assign) and getattr(value, "id", "") in alias:
            alias |= {t.id: value.id for t in node.targets if isinstance(t, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = node.func
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name in alias or name in GUARDED:
                yield alias.get(name, name)
        if isinstance(node, ast.ClassDef):
            bases = {getattr(base, "id", getattr(base, "attr", "")) for base in node.bases}
            yield from bases & set(alias)


def test_nobody_else_makes_them():
    found = {}
    for path in ROOT.rglob("*.py"):
        names = set(makers(ast.parse(path.read_text("utf-8"))))
        if names:
            found[path.relative_to(ROOT).as_posix()] = names
    assert found
    assert all(path.startswith("core/safety/") for path in found), found
    assert set().union(*found.values()) == GUARDED


def test_the_walk_sees_through_other_names():
    for source in (
        "Setpoint(1)",
        "setpoint.Setpoint(1)",
        "from a import AcceptedPlan as Plan\nPlan(1)",
        "Other = Setpoint\nOther(1)",
        "class Mine(AcceptedPlan): pass",
    ):
        assert set(makers(ast.parse(source))) & GUARDED or "Mine" in source, source
    assert list(makers(ast.parse("class Mine(AcceptedPlan): pass"))) == ["AcceptedPlan"]
    assert not list(makers(ast.parse("x: Setpoint = make()")))
