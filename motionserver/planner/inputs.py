"""All inputs of the planner: sockets drained, packets decoded, believed or counted."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from motionserver.core.intake.gate import REORDER_NS, Gate, Owner
from motionserver.core.state import DriveMode, VehicleMotion
from motionserver.planner.preview import PreviewInlet
from motionserver.planner.session_file import SessionKeeper
from motionserver.planner.sessions import JUMPED
from motionserver.planner.source_input import (
    MOST_SENDERS,
    Datagrams,
    Input,
    RefusedClient,
    Transport,
    open_input,
)
from motionserver.sources.base import OtherStreamError, SourceError
from motionserver.telemetry.ticker import now_ns

__all__ = [
    "MOST_SENDERS", "SHOWN_ERRORS", "Datagrams", "Input", "Inputs", "RefusedClient", "Transport",
    "is_there", "open_input",
]  # fmt: skip

log = logging.getLogger("motionserver.planner")
SHOWN_ERRORS = 5
HINTS: Final = {
    "session-over": "session-over: played again from a recording, or a client that must take a "
    "new session number"
}
"""What is said of a refusal beside its name."""
PAUSE_NS: Final = 600_000_000_000
"""Longest silence that is taken for a pause, of formats that pause by silence [ns]."""

DAMAGED = {"size", "magic", "byte_order", "version", "incompat", "length", "checksum"}
DAMAGED |= {"hmac_missing", "hmac_wrong", "hmac_unexpected"}
"""Refusals of packets that are not as the owner sent them: a bad wire, or somebody in his name."""


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
        self.vehicle = Gate(may_change_owner, look_ns, self._is_same_game)
        self.sensor = Gate(look_ns=look_ns)
        self.previews = PreviewInlet()
        self.counters: Counter[str] = Counter()
        self.owner_input: Input | None = None
        self.out_of_range: RefusedClient | None = None
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
                        self._note_values(source, address, motion, gate)
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

    def _note_values(self, source: Input, address: str, motion: VehicleMotion, gate: Gate) -> None:
        """Keep what was wrong, to be told to the client; a stranger beside an owner is not."""
        owner = gate.owner
        is_owner = owner is not None and owner == Owner(source.name, address, motion.session)
        if gate is self.vehicle and (is_owner or not is_there(gate, motion.arrival_ns)):
            self.out_of_range = RefusedClient(source, address, motion, gate.last_refusal)

    def is_paused_by_silence(self, now_ns: int) -> bool:
        """True if the owner's format says "pause" by sending nothing, and that is what it does."""
        age = self.vehicle.freshness.age_ns(now_ns)
        return (
            self.owner_input is not None
            and self.owner_input.pauses_by_silence
            and age is not None
            and age <= PAUSE_NS
            and self.vehicle.mode is DriveMode.DRIVE
            and self.vehicle.freshness.is_stale(now_ns)
            and not self.vehicle.freshness.is_too_slow
            and not self.vehicle.spoilage.is_spoilt(now_ns)
        )

    def _is_same_game(self, owner: Owner, who: Owner) -> bool:
        """Whether a newcomer is a paused owner that returns on another port of its host."""
        if owner.source != who.source or self.owner_input is None:
            return False
        same_host = owner.address.rpartition(":")[0] == who.address.rpartition(":")[0]
        return self.owner_input.pauses_by_silence and same_host

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
        if mark == JUMPED:
            return "jumped"
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
