"""A service manager beside the real server: when it is ready, what it does, when it stops."""

import socket
import threading
from pathlib import Path

import pytest
from rig import Rig


def listen(link: socket.socket, heard: list[dict[str, str]]) -> None:
    """Hear all words until an empty one; the kernel keeps only a few that nobody reads."""
    while text := link.recv(4096).decode():
        heard.append(dict(line.split("=", 1) for line in text.splitlines()))


def test_the_manager_hears_ready_states_life_and_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[dict[str, str]] = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(str(tmp_path / "manager"))
        listener = threading.Thread(target=listen, args=(link, heard), daemon=True)
        listener.start()
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "manager"))
        monkeypatch.setenv("WATCHDOG_USEC", "300000")
        with Rig(tmp_path) as rig:
            rig.wait_for(lambda: heard, "the first word")
            assert heard[0]["READY"] == "1"
            assert rig.shown()
            rig.run()
            rig.wait_for(
                lambda: any(word["STATUS"].startswith("RUN: ") for word in heard), "the drive"
            )
            goal = sum("WATCHDOG" in word for word in heard) + 5
            rig.wait_for(lambda: sum("WATCHDOG" in w for w in heard) >= goal, "life signs")
            assert rig.end() == 0
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
            end.sendto(b"", link.getsockname())
        listener.join()
    assert sum("READY" in word for word in heard) == 1
    assert sum("STOPPING" in word for word in heard) == 1
    assert heard[-1] == {"STATUS": "ended parked"}
