"""Python, libraries, optional solvers, BLAS threads and the clock of day, in every level."""

import re
import tomllib
from pathlib import Path

import pytest

from motionserver.doctor import mends
from motionserver.doctor.clocks import clock_of_day
from motionserver.doctor.finding import Level
from motionserver.doctor.measure import ClockOfDay, timer_resolution
from motionserver.doctor.measure import clock_of_day as read_clock
from motionserver.doctor.software import (
    OLDEST_PYTHON,
    REQUIRED,
    THREADS,
    Software,
    blas_threads,
    installed,
    libraries,
    numbers,
    optional_backends,
    python,
)

ROOT = Path(__file__).parents[2]
GOOD = Software((3, 11, 7), REQUIRED, {"hpipm": True})


def test_the_versions_are_those_the_package_asks_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert dict(entry.split(">=") for entry in project["dependencies"]) == REQUIRED
    assert project["requires-python"] == ">=" + ".".join(map(str, OLDEST_PYTHON))


def test_the_variables_are_those_the_service_sets():
    text = (ROOT / "motionserver/supervisor/child.py").read_text("utf-8")
    assert set(re.findall(r"\w+_NUM_THREADS", text)) == set(THREADS)


def test_what_is_installed_here():
    there = installed()
    assert all(there.libraries.values())
    assert libraries(there).level is Level.OK
    assert set(there.backends) == {"hpipm"}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("2.4.6", (2, 4, 6)),
        ("1.0rc1", (1, 0)),
        ("0.165.0.post1", (0, 165, 0)),
        ("2", (2,)),
        ("x", ()),
    ],
)
def test_numbers_of_a_version(text, parts):
    assert numbers(text) == parts


@pytest.mark.parametrize(
    ("version", "level"),
    [((3, 11, 0), Level.OK), ((3, 14, 1), Level.OK), ((3, 10, 9), Level.PROBLEM)],
)
def test_python_levels(version, level):
    finding = python(Software(version, {}, {}))
    assert finding.level is level
    assert bool(finding.mend) == (level is Level.PROBLEM)


@pytest.mark.parametrize(
    ("change", "level", "found", "mend"),
    [
        ({}, Level.OK, "numpy 2.0, scipy 1.13", ""),
        ({"numpy": "10.0"}, Level.OK, "numpy 10.0", ""),
        ({"numpy": "1.26.4"}, Level.PROBLEM, "numpy 1.26.4, 2.0 or newer wanted", "'numpy>=2.0'"),
        ({"daqp": None}, Level.PROBLEM, "daqp missing", "'daqp>=0.7'"),
        (
            {"daqp": None, "typer": "0.9"}, Level.PROBLEM,
            "daqp missing; typer 0.9, 0.15 or newer wanted", "'daqp>=0.7' 'typer>=0.15'",
        ),
    ],
)  # fmt: skip
def test_library_levels(change, level, found, mend):
    finding = libraries(Software((3, 11, 7), {**REQUIRED, **change}, {}))
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend.endswith(f"-m pip install {mend}" if mend else "")


@pytest.mark.parametrize(
    ("there", "wanted", "level", "found"),
    [
        (True, None, Level.OK, "hpipm present"),
        (True, "hpipm", Level.OK, "hpipm present"),
        (False, None, Level.OK, "hpipm absent"),
        (False, "daqp", Level.OK, "hpipm absent"),
        (False, "hpipm", Level.PROBLEM, "hpipm absent; the configuration wants hpipm"),
    ],
)
def test_optional_solver_levels(there, wanted, level, found):
    finding = optional_backends(Software((3, 11, 7), {}, {"hpipm": there}), wanted)
    assert (finding.level, finding.found) == (level, found)
    assert ("motionserver[hpipm]" in finding.mend) == (level is Level.PROBLEM)


@pytest.mark.parametrize(
    ("environment", "level", "mend"),
    [
        ({}, Level.OK, ""),
        ({"OMP_NUM_THREADS": "1"}, Level.OK, ""),
        ({"OMP_NUM_THREADS": "8"}, Level.WARNING, "unset OMP_NUM_THREADS"),
        (
            {"OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "4"}, Level.WARNING,
            "unset OPENBLAS_NUM_THREADS MKL_NUM_THREADS",
        ),
    ],
)  # fmt: skip
def test_blas_levels(environment, level, mend):
    finding = blas_threads({"PATH": "/bin", **environment})
    assert (finding.level, finding.mend) == (level, mend)


NOW = 1_790_000_000.0  # 2026-09-21


@pytest.mark.parametrize(
    ("clock", "level", "found"),
    [
        (ClockOfDay(NOW, True), Level.OK, "2026-09-21 14:13:20 UTC, synchronised"),
        (ClockOfDay(NOW, False), Level.ADVICE, "2026-09-21 14:13:20 UTC, not synchronised"),
        (ClockOfDay(NOW, None), Level.UNKNOWN, "2026-09-21 14:13:20 UTC; the kernel does not say"),
        (ClockOfDay(0.0, True), Level.WARNING, "0 s after 1970"),
        (ClockOfDay(1_767_225_599.0, True), Level.WARNING, "1767225599 s after 1970"),
        (ClockOfDay(1_767_225_600.0, True), Level.OK, "2026-01-01 00:00:00 UTC"),
        (ClockOfDay(5e9, True), Level.WARNING, "5000000000 s after 1970"),
    ],
)
def test_clock_of_day_levels(clock, level, found):
    finding = clock_of_day(clock)
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend == (mends.CLOCK if level in (Level.ADVICE, Level.WARNING) else "")


def test_the_machine_tells_its_clocks():
    assert read_clock().synchronised in (True, False, None)
    assert 0.0 < timer_resolution() < 1.0
