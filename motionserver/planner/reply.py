"""The status that the source's owner is told ten times a second."""

from __future__ import annotations

from collections.abc import Mapping

from motion_protocol import PlatformState as WireState
from motion_protocol import Status

from motionserver.core.intake.gate import Gate
from motionserver.core.safety.states import State
from motionserver.core.state import VehicleMotion
from motionserver.telemetry.link import STATES
from motionserver.telemetry.ticker import now_ns


def status_packet(
    gate: Gate, counters: Mapping[str, int], echo: VehicleMotion, state: State, scale: float
) -> Status:
    """Put a status together.

    Args:
        gate: Of the vehicle; it has an owner.
        counters: Of the inputs.
        echo: The newest sample, with the sender's time.
        state: The guard's state.
        scale: Share of the motion that is wanted now, fade included [-].
    """
    assert gate.owner is not None
    assert echo.sender_ns is not None
    return Status(
        session=gate.owner.session,
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
    )
