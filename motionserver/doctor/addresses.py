"""Own addresses: the receive buffer, and every address of the configuration, free or taken."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from collections.abc import Iterable
from dataclasses import dataclass

from motionserver.doctor import mends
from motionserver.doctor.finding import Finding, Level, unknown
from motionserver.doctor.holders import Holder, holder_of
from motionserver.doctor.tree import Tree
from motionserver.sources.udp import BUFFER


def receive_buffer(tree: Tree) -> Finding:
    """Whether the kernel grants the receive buffer that an input asks for."""
    name = "receive buffer"
    largest = tree.number("/proc/sys/net/core/rmem_max")
    if largest is None:
        return unknown(name, "net.core.rmem_max cannot be read, as in some containers")
    default = tree.number("/proc/sys/net/core/rmem_default")
    found = f"{BUFFER} bytes asked for, {largest} allowed" + (
        "" if default is None else f", {default} without asking"
    )
    if largest >= BUFFER:
        return Finding(name, Level.OK, found, "a burst of cues fits in")
    return Finding(
        name, Level.WARNING, found, "a full buffer drops the newest cue", mends.RECEIVE_BUFFER
    )


@dataclass(frozen=True, slots=True)
class Address:
    """One address the server binds.

    Attributes:
        name: What it is for.
        key: Where it stands in the configuration.
        protocol: "udp" or "tcp".
        host: Own address.
        port: Own port; 0 is any.
    """

    name: str
    key: str
    protocol: str
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.protocol} {self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class Tried:
    """What binding an address brought.

    Attributes:
        address: The address.
        error: `errno` of binding; 0 when it worked, -1 when there is no number.
        holder: Who has it, as far as we may see.
    """

    address: Address
    error: int = 0
    holder: Holder | None = None


def try_addresses(tree: Tree, wanted: Iterable[Address]) -> list[Tried]:
    """Bind all addresses at once for a moment; nothing is sent or listened to."""
    out = []
    with contextlib.ExitStack() as held:
        for address in wanted:
            try:
                held.enter_context(_bound(address))
            except OSError as error:
                number = error_number(error)
                holder = None
                if number == errno.EADDRINUSE:
                    holder = holder_of(tree, address.protocol, address.port)
                out.append(Tried(address, number, holder))
            else:
                out.append(Tried(address))
    return out


def _bound(address: Address) -> socket.socket:
    kind = socket.SOCK_DGRAM if address.protocol == "udp" else socket.SOCK_STREAM
    link = socket.socket(socket.AF_INET6 if ":" in address.host else socket.AF_INET, kind)
    try:
        if kind is socket.SOCK_STREAM:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        link.bind((address.host, address.port))
    except OSError:
        link.close()
        raise
    return link


def error_number(error: OSError) -> int:
    """What the kernel said; a name that does not resolve is no address of ours."""
    if isinstance(error, socket.gaierror):
        return errno.EADDRNOTAVAIL
    return error.errno or -1


def own_address(tried: Tried, runs: bool) -> Finding:
    """Whether the server can have an address.

    Args:
        tried: What binding it brought.
        runs: Whether a server has the platform's address already.
    """
    address = tried.address
    name = address.name
    cannot = "the server will not start"
    if not tried.error:
        return Finding(name, Level.OK, f"{address} free", "the server can have it")
    if tried.error == errno.EADDRINUSE:
        return _taken(name, tried, runs)
    if tried.error == errno.EACCES:
        return Finding(
            name, Level.PROBLEM,
            f"{address} not permitted: a port below 1024 without CAP_NET_BIND_SERVICE",
            f"{cannot} for this user; the systemd unit may have it",
            mends.LOW_PORTS.format(port=address.port),
        )  # fmt: skip
    if tried.error == errno.EADDRNOTAVAIL:
        return Finding(
            name, Level.PROBLEM, f"{address} is no address of this computer", cannot,
            f"ip -brief address; then correct {address.key}",
        )  # fmt: skip
    reason = os.strerror(tried.error) if tried.error > 0 else "no reason given"
    return Finding(
        name, Level.PROBLEM, f"{address} cannot be bound: {reason}", cannot,
        f"correct {address.key}",
    )  # fmt: skip


def _taken(name: str, tried: Tried, runs: bool) -> Finding:
    address, holder = tried.address, tried.holder
    cannot = "the server will not start"
    if holder is None:
        flags = "lunp" if address.protocol == "udp" else "ltnp"
        return Finding(
            name, Level.PROBLEM, f"{address} taken, by whom is hidden from this user", cannot,
            f"sudo ss -{flags} 'sport = :{address.port}'",
        )  # fmt: skip
    if holder.pid == os.getpid():
        return Finding(
            name, Level.PROBLEM, f"{address} stands twice in the configuration", cannot,
            f"correct {address.key}",
        )  # fmt: skip
    found = f"{address} taken by process {holder.pid}: {holder.command}"
    if holder.is_ours and runs:
        return Finding(name, Level.ADVICE, found, "the server runs already; a second is refused")
    change = f"change {address.key}"
    # another server's process must not be killed: it may hold a platform up
    mend = change if holder.is_ours else f"kill {holder.pid}, or {change}"
    return Finding(name, Level.PROBLEM, found, cannot, mend)
