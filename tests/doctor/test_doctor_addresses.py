"""Ports: free or taken, by whom; buffers; and the way to the platform, without a packet."""

import errno
import os
import socket

import pytest

from motionserver.doctor import mends
from motionserver.doctor.addresses import (
    Address,
    Tried,
    error_number,
    own_address,
    receive_buffer,
    try_addresses,
)
from motionserver.doctor.finding import Level
from motionserver.doctor.holders import Holder, holder_of
from motionserver.doctor.tree import Tree
from motionserver.sources.udp import BUFFER

HEAD = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt uid inode\n"
GUARD = "/opt/motionserver/bin/python -m motionserver.guard /run/motionserver 7"


def line(port, inode, state="07", host="0100007F"):
    return (
        f"  12: {host}:{port:04X} 00000000:0000 {state} 00000000:00000000 00:00000000 00000000"
        f"     0        0 {inode} 2 0 0\n"
    )


def process(tree: Tree, pid: int, command: str, *inodes: int) -> None:
    folder = tree.at(f"/proc/{pid}/fd")
    folder.mkdir(parents=True)
    (folder.parent / "cmdline").write_bytes(command.replace(" ", "\0").encode())
    (folder / "0").symlink_to("/dev/null")
    for number, inode in enumerate(inodes, start=3):
        (folder / str(number)).symlink_to(f"socket:[{inode}]")


def test_who_holds_a_port_is_found_by_its_socket(plant):
    tree = plant(
        {
            "/proc/net/udp": HEAD + line(992, 501) + line(4600, 502),
            "/proc/net/udp6": HEAD + line(4700, 503, host="0" * 32),
            "/proc/net/tcp": HEAD + line(8080, 504, "01") + line(8081, 505, "0A"),
        }
    )
    process(tree, 17, "sleep 9", 500)
    process(tree, 18, GUARD, 501, 502)
    process(tree, 19, "zenohd", 503, 504, 505)
    assert holder_of(tree, "udp", 992) == Holder(18, GUARD)
    assert holder_of(tree, "udp", 4700) == Holder(19, "zenohd")
    assert holder_of(tree, "udp", 993) is None
    assert holder_of(tree, "tcp", 8080) is None, "connected, not listening"
    assert holder_of(tree, "tcp", 8081) == Holder(19, "zenohd")
    assert holder_of(tree, "tcp", 992) is None


def test_a_holder_of_another_user_is_hidden(plant):
    tree = plant({"/proc/net/udp": HEAD + line(992, 501), "/proc/18/cmdline": "x"})
    assert holder_of(tree, "udp", 992) is None


@pytest.mark.parametrize(
    ("command", "ours"),
    [
        (GUARD, True),
        ("python -m motionserver.planner /run/x", True),
        ("/venv/bin/python -m motionserver.web /run/x/web.json", True),
        ("/opt/motionserver/bin/python /opt/motionserver/bin/motionserver run x.toml", True),
        ("python -m motionserver run x.toml", True),
        ("/opt/motionserver/bin/motionserver emulate moog-6dof2000e --listen 127.0.0.1:992", False),
        ("/opt/motionserver/bin/python game.py", False),
    ],
)
def test_a_server_is_told_from_an_emulator(command, ours):
    assert Holder(1, command).is_ours is ours


PLATFORM = Address(
    "platform's address", "[platform] local_host, local_port", "udp", "192.0.2.1", 992
)
PAGE = Address("page's address", "[web] host, port", "tcp", "127.0.0.1", 8080)


@pytest.mark.parametrize(
    ("tried", "runs", "level", "found", "mend"),
    [
        (Tried(PLATFORM), False, Level.OK, "udp 192.0.2.1:992 free", ""),
        (
            Tried(PLATFORM, errno.EADDRINUSE, Holder(18, GUARD)), True, Level.ADVICE,
            f"udp 192.0.2.1:992 taken by process 18: {GUARD}", "",
        ),
        (
            Tried(PAGE, errno.EADDRINUSE, Holder(18, GUARD)), False, Level.PROBLEM,
            f"tcp 127.0.0.1:8080 taken by process 18: {GUARD}",
            "change [web] host, port",
        ),
        (
            Tried(PAGE, errno.EADDRINUSE, Holder(5, "nginx")), False, Level.PROBLEM,
            "tcp 127.0.0.1:8080 taken by process 5: nginx", "kill 5, or change [web] host, port",
        ),
        (
            Tried(PAGE, errno.EADDRINUSE, Holder(5, "nginx")), True, Level.PROBLEM,
            "tcp 127.0.0.1:8080 taken by process 5: nginx", "kill 5, or change [web] host, port",
        ),
        (
            Tried(PLATFORM, errno.EADDRINUSE), False, Level.PROBLEM,
            "udp 192.0.2.1:992 taken, by whom is hidden from this user",
            "sudo ss -lunp 'sport = :992'",
        ),
        (
            Tried(PAGE, errno.EADDRINUSE), True, Level.PROBLEM,
            "tcp 127.0.0.1:8080 taken, by whom is hidden from this user",
            "sudo ss -ltnp 'sport = :8080'",
        ),
        (
            Tried(PAGE, errno.EADDRINUSE, Holder(os.getpid(), "x")), False, Level.PROBLEM,
            "tcp 127.0.0.1:8080 stands twice in the configuration", "correct [web] host, port",
        ),
        (
            Tried(PLATFORM, errno.EACCES), False, Level.PROBLEM,
            "udp 192.0.2.1:992 not permitted: a port below 1024 without CAP_NET_BIND_SERVICE",
            mends.LOW_PORTS.format(port=992),
        ),
        (
            Tried(PLATFORM, errno.EADDRNOTAVAIL), False, Level.PROBLEM,
            "udp 192.0.2.1:992 is no address of this computer",
            "ip -brief address; then correct [platform] local_host, local_port",
        ),
        (
            Tried(PAGE, errno.EAFNOSUPPORT), False, Level.PROBLEM,
            "tcp 127.0.0.1:8080 cannot be bound: Address family not supported by protocol",
            "correct [web] host, port",
        ),
        (
            Tried(PAGE, -1), False, Level.PROBLEM,
            "tcp 127.0.0.1:8080 cannot be bound: no reason given", "correct [web] host, port",
        ),
    ],
)  # fmt: skip
def test_address_levels(tried, runs, level, found, mend):
    finding = own_address(tried, runs)
    assert (finding.level, finding.found, finding.mend) == (level, found, mend)
    assert finding.name == tried.address.name


def test_real_sockets_are_tried_all_at_once_and_let_go_of():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        tried = try_addresses(
            Tree(),
            [
                Address("free", "a", "udp", "127.0.0.1", 0),
                Address("taken", "b", "udp", "127.0.0.1", port),
                Address("same number, other protocol", "c", "tcp", "127.0.0.1", 0),
                Address("not ours", "d", "udp", "192.0.2.77", 4600),
            ],
        )
    errors = [one.error for one in tried]
    assert errors == [0, errno.EADDRINUSE, 0, errno.EADDRNOTAVAIL]
    holder = tried[1].holder
    assert holder is not None
    assert holder.pid == os.getpid()
    again = try_addresses(Tree(), [Address("taken", "b", "udp", "127.0.0.1", port)] * 2)
    assert [one.error for one in again] == [0, errno.EADDRINUSE]


def test_a_name_that_does_not_resolve_is_no_address_of_ours():
    assert error_number(socket.gaierror(-2, "Name or service not known")) == errno.EADDRNOTAVAIL
    assert error_number(OSError(errno.EACCES, "x")) == errno.EACCES
    assert error_number(OSError("x")) == -1


@pytest.mark.parametrize(
    ("largest", "level"),
    [
        (str(BUFFER), Level.OK),
        (str(BUFFER - 1), Level.WARNING),
        (None, Level.UNKNOWN),
        ("x", Level.UNKNOWN),
    ],
)
def test_receive_buffer_levels(plant, largest, level):
    files = {"/proc/sys/net/core/rmem_default": "212992\n"}
    if largest is not None:
        files["/proc/sys/net/core/rmem_max"] = largest
    finding = receive_buffer(plant(files))
    assert finding.level is level
    assert finding.mend == (mends.RECEIVE_BUFFER if level is Level.WARNING else "")
    if level is not Level.UNKNOWN:
        assert (
            finding.found == f"{BUFFER} bytes asked for, {largest} allowed, 212992 without asking"
        )


def test_the_mending_buffer_is_large_enough():
    assert int(mends.RECEIVE_BUFFER.rpartition("=")[2]) >= BUFFER
