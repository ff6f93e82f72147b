"""What holds for all tests: how they are spread, and that none is judged by how long it took."""

import os

import pytest
from hypothesis import settings

# more threads in the many small products of a period cost several times what they gain
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")


@pytest.fixture
def tmp_path(tmp_path_factory):
    """A folder with a short path: a unix socket's has room for 107 bytes."""
    return tmp_path_factory.mktemp("t")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Run campaigns in this process: they print what they measure while they run."""
    if config.option.markexpr and "not campaign" not in config.option.markexpr:
        config.option.numprocesses, config.option.dist, config.option.tx = 0, "no", []


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Spread the tests over the workers, those of real processes on one of them."""
    from worker_schedule import ProcessesTogether

    return ProcessesTogether(config, log)
