"""Sends what a sensor on the platform reads to the server, as cues flagged so.

Not a :class:`~motion_clients.CueSender`: a sensor is no simulator, and must never say bye.
"""

from __future__ import annotations

import secrets
import socket
import time

from motion_protocol import Cue, Flags, Motion, Reference, Vector3, encode_cue


class ForceSender:
    """A UDP sender of measured specific force; call it with each reading.

    Attributes:
        sent: Packets handed to the network.
        refused: Packets the network would not take; a sensor does not wait for a receiver.
    """

    def __init__(
        self, address: tuple[str, int], *, key: bytes | None = None, session: int | None = None
    ) -> None:
        """A sender with a session of its own.

        Args:
            address: Where to send, host and port.
            key: Shared secret; with it packets are signed.
            session: Session number; random unless given.
        """
        self.sent = 0
        self.refused = 0
        self._key = key
        self._session = secrets.randbits(32) if session is None else session
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.connect(address)

    def __call__(self, now: float, specific_force: Vector3, rates: Vector3) -> None:
        """Send one reading of instant ``now`` [s], [m/s²] and [rad/s] in platform axes."""
        cue = Cue(
            session=self._session,
            sequence=(self.sent + self.refused) & 0xFFFFFFFF,
            sim_time_ns=round(now * 1e9),
            sender_time_ns=time.monotonic_ns(),
            motion=Motion(acceleration=specific_force, rates=rates, reference=Reference.PLATFORM),
            flags=Flags.GRAVITY_INCLUDED | Flags.MEASURED_AT_PLATFORM,
        )
        try:
            self._socket.send(encode_cue(cue, self._key))
        except OSError:
            self.refused += 1
        else:
            self.sent += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
