"""All inputs of the planner: sockets drained, packets decoded, believed or counted."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from motionserver.core.intake.gate import Gate
from motionserver.core.state import VehicleMotion
from motionserver.planner.options import InputOptions
from motionserver.sources.base import SourceError, SourceFormat
from motionserver.sources.registry import make_source
from motionserver.sources.udp import UdpInput
from motionserver.sources.zenoh_input import ZenohInput

log = logging.getLogger("motionserver.planner")
SHOWN_ERRORS = 5


class Transport(Protocol):
    """Where datagrams come from."""

    def drain(self) -> list[tuple[bytes, str, int]]:
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
    """One source: transport, decoder, name."""

    options: InputOptions
    transport: Transport
    format: SourceFormat

    @property
    def name(self) -> str:
        """How it is shown."""
        return f"{self.options.kind} {self.options.host}:{self.options.port}"


def open_input(options: InputOptions) -> Input:
    """Open one input.

    Raises:
        OSError: The address cannot be bound.
        ConfigError: The kind is unknown.
    """
    transport: Transport
    if options.kind == "zenoh":
        endpoint = f"tcp/{options.host}:{options.port}"
        transport = ZenohInput(options.topic, [endpoint], list(options.connect))
    else:
        transport = UdpInput(options.host, options.port)
    return Input(options, transport, make_source(options.kind, options.key))


class Inputs:
    """The vehicle's sources, with one owner, and the platform's own sensor, with another."""

    def __init__(self, inputs: list[Input], may_change_owner: Callable[[], bool]) -> None:
        self.inputs = inputs
        self.vehicle = Gate(may_change_owner)
        self.sensor = Gate()
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
            for data, address, arrival_ns in source.transport.drain():
                self.counters["packets"] += 1
                try:
                    motion = source.format.decode(data, arrival_ns)
                except SourceError as error:
                    self._refused(error.reason, f"{source.name} from {address}: {error}")
                    continue
                wants_sensor = source.options.kind == "imu"
                if wants_sensor and not motion.at_platform:
                    self._refused("not_measured", f"{address}: not flagged as measured")
                    continue
                gate = self.sensor if motion.at_platform else self.vehicle
                refusal = gate.refuse(source.name, address, motion)
                if refusal is not None:
                    self._refused(refusal, f"{source.name} from {address}: {refusal}")
                elif motion.at_platform:
                    sensor.append(motion)
                else:
                    vehicle.append(motion)
                    self.owner_input = source
        self.counters["accepted"] += len(vehicle)
        self.counters["accepted_sensor"] += len(sensor)
        return vehicle, sensor

    def _refused(self, reason: str, text: str) -> None:
        key = f"refused_{reason.replace('-', '_')}"
        self.counters[key] += 1
        self.counters["refused"] += 1
        self.last_error = text
        if self.counters[key] <= SHOWN_ERRORS:
            log.warning("packet refused, %s", text)

    def reply(self, data: bytes) -> None:
        """Send a status to the owner, if its input can answer."""
        owner = self.vehicle.owner
        if owner is not None and self.owner_input is not None:
            self.owner_input.transport.reply(owner.address, data)

    def close(self) -> None:
        """Close all."""
        for source in self.inputs:
            source.transport.close()
