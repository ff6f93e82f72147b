"""The way to the platform: route, own address, link. Looked up only; no packet is sent."""

from __future__ import annotations

import errno
import ipaddress
import os
import socket
import struct
from dataclasses import dataclass
from typing import Final

from motionserver.doctor.addresses import error_number
from motionserver.doctor.finding import Finding, Level, unknown
from motionserver.doctor.tree import Tree

_GATEWAY: Final = 0x2
_UP: Final = 0x1


@dataclass(frozen=True, slots=True)
class Way:
    """The way to the platform, as the kernel would choose it; no packet was sent for it.

    Attributes:
        host: The platform's address.
        local: Own address of the configuration.
        error: `errno` of connecting a UDP socket, which only looks a route up; 0 when it worked.
    """

    host: str
    local: str
    error: int = 0


def find_way(host: str, local: str, port: int) -> Way:
    """Ask the kernel for a route from ``local`` to ``host``; UDP's connect sends nothing."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as link:
            link.bind((local, 0))
            link.connect((host, port))
    except OSError as error:
        return Way(host, local, error_number(error))
    return Way(host, local)


@dataclass(frozen=True, slots=True)
class Route:
    """One line of the routing table.

    Attributes:
        device: Network device.
        routed: Whether a router lies between.
    """

    device: str
    routed: bool


def route_to(tree: Tree, host: str) -> Route | None:
    """The narrowest route of the main IPv4 table; None for IPv6 and where none is found."""
    try:
        wanted = int(ipaddress.IPv4Address(host))
    except ValueError:
        return None
    best: tuple[int, int, Route] | None = None
    for line in (tree.lines("/proc/net/route") or [])[1:]:
        words = line.split()
        if len(words) < 8:
            continue
        network, mask = (_swapped(words[column]) for column in (1, 7))
        flags, metric = int(words[3], 16), int(words[6])
        if flags & _UP and wanted & mask == network:
            rank = (mask, -metric, Route(words[0], bool(flags & _GATEWAY)))
            if best is None or rank[:2] > best[:2]:
                best = rank
    return None if best is None else best[2]


def _swapped(word: str) -> int:
    """An address as the kernel prints it: hexadecimal, in the machine's own byte order."""
    value: int = struct.unpack("!I", struct.pack("=I", int(word, 16)))[0]
    return value


def platform_way(tree: Tree, way: Way) -> Finding:
    """Whether packets could reach the platform: route, own address and link, without sending."""
    name = "way to the platform"
    look = f"ip route get {way.host}"
    if way.error == errno.EADDRNOTAVAIL:
        return Finding(
            name, Level.UNKNOWN, f"{way.local} is no address of this computer",
            "see the platform's address", look,
        )  # fmt: skip
    if way.error:
        reason = os.strerror(way.error) if way.error > 0 else "no reason given"
        return Finding(
            name, Level.PROBLEM, f"no way from {way.local} to {way.host}: {reason}",
            "no packet can reach the platform; it stays OFFLINE",
            f"{look}, then set [platform] local_host to the address behind src",
        )  # fmt: skip
    if ipaddress.ip_address(way.host).is_loopback:
        return Finding(
            name, Level.OK, f"{way.host} is this computer", "an emulated base; no network between"
        )
    route = route_to(tree, way.host)
    if route is None:
        return Finding(
            name, Level.UNKNOWN, f"{way.host} has a route, by which device is not shown here",
            "whether the cable is in cannot be told", look,
        )  # fmt: skip
    state = tree.text(f"/sys/class/net/{route.device}/operstate")
    carrier = tree.number(f"/sys/class/net/{route.device}/carrier")
    found = f"{way.host} by {route.device} ({state or 'link unknown'})"
    if state == "down" or carrier == 0:
        return Finding(
            name, Level.PROBLEM, found, "no link: no packet can reach the platform",
            f"put the cable in, then: sudo ip link set {route.device} up",
        )  # fmt: skip
    if route.routed:
        return Finding(
            name, Level.WARNING, f"{found}, through a router",
            "anything on the way may delay or drop packets, and others reach the platform too",
            f"put the platform on a network of its own; {look} shows the router",
        )  # fmt: skip
    if state is None and carrier is None:
        return unknown(name, found, look)
    return Finding(name, Level.OK, found, "whether it answers is shown by motionserver run")
