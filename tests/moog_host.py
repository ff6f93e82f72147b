"""The least of a Moog host, for tests: frames, and sixty of them a second in virtual time."""

import struct
from collections.abc import Callable, Sequence

from motion_clients.moog_device import MoogDevice
from motion_clients.moog_judge import MoogJudge

NEUTRAL = (0.0, 0.0, -0.2286, 0.0, 0.0, 0.0)
PERIOD = 1 / 60

Words = Sequence[float]


def frame(mcw: int, words: Words = NEUTRAL) -> bytes:
    return struct.pack("!I6fI", mcw, *words, 0)


def parse(reply: bytes) -> tuple[int, int, int, tuple[float, ...]]:
    faults, io, machine, *words, _ = struct.unpack("!3I6fI", reply)
    return faults, io, machine, tuple(words)


class VirtualHost:
    def __init__(self, device: MoogDevice, judge: MoogJudge | None = None) -> None:
        self.device = device
        self.judge = judge
        self.now = 0.0
        self.replies: list[bytes] = []

    def send(self, datagram: bytes) -> bytes | None:
        self.device.advance(self.now)
        if self.judge is not None:
            self.judge.observe(datagram, self.now, self.device)
        reply = self.device.receive(datagram, self.now)
        if reply is not None:
            self.replies.append(reply)
        self.now += PERIOD
        return reply

    def repeat(self, seconds: float, mcw: int, words: Words = NEUTRAL) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.send(frame(mcw, words))

    def play(self, seconds: float, words: Callable[[float], Words]) -> None:
        for k in range(round(seconds / PERIOD)):
            self.send(frame(130, words(k * PERIOD)))

    def be_silent(self, seconds: float) -> None:
        self.now += seconds
        self.device.advance(self.now)

    def engage(self, mode: int = 170, engage: int = 180) -> None:
        self.repeat(1.0, mode)
        self.repeat(4.0, engage)
