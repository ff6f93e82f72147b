"""What can be broken in the demo, and where the server must end."""

from __future__ import annotations

import asyncio
import itertools
import math
import socket
import struct
from typing import Final

from motion_protocol import Cue, Mode, Motion, encode_cue
from motion_protocol.cue import CUE, NO_FLAGS
from motion_protocol.framing import BLOCK_HEAD, HEADER, close_frame

SESSION: Final = 7

FAULTS: Final = {
    "cue-loss": "PARKED",
    "nan": "PARKED",
    "planner-kill": "PARKED",
    "web-kill": "RUN",
    "guard-kill": "RUN",
    "platform-loss": "FAULT",
}
"""Fault by name, and the state that must have been reached after it."""


def nan_packet(sequence: int) -> bytes:
    """A well-formed cue, checksum and all, whose every value is not a number."""
    still = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), speed=0.0)
    payload = bytearray(encode_cue(Cue(SESSION, sequence, 0, 0, still))[HEADER.size :])
    struct.pack_into("<6f", payload, BLOCK_HEAD.size, *([math.nan] * 6))
    return close_frame(
        CUE, bytes(payload), None, flags=NO_FLAGS, mode=Mode.DRIVE, session=SESSION,
        sequence=sequence, sim_time_ns=0, sender_time_ns=0,
    )  # fmt: skip


async def send_nan(address: tuple[str, int]) -> None:
    """Be a simulator whose every value is not a number, a hundred times a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        for sequence in itertools.count():
            link.sendto(nan_packet(sequence), address)
            await asyncio.sleep(0.01)
