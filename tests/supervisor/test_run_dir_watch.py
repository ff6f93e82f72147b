"""A run directory that is removed, wholly or in part, is noticed; what can be is put back."""

import logging
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from motionserver.supervisor.run_dir_watch import RunDirWatch
from motionserver.telemetry.run_files import RunFiles


@pytest.fixture
def watch(tmp_path: Path) -> Iterator[RunDirWatch]:
    run_dir = tmp_path / "run"
    run_dir.mkdir()
    (run_dir / "config.json").write_text("{}", "utf-8")
    (run_dir / "service.lock").touch()
    files = RunFiles(run_dir)
    files.take("config.json", run_dir / "config.json")
    bind(run_dir, "guard")
    bind(run_dir, "planner")
    made = RunDirWatch(run_dir, files)
    assert made.look() == ""
    yield made
    files.close()


def bind(run_dir: Path, name: str) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(str(run_dir / f"{name}.sock"))


def test_a_directory_that_was_removed_is_lost(tmp_path: Path, watch: RunDirWatch) -> None:
    shutil.rmtree(tmp_path / "run")
    assert watch.look() == f"the run directory {tmp_path}/run was removed"


def test_a_directory_that_was_put_in_its_place_is_not_it(
    tmp_path: Path, watch: RunDirWatch
) -> None:
    (tmp_path / "run").rename(tmp_path / "aside")
    (tmp_path / "run").mkdir()
    assert "was removed" in watch.look()


@pytest.mark.parametrize("name", ["guard.sock", "service.lock"])
def test_what_the_operator_needs_is_lost_when_it_stays_away(
    tmp_path: Path, watch: RunDirWatch, name: str
) -> None:
    (tmp_path / "run" / name).unlink()
    assert watch.look() == ""
    assert watch.look() == f"{tmp_path}/run/{name} was removed"


def test_a_socket_that_another_process_takes_over_is_not_lost(
    tmp_path: Path, watch: RunDirWatch
) -> None:
    (tmp_path / "run" / "guard.sock").unlink()
    assert watch.look() == ""
    bind(tmp_path / "run", "guard")
    assert watch.look() == watch.look() == ""


def test_what_moves_nothing_is_told_or_put_back(
    tmp_path: Path, watch: RunDirWatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("planner.sock", "config.json"):
        (tmp_path / "run" / name).unlink()
    with caplog.at_level(logging.WARNING):
        assert [watch.look() for _ in range(4)] == [""] * 4
    assert (tmp_path / "run" / "config.json").read_text("utf-8") == "{}"
    assert sum("no tuning" in line for line in caplog.messages) == 1
    assert sum("put back" in line for line in caplog.messages) == 1
