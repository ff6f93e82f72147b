"""Files that somebody names: a device, a named pipe, a folder and a huge file are refused."""

import os
import re
import socket
from pathlib import Path

import pytest
from web_world import World

from motionserver.bounded_files import (
    SETTINGS_BYTES,
    FileNotUsableError,
    check_regular,
    read_bounded,
    read_bounded_text,
)
from motionserver.cueing.predictor import PredictorError
from motionserver.cueing.predictor import load as load_predictor
from motionserver.errors import ConfigError
from motionserver.evaluate.omct.boundaries import read_boundaries
from motionserver.evaluate.tune.cache import ResultCache
from motionserver.evaluate.tune.preset import read_fold_tunings
from motionserver.guard.loop import as_request
from motionserver.planner.session_file import SessionKeeper
from motionserver.settings.config import load_config
from motionserver.settings.fields import TuningError
from motionserver.settings.key_file import LONGEST_KEY, read_key
from motionserver.settings.machine import load_machine
from motionserver.settings.resolve import resolve
from motionserver.settings.tuning_presets import PresetShelf
from motionserver.telemetry.blackbox.reader import DumpError, read_dump
from motionserver.telemetry.recorded import RecordError, read_recorded
from motionserver.web.config import WebConfig, WebConfigError
from motionserver.web.tokens import load_tokens

HUGE = 5 << 30


def device(path):
    path.symlink_to("/dev/zero")


def pipe(path):
    os.mkfifo(path)


def folder(path):
    path.mkdir()


def huge(path):
    with path.open("wb") as file:
        file.truncate(HUGE)
    path.chmod(0o600)


def unix_socket(path):
    server = socket.socket(socket.AF_UNIX)
    server.bind(str(path))
    server.close()


KINDS = {
    device: "is a device, not a regular file",
    pipe: "is a named pipe, not a regular file",
    folder: "is a folder, not a regular file",
    unix_socket: "is a socket, not a regular file",
    huge: "is larger than",
}


def zenoh_source(path):
    source = {"kind": "zenoh", "zenoh_config": str(path)}
    resolve(load_config(None, {"sources": [source]}), path.parent / "run")


def page(**more):
    def check(path):
        values = World(path.parent).config
        changed = {name: getattr(values, name) for name in WebConfig.__slots__ if name[0] != "_"}
        WebConfig(**{**changed, **{name: path for name in more}}).check()

    return check


READERS = {
    "configuration": (load_config, ConfigError),
    "machine": (lambda path: load_machine(str(path)), ConfigError),
    "key": (lambda path: read_key(path, "key_file"), ConfigError),
    "zenoh": (zenoh_source, ConfigError),
    "predictor": (load_predictor, PredictorError),
    "tokens": (load_tokens, WebConfigError),
    "boundaries": (read_boundaries, ConfigError),
    "folds": (read_fold_tunings, ConfigError),
    "dump": (read_dump, DumpError),
    "recorded": (read_recorded, RecordError),
    "cache": (ResultCache, ConfigError),
}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("reader", READERS)
def test_named_file_that_is_not_regular_or_too_large_is_refused(tmp_path, reader, kind):
    path = tmp_path / "file.toml"
    kind(path)
    read, error = READERS[reader]
    with pytest.raises(error, match=KINDS[kind]) as caught:
        read(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_saved_preset_that_is_not_regular_is_refused(tmp_path, kind):
    kind(tmp_path / "mine.toml")
    with pytest.raises(TuningError, match=KINDS[kind]):
        PresetShelf(tmp_path).read("mine")


@pytest.mark.parametrize("kind", [device, pipe, folder], ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("name", ["tls", "audit_file", "tokens_file"])
def test_page_file_that_is_not_regular_is_refused(tmp_path, name, kind):
    path = tmp_path / "file"
    kind(path)
    names = ("tls_cert", "tls_key") if name == "tls" else (name,)
    with pytest.raises(WebConfigError, match=r"regular file"):
        page(**dict.fromkeys(names))(path)


@pytest.mark.parametrize("kind", [device, pipe, folder, huge], ids=lambda kind: kind.__name__)
def test_enable_switch_that_is_not_regular_is_released(tmp_path, kind):
    """The guard must not wait for somebody to write into a pipe."""
    path = tmp_path / "switch"
    kind(path)
    assert not as_request({"op": "engage"}, path).enabled
    (tmp_path / "held").write_text("1\n")
    assert as_request({"op": "engage"}, tmp_path / "held").enabled


def test_sessions_file_that_is_a_pipe_is_put_aside(tmp_path):
    os.mkfifo(tmp_path / "sessions.bin")
    keeper = SessionKeeper(tmp_path / "sessions.bin", tmp_path / "recent.map")
    assert keeper.counters["sessions_damaged"] == 1
    keeper.close()
    assert (tmp_path / "sessions.bin").is_file()


def test_read_bounded_file_up_to_its_bound_is_read_whole(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(bytes(range(256)))
    assert read_bounded(path, 256) == bytes(range(256))
    with pytest.raises(FileNotUsableError, match="larger than 255 bytes"):
        read_bounded(path, 255)
    check_regular(path, 256)
    path.write_bytes(b"")
    assert read_bounded(path, 0) == b""


def test_read_bounded_file_without_a_stated_size_is_bounded_as_well():
    """Files of /proc say they have no bytes."""
    assert Path("/proc/self/status").stat().st_size == 0
    assert b"Name:" in read_bounded("/proc/self/status", SETTINGS_BYTES)
    with pytest.raises(FileNotUsableError, match="larger than 8 bytes"):
        read_bounded("/proc/self/status", 8)


def test_read_bounded_text_byte_order_mark_is_left_out(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"\xef\xbb\xbfname = 1")
    assert read_bounded_text(path, 100) == "name = 1"


def test_key_of_the_longest_length_is_taken_and_a_longer_one_refused(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(b"k" * LONGEST_KEY)
    path.chmod(0o600)
    assert len(read_key(path, "key_file")) == LONGEST_KEY
    path.write_bytes(b"k" * (LONGEST_KEY + 1))
    with pytest.raises(ConfigError, match=re.escape(f"16 to {LONGEST_KEY} bytes")):
        read_key(path, "key_file")
