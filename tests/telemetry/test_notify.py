"""What a service manager hears, over a real socket."""

import os
import socket

import pytest

from motionserver.telemetry.notify import Notifier


@pytest.fixture
def manager(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(str(tmp_path / "notify"))
        link.setblocking(False)
        yield link


def test_words_arrive_as_lines(manager, monkeypatch):
    monkeypatch.setenv("NOTIFY_SOCKET", manager.getsockname())
    notifier = Notifier()
    notifier.tell(READY=1, STATUS="PARKED: parked")
    assert manager.recv(1000) == b"READY=1\nSTATUS=PARKED: parked"
    # children must not speak for the service
    assert "NOTIFY_SOCKET" not in os.environ


def test_an_abstract_socket_is_meant_by_at(monkeypatch):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(f"\0motion-notify-{os.getpid()}")
        link.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", f"@motion-notify-{os.getpid()}")
        Notifier().tell(WATCHDOG=1)
        assert link.recv(100) == b"WATCHDOG=1"


def test_without_a_manager_nothing_happens(monkeypatch):
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    Notifier().tell(READY=1)


def test_a_manager_that_is_gone_or_deaf_is_no_trouble(manager, tmp_path, monkeypatch):
    monkeypatch.setenv("NOTIFY_SOCKET", manager.getsockname())
    notifier = Notifier()
    for _ in range(1000):
        notifier.tell(WATCHDOG=1)
    (tmp_path / "notify").unlink()
    notifier.tell(WATCHDOG=1)


def test_a_name_that_is_no_socket_is_refused(monkeypatch):
    monkeypatch.setenv("NOTIFY_SOCKET", "notify")
    with pytest.raises(ValueError, match="'notify' is no socket"):
        Notifier()


OWN = "this process"


@pytest.mark.parametrize(
    ("pid", "time", "found"),
    [
        ("", "3000000", 3.0),
        (OWN, "500000", 0.5),
        ("1", "3000000", 0.0),
        ("", "", 0.0),
        ("", "soon", 0.0),
    ],
)
def test_how_long_the_manager_waits(pid, time, found, monkeypatch):
    # a test's name must be the same in every process that collects it
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()) if pid == OWN else pid)
    monkeypatch.setenv("WATCHDOG_USEC", time)
    assert Notifier().watchdog == found
    assert "WATCHDOG_USEC" not in os.environ
