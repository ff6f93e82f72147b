"""A datagram's instant is the kernel's: a process that reads late does not move it."""

import socket
import sys
import time

import pytest
from motion_clients.arrival_stamps import StampingSocket, bound_socket

linux = pytest.mark.skipif(sys.platform != "linux", reason="the kernel's stamps are Linux's")


@linux
def test_datagrams_read_late_keep_the_instants_they_came() -> None:
    with bound_socket(("127.0.0.1", 0)) as base, socket.socket(type=socket.SOCK_DGRAM) as host:
        assert base.is_stamping
        # the kernel turns its stamps on a moment later, for the first socket that wants them
        time.sleep(0.2)
        sent = []
        for number in range(4):
            before = time.monotonic_ns()
            host.sendto(bytes([number]), base.getsockname())
            sent.append((before, time.monotonic_ns()))
            time.sleep(0.003)
        time.sleep(0.05)
        for number, (before, after) in enumerate(sent):
            data, address = base.recvfrom(10)
            assert (data, address[1]) == (bytes([number]), host.getsockname()[1])
            # both clocks are read a moment apart
            assert before - 200_000 < base.arrived_ns < after + 200_000


def test_without_stamps_the_instant_is_that_of_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "elsewhere")
    with StampingSocket(socket.AF_INET) as base, socket.socket(type=socket.SOCK_DGRAM) as host:
        base.bind(("127.0.0.1", 0))
        assert not base.is_stamping
        host.sendto(b"x", base.getsockname())
        time.sleep(0.01)
        before = time.monotonic_ns()
        assert base.recvfrom(10)[0] == b"x"
        assert base.arrived_ns >= before


def test_an_address_that_is_held_is_refused() -> None:
    with bound_socket(("127.0.0.1", 0)) as first, pytest.raises(OSError, match="in use"):
        bound_socket(first.getsockname())
