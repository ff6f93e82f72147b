"""A service manager beside the real server: when it is ready, what it does, when it stops."""

import socket
from pathlib import Path

import pytest
from rig import Rig


def words(link: socket.socket) -> list[dict[str, str]]:
    found = []
    while True:
        try:
            text = link.recv(4096).decode()
        except BlockingIOError:
            return found
        found.append(dict(line.split("=", 1) for line in text.splitlines()))


def test_the_manager_hears_ready_states_life_and_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(str(tmp_path / "manager"))
        link.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "manager"))
        monkeypatch.setenv("WATCHDOG_USEC", "300000")
        heard: list[dict[str, str]] = []

        def hears(start: str) -> bool:
            heard.extend(words(link))
            return any(word.get("STATUS", "").startswith(start) for word in heard)

        with Rig(tmp_path) as rig:
            rig.wait_for(lambda: heard.extend(words(link)) or heard, "the first word")
            assert heard[0]["READY"] == "1"
            assert rig.shown()
            rig.run()
            rig.wait_for(lambda: hears("RUN: "), "the manager to hear of the drive")
            alive = sum("WATCHDOG" in word for word in heard)
            rig.wait_for(
                lambda: hears("") and sum("WATCHDOG" in w for w in heard) > alive + 5, "life signs"
            )
            assert rig.end() == 0
            heard.extend(words(link))
    assert sum("READY" in word for word in heard) == 1
    assert sum("STOPPING" in word for word in heard) == 1
    last = max(number for number, word in enumerate(heard) if word.get("STATUS"))
    assert heard[last]["STATUS"] == "ended parked"
