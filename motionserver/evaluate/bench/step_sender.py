"""The simulator of the latency benchmark: steps of acceleration at random phases."""

from __future__ import annotations

import random
import socket
import time
from typing import Final

from motion_protocol import Cue, Motion, encode_cue

CUE_PERIOD: Final = 0.01
"""Between two packets of the simulator [s]."""
STEP: Final = 2.0
"""Size of a step of acceleration [m/s2]."""
HOLD: Final = (0.3, 0.5)
"""A step is held this long, evenly at random [s]: the phase against the base's frames is too."""


class StepSender:
    """Sends cues a hundred times a second, and steps between them.

    Args:
        port: Where to, on loopback.
        seed: Of the phases.
        key: What the cues are signed with, if anything.

    Attributes:
        sent_ns: When each packet was sent [ns].
        steps_ns: When each step was [ns].
        by_bytes: When each packet was sent, by what was sent [ns].
    """

    def __init__(self, port: int, seed: int = 1, key: bytes | None = None) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        # not connected: a planner that is still starting refuses nothing
        self._peer = ("127.0.0.1", port)
        self._random = random.Random(seed)
        self._key = key
        self._start_ns = time.monotonic_ns()
        self._level = 0.0
        self.sent_ns: list[int] = []
        self.steps_ns: list[int] = []
        self.by_bytes: dict[bytes, int] = {}

    def send(self) -> int:
        """Send one cue now.

        Returns:
            When [ns].
        """
        now = time.monotonic_ns()
        motion = Motion((self._level, 0.0, 0.0), (0.0, 0.0, 0.0))
        cue = Cue(7, len(self.sent_ns), now - self._start_ns, now, motion)
        data = encode_cue(cue, self._key)
        now = time.monotonic_ns()
        self._socket.sendto(data, self._peer)
        self.sent_ns.append(now)
        self.by_bytes[data] = now
        return now

    def hold(self, seconds: float) -> None:
        """Go on with the same cue for ``seconds`` [s]."""
        end = time.monotonic() + seconds
        due = self.sent_ns[-1] * 1e-9 if self.sent_ns else time.monotonic()
        while (due := due + CUE_PERIOD) < end:
            time.sleep(max(0.0, due - time.monotonic()))
            self.send()
        time.sleep(max(0.0, end - time.monotonic()))

    def step(self) -> None:
        """Change the acceleration at once; the grid of packets begins anew there."""
        self._level = STEP - self._level
        self.steps_ns.append(self.send())

    def drive(self, seconds: float) -> None:
        """Steps at random instants for ``seconds`` [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()
            self.hold(self._random.uniform(*HOLD))

    def close(self) -> None:
        """Stop."""
        self._socket.close()
