"""What holds for all tests: how they are spread, and that none is judged by how long it took."""

import os

import pytest
from hypothesis import settings

# more threads in the many small products of a period cost several times what they gain
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")

PROCESSES = "processes"
"""Tests that start processes of their own: one after the other, on one worker."""
_STARTERS = {"subprocess", "rig", "web_process", "cabled", "far_ends"}
"""Modules whose use in a test module means that it starts processes."""


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Run campaigns in this process: they print what they measure while they run."""
    if config.option.markexpr and "not campaign" not in config.option.markexpr:
        config.option.numprocesses, config.option.dist, config.option.tx = 0, "no", []


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Put the tests that start processes into one group."""
    starts = {}
    for item in items:
        module = item.module
        if module not in starts:
            starts[module] = starts_processes(module)
        if starts[module]:
            item.add_marker(pytest.mark.xdist_group(PROCESSES))


def starts_processes(module):
    """True if a test module uses what starts processes."""
    used = {name for value in vars(module).values() for name in _home(value)}
    return not used.isdisjoint(_STARTERS)


def _home(value):
    return {getattr(value, "__module__", None), getattr(value, "__name__", None)}
