"""The run directory: only a new, an empty or a marked folder is used; nothing else is touched."""

import os
import stat

import pytest

from motionserver.errors import ConfigError
from motionserver.supervisor.rundir import MARKER, clean, foreign_content, take


def somebodys_folder(path):
    """A home-like folder with files of the names that a run leaves behind."""
    path.mkdir(mode=0o755)
    path.chmod(0o755)
    for name in ("config.json", "web.json", "tuning.json", "our.map", "guard.map", "letter.odt"):
        (path / name).write_text(f"mine: {name}")
    (path / "blackbox").mkdir()
    (path / "blackbox" / "flight.dat").write_text("mine")
    (path / ".profile").write_text("mine")
    return path


def content(path):
    return {
        str(one.relative_to(path)): one.read_bytes() if one.is_file() else None
        for one in path.rglob("*")
    }


def test_run_dir_somebodys_folder_is_refused_and_untouched(tmp_path):
    home = somebodys_folder(tmp_path / "home")
    before = content(home)
    with pytest.raises(ConfigError) as caught:
        take(home)
    assert caught.value.where == "[server] run_dir"
    assert "config.json" in str(caught.value)
    assert MARKER in str(caught.value)
    assert content(home) == before
    assert stat.S_IMODE(home.stat().st_mode) == 0o755
    assert foreign_content(home)


def test_run_dir_clean_in_somebodys_folder_deletes_nothing(tmp_path):
    """Even a caller that has not taken the folder cannot empty it."""
    home = somebodys_folder(tmp_path / "home")
    before = content(home)
    clean(home)
    assert content(home) == before


@pytest.mark.parametrize("name", ["config.json", ".bashrc", "lost+found", "service.lock"])
def test_run_dir_with_any_single_entry_is_refused(tmp_path, name):
    folder = tmp_path / "some"
    folder.mkdir(mode=0o755)
    (folder / name).write_text("")
    with pytest.raises(ConfigError, match="holds"):
        take(folder)
    assert [one.name for one in folder.iterdir()] == [name]


@pytest.mark.parametrize("made", [False, True], ids=["new", "empty"])
def test_run_dir_new_or_empty_is_marked_and_taken_again(tmp_path, made):
    folder = tmp_path / "run"
    if made:
        folder.mkdir(mode=0o755)
    take(folder).close()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert (folder / MARKER).is_file()
    for name in ("config.json", "guard.map", "guard.sock"):
        (folder / name).write_text("left by a run")
    assert foreign_content(folder) == []
    take(folder).close()
    clean(folder)
    assert {one.name for one in folder.iterdir()} == {MARKER, "service.lock"}


def test_run_dir_marker_that_is_no_file_of_ours_marks_nothing(tmp_path):
    for kind in ("text", "link", "folder", "fifo"):
        folder = tmp_path / kind
        folder.mkdir()
        (folder / "config.json").write_text("mine")
        if kind == "text":
            (folder / MARKER).write_text("something else")
        elif kind == "link":
            take(tmp_path / "own").close()
            (folder / MARKER).symlink_to(tmp_path / "own" / MARKER)
        elif kind == "folder":
            (folder / MARKER).mkdir()
        else:
            os.mkfifo(folder / MARKER)
        with pytest.raises(ConfigError, match="holds"):
            take(folder)
        assert (folder / "config.json").read_text() == "mine"


def test_run_dir_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ConfigError, match="run_dir"):
        take(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"
