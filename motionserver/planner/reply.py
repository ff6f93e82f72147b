"""The status that the source's owner is told ten times a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from motion_protocol import Notices, Status, encode_status
from motion_protocol import PlatformState as WireState

from motionserver.core.intake.gate import Gate
from motionserver.core.safety.states import State
from motionserver.core.state import VehicleMotion
from motionserver.planner.inputs import Inputs
from motionserver.planner.source_notices import Notice, spoken
from motionserver.telemetry.link import STATES
from motionserver.telemetry.ticker import now_ns

STATUS_NS: Final = 100_000_000
"""Time between two answers [ns]."""
REFUSED_NS: Final = 500_000_000
"""How long a client is answered of which every packet is refused [ns]."""


class StatusSender:
    """Answers whoever owns the platform, else the client whose packets are refused."""

    def __init__(self, inputs: Inputs) -> None:
        self._inputs = inputs
        self._sent_ns = 0

    def send(
        self,
        now: int,
        newest: VehicleMotion | None,
        state: State | None,
        scale: float,
        notices: Sequence[Notice],
    ) -> None:
        """Answer, if it is time and somebody is there.

        Args:
            now: Now [ns].
            newest: The newest sample that was accepted.
            state: The guard's state; None if no guard is heard.
            scale: Share of the motion that is wanted now, fade included [-].
            notices: What is wrong with the packets.
        """
        inputs = self._inputs
        if now - self._sent_ns < STATUS_NS:
            return
        refused = inputs.out_of_range
        # an owner that says bye again and again is answered, and sees the platform park
        gate = inputs.vehicle
        has_owner = gate.owner is not None and not gate.is_silent(now)
        if has_owner:
            echo, source, address, key = newest, None, "", inputs.owner_key
        elif refused is not None and now - refused.arrival_ns <= REFUSED_NS:
            echo, source, address = refused.motion, refused.source, refused.address
            key = source.options.key
        else:
            return
        if echo is None or echo.sender_ns is None:
            return
        self._sent_ns = now
        told = State.OFFLINE if state is None else state
        packet = status_packet(gate, inputs.counters, echo, told, scale, notices)
        data = encode_status(packet, key)
        if source is None:
            inputs.reply(data)
        else:
            source.transport.reply(address, data)
        inputs.counters["status_sent"] += 1


def status_packet(
    gate: Gate,
    counters: Mapping[str, int],
    echo: VehicleMotion,
    state: State,
    scale: float,
    notices: Sequence[Notice] = (),
) -> Status:
    """Put a status together.

    Args:
        gate: Of the vehicle.
        counters: Of the inputs.
        echo: The newest sample, with the sender's time.
        state: The guard's state.
        scale: Share of the motion that is wanted now, fade included [-].
        notices: What is wrong with the packets.
    """
    assert echo.sender_ns is not None
    kinds = Notices.NONE
    for one in notices:
        kinds |= one.kind
    return Status(
        session=echo.session,
        sequence=counters["status_sent"] & 0xFFFFFFFF,
        sim_time_ns=echo.sim_time_ns,
        send_time_ns=now_ns(),
        echo_sender_time_ns=echo.sender_ns,
        receive_time_ns=echo.arrival_ns,
        echo_sequence=echo.sequence or 0,
        accepted_sequence=echo.sequence or 0,
        lost=gate.lost & 0xFFFFFFFF,
        reordered=counters["refused_reordered"] & 0xFFFFFFFF,
        rejected=counters["refused"] & 0xFFFFFFFF,
        scale=scale,
        state=WireState(STATES.index(state)),
        notices=kinds,
        notice_text=spoken(notices),
    )
