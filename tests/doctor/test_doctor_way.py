"""The way to the platform, from made-up routing tables; nothing is ever sent."""

import errno
import socket
import sys

import pytest

from motionserver.doctor.finding import Level
from motionserver.doctor.way import Route, Way, find_way, platform_way, route_to

HEAD = "Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT\n"
LITTLE = pytest.mark.skipif(sys.byteorder != "little", reason="tables written as on x86 and Arm")
# 0.0.0.0/0 by eth0 through 192.0.2.1; 192.0.2.0/24 on eth0; 198.51.100.0/24 on eth1, and on
# wlan0 with a worse metric; 203.0.113.0/24 on a device that is not up
TABLE = HEAD + (
    "eth0\t00000000\t010200C0\t0003\t0\t0\t0\t00000000\t0\t0\t0\n"
    "eth0\t000200C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n"
    "wlan0\t006433C6\t00000000\t0001\t0\t0\t600\t00FFFFFF\t0\t0\t0\n"
    "eth1\t006433C6\t00000000\t0001\t0\t0\t100\t00FFFFFF\t0\t0\t0\n"
    "eth2\t007100CB\t00000000\t0000\t0\t0\t0\t00FFFFFF\t0\t0\t0\n"
)


@LITTLE
@pytest.mark.parametrize(
    ("host", "route"),
    [
        ("192.0.2.9", Route("eth0", False)),
        ("198.51.100.7", Route("eth1", False)),
        ("203.0.113.5", Route("eth0", True)),
        ("::1", None),
    ],
)
def test_the_narrowest_route_counts(plant, host, route):
    assert route_to(plant({"/proc/net/route": TABLE}), host) == route


def test_no_table_no_route(plant):
    assert route_to(plant({}), "192.0.2.9") is None
    assert route_to(plant({"/proc/net/route": HEAD + "lo\n"}), "192.0.2.9") is None


@LITTLE
@pytest.mark.parametrize(
    ("way", "files", "level", "found", "mend"),
    [
        (Way("127.0.0.1", "127.0.0.1"), {}, Level.OK, "127.0.0.1 is this computer", ""),
        (Way("::1", "::1"), {}, Level.OK, "::1 is this computer", ""),
        (
            Way("198.51.100.7", "198.51.100.1"), {"eth1/operstate": "up", "eth1/carrier": "1"},
            Level.OK, "198.51.100.7 by eth1 (up)", "",
        ),
        (
            Way("198.51.100.7", "198.51.100.1"), {"eth1/operstate": "down", "eth1/carrier": "0"},
            Level.PROBLEM, "198.51.100.7 by eth1 (down)", "put the cable in",
        ),
        (
            Way("198.51.100.7", "198.51.100.1"), {"eth1/operstate": "unknown", "eth1/carrier": "0"},
            Level.PROBLEM, "198.51.100.7 by eth1 (unknown)", "put the cable in",
        ),
        (
            Way("198.51.100.7", "198.51.100.1"), {"eth1/operstate": "up"},
            Level.OK, "198.51.100.7 by eth1 (up)", "",
        ),
        (
            Way("198.51.100.7", "198.51.100.1"), {"eth1/carrier": "1"},
            Level.OK, "198.51.100.7 by eth1 (link unknown)", "",
        ),
        (
            Way("198.51.100.7", "198.51.100.1", -1), {},
            Level.PROBLEM, "no way from 198.51.100.1 to 198.51.100.7: no reason given",
            "ip route get 198.51.100.7",
        ),
        (
            Way("203.0.113.5", "192.0.2.2"), {"eth0/operstate": "up"},
            Level.WARNING, "203.0.113.5 by eth0 (up), through a router", "put the platform on",
        ),
        (
            Way("198.51.100.7", "198.51.100.1"), {},
            Level.UNKNOWN, "198.51.100.7 by eth1 (link unknown)", "ip route get 198.51.100.7",
        ),
        (
            Way("2001:db8::7", "::"), {}, Level.UNKNOWN, "2001:db8::7 has a route",
            "ip route get 2001:db8::7",
        ),
        (
            Way("198.51.100.7", "127.0.0.1", errno.EINVAL), {},
            Level.PROBLEM, "no way from 127.0.0.1 to 198.51.100.7: Invalid argument",
            "ip route get 198.51.100.7, then set [platform] local_host",
        ),
        (
            Way("198.51.100.7", "0.0.0.0", errno.ENETUNREACH), {},
            Level.PROBLEM, "no way from 0.0.0.0 to 198.51.100.7: Network is unreachable",
            "ip route get 198.51.100.7",
        ),
        (
            Way("198.51.100.7", "192.0.2.77", errno.EADDRNOTAVAIL), {},
            Level.UNKNOWN, "192.0.2.77 is no address of this computer", "ip route get",
        ),
    ],
)  # fmt: skip
def test_way_levels(plant, way, files, level, found, mend):
    links = {f"/sys/class/net/{name}": text for name, text in files.items()}
    finding = platform_way(plant({"/proc/net/route": TABLE, **links}), way)
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend.startswith(mend)
    assert bool(finding.mend) == bool(mend)


def test_looking_for_a_way_sends_nothing():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as base:
        base.bind(("127.0.0.1", 0))
        base.setblocking(False)
        port = base.getsockname()[1]
        assert find_way("127.0.0.1", "127.0.0.1", port) == Way("127.0.0.1", "127.0.0.1")
        with pytest.raises(BlockingIOError):
            base.recv(1)
        # the same socket does hear a packet, so the silence above means something
        base.sendto(b"x", ("127.0.0.1", port))
        assert base.recv(1) == b"x"


def test_a_loopback_address_leads_to_no_platform_elsewhere():
    assert find_way("192.0.2.9", "127.0.0.1", 991).error in (errno.EINVAL, errno.ENETUNREACH)
    assert find_way("127.0.0.1", "192.0.2.77", 991).error == errno.EADDRNOTAVAIL
