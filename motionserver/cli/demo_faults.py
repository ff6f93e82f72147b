"""What can be broken in the demo, and where the server must end."""

from __future__ import annotations

import asyncio
import math
import socket
import struct
import zlib
from typing import Final

from motion_protocol import Cue, Motion, encode_cue

FAULTS: Final = {
    "cue-loss": "PARKED",
    "nan": "PARKED",
    "planner-kill": "PARKED",
    "web-kill": "RUN",
    "guard-kill": "RUN",
    "platform-loss": "FAULT",
}
"""Fault by name, and the state that must have been reached after it."""


_CRC: Final = 40
_HEADER: Final = 44
_VALUES: Final = 48
_CUE_SEED: Final = 0x1BA023E3


def _checksum(packet: bytes) -> int:
    return zlib.crc32(packet[_HEADER:], zlib.crc32(packet[:_CRC], _CUE_SEED))


async def send_nan(address: tuple[str, int]) -> None:
    """Be a simulator whose every value is not a number, a hundred times a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        sequence = 0
        while True:
            motion = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), speed=0.0)
            packet = bytearray(encode_cue(Cue(7, sequence, 0, 0, motion)))
            struct.pack_into("<6f", packet, _VALUES, *([math.nan] * 6))
            # the checksum runs on from the header's; changing both keeps the packet well-formed
            struct.pack_into("<I", packet, _CRC, _checksum(bytes(packet)))
            link.sendto(packet, address)
            sequence += 1
            await asyncio.sleep(0.01)
