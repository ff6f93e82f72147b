"""Replay: sends a recorded drive at the pace it was recorded, as if a simulator did."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from motion_protocol import (
    DEFAULT_PORT,
    PREVIEW_MAX,
    Flags,
    Mode,
    TimedPreview,
    preview_times,
)

from .beamng import MotionSimEncoder
from .drive_samples import PreviewSample
from .recording import RecordedSample, Recording, read_recording
from .sender import CueSender

Format: TypeAlias = Literal["native", "beamng"]
FORMATS: Final[tuple[Format, ...]] = ("native", "beamng")
_SLICE: Final = 0.1  # longest wait between two looks at `stop` [s]
LONGEST_PREVIEW: Final = 2.0
"""A preview further ahead is not sent along [s]."""
FARTHEST: Final = 4.0
"""The latest instant of a preview that a packet can carry [s]."""
CLOSEST: Final = 2e-4
"""Two instants of a preview further apart than this stay two when they are rounded [s]."""


@dataclass(frozen=True, slots=True)
class ReplayCounts:
    """What a replay did.

    Attributes:
        sent: Samples handed to the network.
        unsent: Samples the network refused.
        skipped: Samples left out because the next one was already due.
        rounds: Complete passes over the recording.
    """

    sent: int
    unsent: int
    skipped: int
    rounds: int


def replay(
    path: str | Path,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    *,
    fmt: Format = "native",
    speed: float = 1.0,
    stop: Callable[[], bool] | threading.Event | None = None,
    loop: bool = False,
    preview: float = 0.0,
    key: bytes | None = None,
    clock_ns: Callable[[], int] = time.monotonic_ns,
    sleep: Callable[[float], None] = time.sleep,
    tell: Callable[[str], None] | None = None,
) -> ReplayCounts:
    """Send a recording's samples on an absolute grid of their recorded times.

    A native replay ends with bye, and marks the first sample of every further round as a
    teleport. The values are those recorded whatever `speed` is; only the pace changes.

    Args:
        path: The CSV file.
        host: Where the server listens.
        port: UDP port of the server's source of this format.
        fmt: `native` cues, or `beamng` MotionSim packets.
        speed: 2 is twice as fast as recorded.
        stop: Ends the replay when it is set or returns true.
        loop: Begin again at the end, until stopped.
        preview: Horizon of the recording's own future to send along [s]; native only. With 0,
            what a recording of the server holds of it is sent.
        key: Secret shared with the server; native only.
        clock_ns: Monotonic clock [ns].
        sleep: Waits for a duration [s].
        tell: Called with a line for whatever looks wrong in the recording.

    Raises:
        RecordingError: The file cannot be read.
        ValueError: An argument is out of range.
        OSError: The host's name cannot be resolved.
    """
    _check(fmt, speed, preview, port, key)
    recording = read_recording(path)
    if tell is not None:
        for warning in recording.warnings:
            tell(f"{recording.path.name}: warning: {warning}")
    has_stopped = _stop_function(stop)
    sent = unsent = skipped = rounds = 0
    round_length = recording.duration + recording.period
    first = recording.samples[0].time
    with ExitStack() as stack:
        send = _sender(stack, recording, host, port, fmt, preview, key, clock_ns)
        start_ns = clock_ns()

        def due_ns(index: int) -> int:
            round_, position = divmod(index, len(recording.samples))
            elapsed = round_ * round_length + recording.samples[position].time - first
            return start_ns + round(elapsed / speed * 1e9)

        total = len(recording.samples)
        index = 0
        while loop or index < total:
            _wait(due_ns(index), clock_ns, sleep, has_stopped)
            if has_stopped():
                break
            is_last = not loop and index == total - 1
            if not is_last and clock_ns() >= due_ns(index + 1):
                skipped += 1
            elif send(index % total, index // total, round_length):
                sent += 1
            else:
                unsent += 1
            index += 1
            rounds = index // total
    return ReplayCounts(sent, unsent, skipped, rounds)


def _check(fmt: str, speed: float, preview: float, port: int, key: bytes | None) -> None:
    if fmt not in FORMATS:
        raise ValueError(f"format {fmt!r} is not known; choose one of {', '.join(FORMATS)}")
    if not 0.01 <= speed <= 100.0:
        raise ValueError(
            f"speed {speed} is out of range; allowed are 0.01 to 100 (1 = as recorded)"
        )
    if not 0.0 <= preview <= LONGEST_PREVIEW:
        raise ValueError(
            f"preview {preview} s is out of range; allowed are 0 to {LONGEST_PREVIEW} s"
        )
    if fmt != "native" and (preview or key is not None):
        raise ValueError(f"format {fmt} can carry neither preview nor signature: leave both out")
    if not 1 <= port <= 65535:
        raise ValueError(f"port {port} is out of range; allowed are 1 to 65535")


def _stop_function(stop: Callable[[], bool] | threading.Event | None) -> Callable[[], bool]:
    if stop is None:
        return lambda: False
    return stop.is_set if isinstance(stop, threading.Event) else stop


def _wait(
    until_ns: int,
    clock_ns: Callable[[], int],
    sleep: Callable[[float], None],
    has_stopped: Callable[[], bool],
) -> None:
    while (left := until_ns - clock_ns()) > 0 and not has_stopped():
        sleep(min(left * 1e-9, _SLICE))


def _sender(
    stack: ExitStack,
    recording: Recording,
    host: str,
    port: int,
    fmt: Format,
    preview: float,
    key: bytes | None,
    clock_ns: Callable[[], int],
) -> Callable[[int, int, float], bool]:
    """Open what sends sample number `position` of round number `round_`."""
    samples = recording.samples
    if fmt == "beamng":
        encoder = MotionSimEncoder()
        peer = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        channel = stack.enter_context(socket.socket(*peer[:3]))
        channel.setblocking(False)

        def send_beamng(position: int, round_: int, round_length: float) -> bool:
            try:
                channel.sendto(encoder.encode(samples[position]), peer[4])
            except OSError:
                return False
            return True

        return send_beamng

    name = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    cue = stack.enter_context(CueSender(name, key=key, clock_ns=clock_ns))
    last_round = 0

    def send_native(position: int, round_: int, round_length: float) -> bool:
        nonlocal last_round
        sample = samples[position]
        before = cue.unsent
        elapsed = sample.time - samples[0].time + round_ * round_length
        cue.send(
            sample.acceleration,
            sample.rates,
            speed=sample.speed,
            attitude=sample.attitude,
            sim_time_ns=round(elapsed * 1e9),
            mode=_mode_of(sample) if round_ == last_round else Mode.TELEPORT,
            flags=Flags.REPLAY,
            preview=preview_of(recording, sample, preview) if preview else told_ahead(sample),
            driver=sample.driver,
        )
        last_round = round_
        return cue.unsent == before

    return send_native


def _mode_of(sample: RecordedSample) -> Mode:
    """As recorded; whoever took leave then does not take leave of this replay."""
    return Mode.PAUSE if sample.mode is Mode.BYE else sample.mode


def told_ahead(sample: RecordedSample) -> TimedPreview | None:
    """What the recorded sender told ahead, at its instants; None if nothing.

    What a packet cannot carry is left out: the past, what lies beyond 4 s or less than 0.2 ms after
    the one before, more than 40 samples.
    """
    told: list[PreviewSample] = []
    for one in sample.preview:
        is_later = not told or one.time >= told[-1].time + CLOSEST
        if 0.0 <= one.time <= FARTHEST and is_later and len(told) < PREVIEW_MAX:
            told.append(one)
    if not told:
        return None
    return TimedPreview(
        tuple(one.time for one in told),
        tuple((*one.acceleration, *one.rates) for one in told),
    )


def preview_of(recording: Recording, sample: RecordedSample, horizon: float) -> TimedPreview | None:
    """What the recording does after a sample, up to its end; None if nothing is left.

    Args:
        recording: The whole drive.
        sample: Where to look ahead from.
        horizon: How far [s].
    """
    left = recording.samples[-1].time - sample.time + 1e-6
    times = tuple(time for time in preview_times(horizon) if time <= left)
    if not times:
        return None
    return TimedPreview(times, tuple(recording.values_at(sample.time + time) for time in times))
