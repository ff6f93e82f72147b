"""The key of signed packets: nobody else's to read, long enough, and never where it is no use."""

import os

import pytest

from motionserver.errors import ConfigError
from motionserver.settings.config import load_config
from motionserver.settings.resolve import resolve


def resolved(tmp_path, **source):
    sections = {
        "server": {"run_dir": str(tmp_path / "run"), "state_dir": str(tmp_path / "state")},
        "sources": [{"key_file": str(tmp_path / "key"), **source}],
    }
    return resolve(load_config(None, sections), tmp_path / "run")


def key(tmp_path, mode=0o600, data=bytes(range(32))):
    path = tmp_path / "key"
    path.write_bytes(data)
    path.chmod(mode)
    return data


@pytest.mark.parametrize("mode", [0o600, 0o400])
def test_a_key_that_only_this_user_reads_is_taken(tmp_path, mode):
    data = key(tmp_path, mode)
    assert resolved(tmp_path)["sources"][0]["key"] == data.hex()


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o620, 0o660, 0o666, 0o777, 0o601])
def test_a_key_that_others_may_read_or_change_stops_the_start(tmp_path, mode):
    key(tmp_path, mode)
    with pytest.raises(ConfigError) as caught:
        resolved(tmp_path)
    assert "[[sources]] native 127.0.0.1:4600: key_file" in caught.value.where
    assert f"mode {mode:04o} lets others on this computer read the key" in caught.value.what
    assert caught.value.do == f"Do: chmod 600 {tmp_path / 'key'}"


def test_a_key_of_another_user_stops_the_start(tmp_path, monkeypatch):
    key(tmp_path)
    own = os.getuid()
    if own == 0:
        os.chown(tmp_path / "key", 1234, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: own + 1)
    with pytest.raises(ConfigError, match=r"who could change it.*chown"):
        resolved(tmp_path)


def test_a_short_or_missing_key_stops_the_start(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot be read \(No such file"):
        resolved(tmp_path)
    key(tmp_path, data=b"x" * 15)
    with pytest.raises(ConfigError, match="15 bytes"):
        resolved(tmp_path)


@pytest.mark.parametrize("listen", ["127.0.0.1:4444", "192.0.2.1:4444"])
def test_a_key_for_packets_that_cannot_be_signed_is_refused(tmp_path, listen):
    """Else whoever gave it would think that the port were closed to strangers."""
    key(tmp_path)
    with pytest.raises(ConfigError, match="carry no signature"):
        resolved(tmp_path, kind="beamng", listen=listen)
