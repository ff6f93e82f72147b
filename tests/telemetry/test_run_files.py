"""Files of a run lie in sealed memory: no name, no truncation and no removal reaches them."""

import errno
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.run_files import INHERITED, RunFiles, located, read_run_file


@pytest.fixture
def files(tmp_path: Path) -> Iterator[RunFiles]:
    run_dir = tmp_path / "run"
    run_dir.mkdir()
    MappedFile(run_dir / "x.map", 64).close()
    (run_dir / "config.json").write_text('{"a": 1}', "utf-8")
    made = RunFiles(run_dir)
    made.take("x.map", run_dir / "x.map")
    made.take("config.json", run_dir / "config.json", constant=True)
    yield made
    made.close()


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return tmp_path / "run"


def test_a_mapped_file_cannot_be_truncated_by_its_owner(files: RunFiles, run_dir: Path) -> None:
    writer, reader = MappedFile(run_dir / "x.map"), MappedFile(run_dir / "x.map")
    writer.write(b"one")
    for size in (0, 10, 1 << 20):
        with pytest.raises(OSError, match="not permitted") as caught:
            os.truncate(run_dir / "x.map", size)
        assert caught.value.errno == errno.EPERM
    with pytest.raises(OSError, match="not permitted"):
        (run_dir / "x.map").open("wb").close()
    # every page is still there: one that is not kills whoever touches it
    writer.write(b"two")
    assert reader.read() == (2, b"two")


def test_options_cannot_be_written_over(files: RunFiles, run_dir: Path) -> None:
    assert json.loads((run_dir / "config.json").read_text("utf-8")) == {"a": 1}
    descriptor = os.open(run_dir / "config.json", os.O_RDWR)
    with pytest.raises(OSError, match="not permitted"):
        os.pwrite(descriptor, b"x", 0)
    os.close(descriptor)
    assert (run_dir / "config.json").read_bytes() == b'{"a": 1}'


def test_a_child_reads_and_maps_what_it_inherits_without_the_directory(
    files: RunFiles, run_dir: Path
) -> None:
    here = MappedFile(run_dir / "x.map")
    shutil.rmtree(run_dir)
    told, descriptors = files.handed(lambda name: True)
    program = (
        "import os, sys; from pathlib import Path\n"
        "from motionserver.telemetry.mapped import MappedFile\n"
        "from motionserver.telemetry.run_files import located\n"
        "MappedFile(located(Path(sys.argv[1]), 'x.map')).write(b'child')\n"
        "print(located(Path(sys.argv[1]), 'config.json').read_text(), 'RUN_FILES' in os.environ)"
    )
    paths = os.pathsep.join(sys.path)
    done = subprocess.run(
        [sys.executable, "-c", program, str(run_dir)],
        env={**os.environ, "PYTHONPATH": paths, INHERITED: told},
        pass_fds=descriptors,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split("\n")[0] == '{"a": 1} False'
    assert here.read() == (1, b"child")


def test_what_is_not_inherited_is_found_by_name(run_dir: Path) -> None:
    assert located(run_dir, "x.map") == run_dir / "x.map"


def test_a_link_that_was_removed_is_put_back(files: RunFiles, run_dir: Path) -> None:
    assert files.repair_links() == []
    (run_dir / "x.map").unlink()
    assert files.repair_links() == ["x.map"]
    assert MappedFile(run_dir / "x.map").capacity == 64
    shutil.rmtree(run_dir)
    assert files.repair_links() == []


def test_a_link_to_something_else_is_no_mapped_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "x.map").symlink_to(tmp_path / "pipe")
    with pytest.raises(ValueError, match="not a mapped file"):
        MappedFile(tmp_path / "x.map")


def test_who_may_not_look_into_the_service_gets_its_descriptors(
    files: RunFiles, run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the service holds a capability that its reader has not."""
    opened = os.open

    def refuse(path: Path, flags: int, *more: int) -> int:
        if str(path).startswith(str(run_dir)):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return opened(path, flags, *more)

    def hand_out() -> None:
        for _ in range(3):
            link, _ = door.accept()
            with link:
                files.answer(link, link.recv(256))

    with files.open_door() as door:
        door.setblocking(True)
        server = threading.Thread(target=hand_out)
        server.start()
        monkeypatch.setattr(os, "open", refuse)
        assert MappedFile(run_dir / "x.map").capacity == 64
        assert read_run_file(run_dir, "config.json") == b'{"a": 1}'
        with pytest.raises(FileNotFoundError):
            read_run_file(run_dir, "secret")
        server.join()
