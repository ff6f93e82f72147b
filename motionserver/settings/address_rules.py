"""Addresses of a configuration with which nothing can work, each refused by its key."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator
from itertools import combinations
from typing import Final, NamedTuple

from motionserver.errors import ConfigError
from motionserver.settings.keys import split_address
from motionserver.settings.sections import PlatformSection, SourceSection, WebSection

_Ip = ipaddress.IPv4Address | ipaddress.IPv6Address
_RESERVED: Final = ipaddress.ip_network("240.0.0.0/4")


class Own(NamedTuple):
    """An address this server listens on.

    Attributes:
        where: Its key.
        protocol: "udp" or "tcp".
        host: As in the configuration.
        port: 0 is any free one.
    """

    where: str
    protocol: str
    host: str
    port: int


def ip_of(host: str) -> _Ip | None:
    """The IP address of a host; None for a name that is none."""
    try:
        return ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        return None


def own_addresses(
    platform: PlatformSection, sources: list[SourceSection], web: WebSection
) -> Iterator[Own]:
    """Everything that is bound, the platform's socket first."""
    yield Own("[platform] local_port", "udp", platform.local_host, platform.local_port)
    for source in sources:
        host, port = split_address(source.listen)
        protocol = "tcp" if source.kind == "zenoh" else "udp"
        yield Own(f"[[sources]] {source.kind} {source.listen}", protocol, host, port)
    if web.enabled:
        yield Own("[web] port", "tcp", web.host, web.port)


def check_addresses(
    platform: PlatformSection, sources: list[SourceSection], web: WebSection
) -> None:
    """Refuse addresses that cannot work, or not together.

    Raises:
        ConfigError: One of them; the key is named.
    """
    _check_platform(platform)
    own = tuple(own_addresses(platform, sources, web))
    for one in own:
        if (ip := ip_of(one.host)) is not None and _is_group(ip):
            raise ConfigError(
                one.where,
                f"{one.host} is a {_kind(ip)} address and no address of this computer",
                "Give this computer's own address, such as 127.0.0.1.",
            )
    for first, second in combinations(own, 2):
        if first.protocol == second.protocol and 0 < first.port == second.port:
            _check_pair(first, second)
    peer = Own("", "udp", platform.host, platform.port)
    for one in own:
        if one.protocol == "udp" and one.port == platform.port and _is_here(one, peer, platform):
            back = "its answers" if one.where.startswith("[platform]") else "cues"
            raise ConfigError(
                "[platform] port",
                f"{platform.port} on {platform.host} is what {one.where} listens on: every "
                f"setpoint would come back to this server, as {back}",
                "Give the platform's own address and port, or listen on another port.",
            )


def _check_platform(platform: PlatformSection) -> None:
    peer, own = ip_of(platform.host), ip_of(platform.local_host)
    if peer is None:
        raise ConfigError(
            "[platform] host", f"{platform.host!r} is no IP address", "Give the platform's number."
        )
    if _is_group(peer) or peer.is_unspecified:
        raise ConfigError(
            "[platform] host",
            f"{platform.host} is a {_kind(peer)} address: no single platform answers to it",
            "Give the platform's own IP address.",
        )
    if peer.version == 4 and not peer.is_loopback and peer.packed[-1] in (0, 255):
        kind = "broadcast" if peer.packed[-1] == 255 else "network's own"
        raise ConfigError(
            "[platform] host",
            f"{platform.host} is the {kind} address of the usual networks: no single platform "
            "answers to it",
            "Give the platform's own IP address, which ends in 1 to 254.",
        )
    if isinstance(peer, ipaddress.IPv6Address) and peer.is_link_local and not peer.scope_id:
        raise ConfigError(
            "[platform] host",
            f"{platform.host} is a link-local address without its interface",
            f"Write it with the interface, such as {platform.host}%eth0.",
        )
    if own is None:
        return
    if own.version != peer.version:
        raise ConfigError(
            "[platform] local_host",
            f"{platform.local_host} is IPv{own.version}, and host = {platform.host} is "
            f"IPv{peer.version}",
            "Give this computer's address on the platform's network.",
        )
    if own.is_loopback and not peer.is_loopback:
        raise ConfigError(
            "[platform] local_host",
            f"{platform.local_host} is this computer alone: nothing sent from it reaches host = "
            f"{platform.host}",
            "Give this computer's address on the platform's network, or 0.0.0.0.",
        )


def _check_pair(first: Own, second: Own) -> None:
    one, other = ip_of(first.host), ip_of(second.host)
    if one is None or other is None:
        overlap = first.host == second.host
    else:
        overlap = one == other or one.is_unspecified or other.is_unspecified
    if overlap:
        raise ConfigError(
            second.where,
            f"{second.protocol} {second.host}:{second.port} is held by {first.where} already",
            "Give each its own port.",
        )


def _is_here(own: Own, peer: Own, platform: PlatformSection) -> bool:
    """Whether what is sent to the platform would arrive at an address of this server."""
    one, other, local = ip_of(own.host), ip_of(peer.host), ip_of(platform.local_host)
    if one is None or other is None:
        return False
    return one == other or (one.is_unspecified and (other.is_loopback or other == local))


def _is_group(ip: _Ip) -> bool:
    return ip.is_multicast or (ip.version == 4 and ip in _RESERVED)


def _kind(ip: _Ip) -> str:
    if ip.is_multicast:
        return "multicast"
    if ip.is_unspecified:
        return "wildcard"
    return "broadcast" if str(ip) == "255.255.255.255" else "reserved"
