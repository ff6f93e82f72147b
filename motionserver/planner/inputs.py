"""All inputs of the planner: sockets drained, packets decoded, believed or counted."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

from motionserver.core.intake.gate import REORDER_NS, Gate, Owner
from motionserver.core.state import DriveMode, VehicleMotion
from motionserver.planner.crowd import Crowd
from motionserver.planner.options import InputOptions
from motionserver.planner.preview import PreviewInlet
from motionserver.planner.session_file import SessionKeeper
from motionserver.sources.base import OtherStreamError, SourceError, SourceFormat
from motionserver.sources.registry import make_source
from motionserver.sources.sizes import sizes_of
from motionserver.sources.udp import UdpInput
from motionserver.sources.zenoh_input import ZenohInput, link_of
from motionserver.telemetry.ticker import now_ns

log = logging.getLogger("motionserver.planner")
SHOWN_ERRORS = 5
HINTS: Final = {
    "session-over": "session-over: played again from a recording, or a client that must take a "
    "new session number"
}
"""What is said of a refusal beside its name."""
MOST_SENDERS = 8
"""Senders per input whose format is remembered; more are strangers, and start anew."""


DAMAGED = {"size", "magic", "byte_order", "version", "incompat", "length", "checksum"}
DAMAGED |= {"hmac_missing", "hmac_wrong", "hmac_unexpected"}
"""Refusals of packets that are not as the owner sent them: a bad wire, or somebody in his name."""
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


def is_there(gate: Gate, now_ns: int) -> bool:
    """Whether the gate's owner still holds it: nobody else could own it now."""
    age = gate.freshness.age_ns(now_ns)
    return age is not None and age <= REORDER_NS and gate.mode is not DriveMode.BYE


def _peer(name: str) -> tuple[str, int]:
    host, _, port = name.rpartition(":")
    return host, int(port)


class Inputs:
    """The vehicle's sources, with one owner, and the platform's own sensor, with another."""

    def __init__(
        self,
        inputs: list[Input],
        may_change_owner: Callable[[], bool],
        sessions: SessionKeeper | None = None,
        look_ns: int = 0,
    ) -> None:
        """Take opened inputs.

        Args:
            inputs: Whose packets are read.
            may_change_owner: Whether another client may move the platform now.
            sessions: Remembers sessions of sources with a key; None believes what was recorded.
            look_ns: Time between two looks at the inputs [ns].
        """
        self.inputs = inputs
        self._sessions = sessions
        self.vehicle = Gate(may_change_owner, look_ns)
        self.sensor = Gate(look_ns=look_ns)
        self.previews = PreviewInlet()
        self.counters: Counter[str] = Counter()
        self.owner_input: Input | None = None
        self.last_error = ""

    def poll(self) -> tuple[list[VehicleMotion], list[VehicleMotion]]:
        """Read what waits.

        Returns:
            Believed samples of the vehicle and of the platform's sensor, oldest first.
        """
        vehicle: list[VehicleMotion] = []
        sensor: list[VehicleMotion] = []
        for source in self.inputs:
            for datagram in source.drain_previews():
                motion = self._decoded(source, datagram)
                if motion is not None:
                    self._take_preview(source, datagram[1], motion)
            datagrams = source.transport.drain()
            self._watch(source, len(datagrams))
            for datagram in datagrams:
                motion, address = self._decoded(source, datagram), datagram[1]
                if motion is None:
                    continue
                wants_sensor = source.options.kind == "imu"
                if wants_sensor and not motion.at_platform:
                    self._refused("not_measured", f"{address}: not flagged as measured")
                    continue
                gate = self.sensor if motion.at_platform else self.vehicle
                refusal = self._over(source, address, motion, gate) or gate.refuse(
                    source.name, address, motion
                )
                if refusal is not None:
                    said = HINTS.get(refusal, refusal)
                    if refusal == "out-of-range":
                        said = f"out-of-range: {gate.last_refusal}"
                    self._refused(refusal, f"{source.name} from {address}: {said}")
                elif motion.at_platform:
                    sensor.append(motion)
                else:
                    if gate.is_restart and motion.mode is DriveMode.DRIVE:
                        # a count that begins anew in the midst of a drive: another run, another
                        # place
                        motion = replace(motion, mode=DriveMode.TELEPORT)
                    vehicle.append(motion)
                    self.owner_input = source
        self.counters["accepted"] += len(vehicle)
        self.counters["accepted_sensor"] += len(sensor)
        self._keep_sessions()
        if vehicle:
            # the newest is what counts; all sources were read by now
            vehicle[-1] = self.previews.attach(vehicle[-1])
        return vehicle, sensor

    def _watch(self, source: Input, heard: int) -> None:
        """Keep strangers out of a crowded input, as long as an owner lives there."""
        if source.crowd is None:
            return
        now = now_ns()
        owners = {
            gate.owner.address
            for gate in (self.vehicle, self.sensor)
            if gate.owner is not None and gate.owner.source == source.name and is_there(gate, now)
        }
        before = source.crowd.dropped
        source.crowd.saw(heard, [_peer(name) for name in sorted(owners)], now)
        if source.crowd.dropped > before:
            self.counters["dropped_by_kernel"] += source.crowd.dropped - before

    @property
    def filters(self) -> dict[str, str]:
        """What the kernel lets into each input, for people."""
        return {one.name: one.crowd.filter for one in self.inputs if one.crowd is not None}

    def _decoded(self, source: Input, datagram: tuple[bytes, str, int]) -> VehicleMotion | None:
        data, address, arrival_ns = datagram
        self.counters["packets"] += 1
        try:
            return source.decode(data, address, arrival_ns)
        except OtherStreamError as error:
            self._ignored(error, f"{source.name} from {address}: {error}")
        except SourceError as error:
            self._refused(error.reason, f"{source.name} from {address}: {error}")
            if error.reason not in DAMAGED:
                self.vehicle.spoilt(source.name, address, arrival_ns)
        except Exception as error:
            # a third party's format that stumbles costs its packet, not the period
            self._refused("decoder_failed", f"{source.name} from {address}: {error!r}")
        return None

    def _over(self, source: Input, address: str, motion: VehicleMotion, gate: Gate) -> str | None:
        """Why a signed packet is not believed: it, or a later one of its session, was heard."""
        if self._sessions is None or source.options.key is None or motion.sequence is None:
            return None
        mark = self._sessions.hear(motion.session, motion.sequence)
        if motion.sequence > mark:
            return None
        if gate.owner != Owner(source.name, address, motion.session):
            return "session-over"
        # by the names of the order that every owner has to keep
        return "replayed" if motion.sequence == mark else "reordered"

    def _keep_sessions(self) -> None:
        if self._sessions is not None:
            self._sessions.keep()
            for name, count in self._sessions.counters.items():
                self.counters[name] = count

    def _take_preview(self, source: Input, address: str, motion: VehicleMotion) -> None:
        refusal = self._over(source, address, motion, self.previews.gate)
        refusal = refusal or self.previews.offer(source.name, address, motion)
        if refusal is None:
            self.counters["accepted_preview"] += 1
        else:
            self._refused(refusal, f"preview, {source.name} from {address}: {refusal}")

    def _refused(self, reason: str, text: str) -> None:
        key = f"refused_{reason.replace('-', '_')}"
        self.counters[key] += 1
        self.counters["refused"] += 1
        self.last_error = text
        if self.counters[key] <= SHOWN_ERRORS:
            log.warning("packet refused, %s", text)

    def _ignored(self, error: OtherStreamError, text: str) -> None:
        """Count a packet of another stream; it says nothing against its sender."""
        key = f"ignored_{error.reason}"
        self.counters[key] += 1
        if self.counters[key] == 1:
            log.info("%s", text)
        if self.vehicle.owner is None:
            # nothing else may come: then this is the answer to why nothing moves
            self.last_error = text

    @property
    def owner_key(self) -> bytes | None:
        """Key that the owner signs with, and what it is told is signed with; None without."""
        return None if self.owner_input is None else self.owner_input.options.key

    def reply(self, data: bytes) -> None:
        """Send a status to the owner, if its input can answer."""
        owner = self.vehicle.owner
        if owner is not None and self.owner_input is not None:
            self.owner_input.transport.reply(owner.address, data)

    def close(self) -> None:
        """Close all."""
        for source in self.inputs:
            source.transport.close()
        if self._sessions is not None:
            self._sessions.close()
