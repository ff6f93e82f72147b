"""The other ends of the wire: what cannot be is said of the option that is wrong."""

import re
import signal

import pytest
from motion_clients.recording import recording_path

from motionserver.cli import devices
from motionserver.errors import ConfigError

DRIVE = "truck_brake_accel"


@pytest.fixture(autouse=True)
def undisturbed(monkeypatch):
    """The tests' own process keeps its scheduling and its signals."""
    monkeypatch.setattr(devices, "take_priority", lambda *_, **__: "")
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def emulate(**change):
    asked = {"form": "moog-6dof2000e", "listen": "127.0.0.1:0", "force_to": "", "summary": None,
             "log": None, "seconds": 0.05, "seed": 0, "cut_after": None}  # fmt: skip
    return devices.emulate(**asked | change)


def test_a_base_says_what_it_saw_and_writes_it(tmp_path):
    verdict = emulate(summary=tmp_path / "verdict.json", log=tmp_path / "log")
    assert verdict["packets"] == 0
    assert (tmp_path / "verdict.json").exists()
    assert (tmp_path / "log").exists()


@pytest.mark.parametrize("option", ["log", "summary"])
def test_a_file_that_cannot_be_written_is_not_blamed_on_the_address(option, tmp_path, monkeypatch):
    monkeypatch.setattr(devices, "run_emulator", lambda *_, **__: pytest.fail("ran"))
    with pytest.raises(ConfigError, match=f"--{option} .*nowhere.*existing folder"):
        emulate(**{option: tmp_path / "nowhere" / "file"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"form": "moog"}, "FORMAT: unknown 'moog'. Allowed: moog-6dof2000e"),
        ({"listen": "here"}, "--listen: 'here' is not HOST:PORT"),
        ({"listen": "192.0.2.1:9"}, "--listen: 192.0.2.1:9: "),
        ({"force_to": "there"}, "--force-to: 'there' is not HOST:PORT"),
    ],
)
def test_wrong_words_of_emulate_are_refused(change, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        emulate(**change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"form": "pigeon"}, "--format: unknown 'pigeon'. Allowed: native, beamng"),
        ({"recording": "no-such-drive"}, "INPUT.csv: "),
        ({"to": "there"}, "--to: 'there' is not HOST:PORT"),
        ({"to": "127.0.0.1:0"}, "replay: port 0 is out of range; allowed are 1 to 65535"),
        ({"preview": 100.0}, "replay: preview 100.0 s is out of range; allowed are 0 to 2.0 s"),
        ({"form": "beamng", "preview": 1.0}, "replay: format beamng can carry neither preview"),
        ({"to": "no.such.host.invalid:9"}, "--to no.such.host.invalid:9: "),
    ],
)
def test_wrong_words_of_replay_are_refused(change, message):
    asked = {"recording": DRIVE, "to": "127.0.0.1:9", "form": "native", "loop": False,
             "preview": 0.0}  # fmt: skip
    with pytest.raises(ConfigError, match=re.escape(message)):
        devices.replay(**asked | change)


def test_a_recording_is_sent_to_its_end(tmp_path):
    lines = recording_path(DRIVE).read_text("utf-8").splitlines()[:6]
    (tmp_path / "short.csv").write_text("\n".join(lines) + "\n", "utf-8")
    said = devices.replay(str(tmp_path / "short.csv"), "127.0.0.1:9", "beamng", False, 0.0)
    assert "in 1 rounds" in said
