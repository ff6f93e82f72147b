"""How long a datagram of each format can be: what is longer or shorter is none of it."""

from __future__ import annotations

from typing import Final

from motion_protocol import MAX_DATAGRAM
from motion_protocol.framing import HEADER

from motionserver.sources.udp import LARGEST

_SIZES: Final = {
    "native": (HEADER.size, MAX_DATAGRAM),
    "imu": (HEADER.size, MAX_DATAGRAM),
    # BNG1 is 88 bytes long, BNG2 longer
    "beamng": (88, LARGEST),
}


def sizes_of(kind: str) -> tuple[int, int]:
    """Shortest and longest datagram [bytes]; of a third party's format anything that is read."""
    return _SIZES.get(kind, (0, LARGEST))
