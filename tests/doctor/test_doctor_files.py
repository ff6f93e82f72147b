"""Folders and files: real ones where permissions allow it, facts for every level."""

from dataclasses import replace
from pathlib import Path

import pytest

from motionserver.doctor import mends
from motionserver.doctor.finding import Level
from motionserver.doctor.folders import (
    RUN_SPACE,
    STATE_SPACE,
    Folder,
    look_at,
    run_directory,
    state_directory,
)
from motionserver.doctor.keyfiles import (
    KeyFile,
    enable_switch,
    look_at_file,
    secret_file,
    tls_key_file,
    token_file,
)
from motionserver.doctor.tree import Tree
from motionserver.telemetry.link import Maps

RUN = Folder(Path("/run/motionserver"), True, True, True, 100 << 20, "tmpfs", 0o700)
STATE = replace(RUN, path=Path("/var/lib/motionserver"), kind="ext4")


@pytest.mark.parametrize(
    ("change", "level", "found", "mend"),
    [
        ({}, Level.OK, "/run/motionserver: tmpfs, 100 MiB free", ""),
        ({"exists": False}, Level.OK, "/run/motionserver (to be made): tmpfs", ""),
        ({"free": None}, Level.OK, "/run/motionserver: tmpfs, space unknown", ""),
        ({"kind": "ext4"}, Level.ADVICE, "/run/motionserver: ext4", mends.RUN_DIR),
        ({"kind": "overlay"}, Level.ADVICE, "/run/motionserver: overlay", mends.RUN_DIR),
        ({"kind": "nfs4"}, Level.PROBLEM, "/run/motionserver: nfs4", mends.RUN_DIR),
        ({"kind": None}, Level.UNKNOWN, "/run/motionserver: file system unknown", ""),
        ({"mine": False}, Level.PROBLEM, "/run/motionserver belongs to another", "sudo chown"),
        ({"writable": False}, Level.PROBLEM, "/run/motionserver cannot be written", "sudo install"),
        (
            {"writable": False, "exists": False}, Level.PROBLEM,
            "/run/motionserver cannot be made", "sudo install -d",
        ),
        ({"free": RUN_SPACE}, Level.OK, "/run/motionserver: tmpfs, 16 MiB free", ""),
        (
            {"free": RUN_SPACE - (1 << 20)}, Level.PROBLEM,
            "/run/motionserver: tmpfs, 15 MiB free, 16 MiB needed", "df -h /run/motionserver",
        ),
        (
            {"path": Path("/run/" + "x" * 66)}, Level.PROBLEM,
            "/run/" + "x" * 66 + ": 71 bytes long, sockets allow 70", mends.RUN_DIR,
        ),
        (
            {"foreign": ("config.json", "letter.odt")}, Level.PROBLEM,
            "/run/motionserver holds config.json, letter.odt and no .motionserver-run",
            mends.RUN_DIR,
        ),
        ({"path": Path("/run/" + "x" * 65)}, Level.OK, "/run/" + "x" * 65 + ": tmpfs", ""),
    ],
)  # fmt: skip
def test_run_directory_levels(change, level, found, mend):
    finding = run_directory(replace(RUN, **change))
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend.startswith(mend)
    assert bool(finding.mend) == bool(mend)


@pytest.mark.parametrize(
    ("change", "level", "found", "mend"),
    [
        ({}, Level.OK, "/var/lib/motionserver: ext4, 100 MiB free", ""),
        ({"kind": "tmpfs"}, Level.ADVICE, "/var/lib/motionserver: tmpfs", "export MOTIONSERVER_"),
        ({"kind": None}, Level.OK, "/var/lib/motionserver: file system unknown", ""),
        ({"writable": False}, Level.PROBLEM, "/var/lib/motionserver cannot be written", "sudo"),
        ({"mine": False}, Level.PROBLEM, "/var/lib/motionserver belongs to another", "sudo chown"),
        (
            {"free": STATE_SPACE - 1}, Level.WARNING,
            "/var/lib/motionserver: ext4, 64 MiB free, 64 MiB needed", "df -h",
        ),
    ],
)  # fmt: skip
def test_state_directory_levels(change, level, found, mend):
    finding = state_directory(replace(STATE, **change))
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend.startswith(mend)
    assert bool(finding.mend) == bool(mend)


def test_a_real_folder_and_one_to_be_made(tmp_path):
    root = tmp_path / "root"
    (root / "proc/self").mkdir(parents=True)
    mounts = f"1 0 0:1 / / rw - ext4 a rw\n2 1 0:2 / {tmp_path}/run rw - tmpfs b rw\n"
    (root / "proc/self/mountinfo").write_text(mounts)
    there = tmp_path / "run"
    there.mkdir(mode=0o700)
    found = look_at(Tree(root), there)
    assert (found.exists, found.writable, found.mine, found.kind) == (True, True, True, "tmpfs")
    assert found.mode == 0o700
    assert found.free is not None
    deeper = look_at(Tree(root), there / "a/b")
    assert (deeper.exists, deeper.writable, deeper.kind, deeper.mode) == (
        False,
        True,
        "tmpfs",
        None,
    )
    assert not (there / "a").exists()
    assert look_at(Tree(root), tmp_path / "other").kind == "ext4"


def test_a_read_only_mount_and_a_file_in_the_way(tmp_path):
    root = tmp_path / "root"
    (root / "proc/self").mkdir(parents=True)
    (root / "proc/self/mountinfo").write_text(f"1 0 0:1 / {tmp_path} ro - ext4 a ro\n")
    assert look_at(Tree(root), tmp_path / "x").writable is False
    (tmp_path / "file").write_text("")
    (tmp_path / "file").chmod(0o700)
    assert look_at(Tree(tmp_path / "none"), tmp_path / "file/x").writable is False


def test_the_space_asked_for_holds_the_maps_of_a_run(tmp_path):
    Maps(tmp_path, create=True)
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) * 2 < RUN_SPACE


def made(tmp_path, mode):
    path = tmp_path / "secret"
    path.write_text("x")
    path.chmod(mode)
    return look_at_file("the file", path)


@pytest.mark.parametrize(
    ("mode", "tokens", "secret", "tls_key"),
    [
        (0o600, Level.OK, Level.OK, Level.OK),
        (0o400, Level.OK, Level.OK, Level.OK),
        (0o640, Level.PROBLEM, Level.PROBLEM, Level.WARNING),
        (0o604, Level.PROBLEM, Level.PROBLEM, Level.PROBLEM),
        (0o666, Level.PROBLEM, Level.PROBLEM, Level.PROBLEM),
    ],
)
def test_levels_of_real_files(tmp_path, mode, tokens, secret, tls_key):
    file = made(tmp_path, mode)
    assert file.mode == mode
    levels = ((token_file, tokens), (secret_file, secret), (tls_key_file, tls_key))
    for judge, level in levels:
        finding = judge(file)
        assert finding.level is level
        assert finding.name == "the file"
        assert f"mode {mode:04o}" in finding.found
        assert finding.mend == ("" if level is Level.OK else f"chmod 600 {file.path}")


def test_what_is_not_there(tmp_path):
    file = look_at_file("the file", tmp_path / "none")
    assert token_file(file).level is Level.OK
    assert "made at the first start" in token_file(file).means
    for judge in (secret_file, tls_key_file, enable_switch):
        assert judge(file).level is Level.PROBLEM
        assert judge(file).mend == f"sudo ls -l {file.path}"


@pytest.mark.parametrize("judge", [token_file, secret_file, tls_key_file, enable_switch])
def test_what_may_not_be_read_or_seen(judge):
    locked = judge(KeyFile("the file", Path("/x/key"), 0o600, readable=False))
    assert locked.level is Level.PROBLEM
    assert "not readable by this user" in locked.found
    hidden = judge(KeyFile("the file", Path("/x/key"), None, readable=False, hidden=True))
    assert hidden.level is Level.PROBLEM
    assert "not to be seen by this user" in hidden.found


def test_an_enable_switch_that_can_be_read(tmp_path):
    assert enable_switch(made(tmp_path, 0o644)).level is Level.OK


def test_run_directory_with_somebodys_files_is_seen(tmp_path):
    (tmp_path / "letter.odt").write_text("mine")
    assert look_at(Tree(), tmp_path).foreign == ("letter.odt",)
    assert look_at(Tree(), tmp_path / "none").foreign == ()
