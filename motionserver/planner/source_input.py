"""One input of the planner: where datagrams come from, and a decoder for each sender."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from motionserver.core.state import VehicleMotion
from motionserver.planner.crowd import Crowd
from motionserver.planner.options import InputOptions
from motionserver.sources.base import SourceFormat
from motionserver.sources.registry import make_source
from motionserver.sources.sizes import sizes_of
from motionserver.sources.udp import UdpInput
from motionserver.sources.zenoh_input import ZenohInput, link_of

MOST_SENDERS = 8
"""Senders per input whose format is remembered; more are strangers, and start anew."""
Datagrams = list[tuple[bytes, str, int]]
"""Bytes, sender, arrival [ns]."""


class Transport(Protocol):
    """Where datagrams come from."""

    def drain(self) -> Datagrams:
        """Datagrams that wait: bytes, sender, arrival [ns]."""
        ...

    def reply(self, name: str, data: bytes) -> None:
        """Send to a sender."""
        ...

    def close(self) -> None:
        """Stop."""
        ...


@dataclass(slots=True)
class Input:
    """One source: transport, a decoder for each sender, name; previews on a way of their own."""

    options: InputOptions
    transport: Transport
    formats: dict[str, SourceFormat] = field(default_factory=dict)
    drain_previews: Callable[[], Datagrams] = list
    crowd: Crowd | None = None
    pauses_by_silence: bool = field(init=False)

    def __post_init__(self) -> None:
        kind = make_source(self.options.kind, self.options.key)
        self.pauses_by_silence = bool(getattr(kind, "pauses_by_silence", False))

    @property
    def name(self) -> str:
        """How it is shown."""
        return f"{self.options.kind} {self.options.host}:{self.options.port}"

    def decode(self, data: bytes, address: str, arrival_ns: int) -> VehicleMotion:
        """Read a datagram; what a format remembers of a sender, another sender cannot touch.

        Raises:
            SourceError: The bytes are no sample.
        """
        if address not in self.formats:
            while len(self.formats) >= MOST_SENDERS:
                del self.formats[next(iter(self.formats))]
            self.formats[address] = make_source(self.options.kind, self.options.key)
        return self.formats[address].decode(data, arrival_ns)


@dataclass(frozen=True, slots=True)
class RefusedClient:
    """The newest client whose packet was refused for its values, as long as no other owns.

    Attributes:
        source: Where it came in.
        address: Where it came from.
        motion: What it said.
        text: What was wrong with it.
    """

    source: Input
    address: str
    motion: VehicleMotion
    text: str

    @property
    def arrival_ns(self) -> int:
        """When it arrived [ns]."""
        return self.motion.arrival_ns


def open_input(options: InputOptions) -> Input:
    """Open one input.

    Raises:
        OSError: The address cannot be bound.
        ConfigError: The kind is unknown.
    """
    make_source(options.kind, options.key)
    if options.kind == "zenoh":
        file = options.zenoh_config
        endpoint = f"{link_of(file)}/{options.host}:{options.port}"
        transport = ZenohInput(
            options.topic, [endpoint], list(options.connect), options.preview_topic, file
        )
        return Input(options, transport, drain_previews=transport.drain_previews)
    link = UdpInput(options.host, options.port)
    return Input(options, link, crowd=Crowd(link.socket, sizes_of(options.kind)))
