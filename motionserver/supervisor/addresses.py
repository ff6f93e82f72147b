"""The addresses a server needs: taken or tried before anything starts, refused in words."""

from __future__ import annotations

import contextlib
import errno
import socket
from typing import Any, Final

from motionserver.errors import ConfigError

_PRIVILEGED: Final = "Ports below 1024 need CAP_NET_BIND_SERVICE; or choose another port."
_HELD: Final = "Choose another port, or stop the program that holds it."


def open_link(local: tuple[str, int]) -> socket.socket:
    """Open the platform's socket.

    Raises:
        ConfigError: It cannot be bound.
    """
    return _bound("[platform] local_host, local_port", *local, socket.SOCK_DGRAM)


def claim_platform(host: str, port: int) -> socket.socket:
    """Take the platform for this server alone, as long as the socket or a copy of it lives.

    A name without a file, known to every process of this computer (or container): guards inherit
    it, so that it is held until the last of them has parked.

    Raises:
        ConfigError: Another server here has it.
    """
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f"\0motionserver/platform/{host}:{port}")
    except OSError as error:
        claim.close()
        raise ConfigError(
            "[platform] host, port",
            f"another server on this computer drives {host}:{port}",
            "Stop it first: one platform has one server.",
        ) from error
    return claim


def try_way(host: str, port: int) -> None:
    """Ask the kernel whether single packets can be sent to the platform; nothing is sent.

    Only the kernel knows which addresses are the broadcast addresses of this computer's networks.

    Raises:
        ConfigError: It is such an address.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as tried:
        try:
            tried.connect((host, port))
        except PermissionError as error:
            raise ConfigError(
                "[platform] host",
                f"{host} is the broadcast address of a network here: no single platform answers "
                "to it",
                "Give the platform's own IP address.",
            ) from error


def try_addresses(sources: list[dict[str, Any]], page: dict[str, Any] | None) -> None:
    """Bind everything the children will bind, all at once, and let go of it.

    A child that cannot bind would be started again for ever; whoever starts the server learns it
    here instead.

    Raises:
        ConfigError: An address is held, is not ours, or is used twice.
    """
    with contextlib.ExitStack() as held:
        for source in sources:
            where = f"[[sources]] {source['kind']} {source['host']}:{source['port']}"
            kind = socket.SOCK_STREAM if source["kind"] == "zenoh" else socket.SOCK_DGRAM
            held.enter_context(_bound(where, source["host"], source["port"], kind))
        if page is not None:
            held.enter_context(_bound("[web] port", page["host"], page["port"], socket.SOCK_STREAM))


def _bound(where: str, host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    link = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, kind)
    try:
        if kind is socket.SOCK_STREAM:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        link.bind((host, port))
    except OSError as error:
        link.close()
        hint = _PRIVILEGED if error.errno == errno.EACCES else _HELD
        raise ConfigError(
            where, f"{host}:{port} cannot be bound ({error.strerror})", hint
        ) from error
    return link
