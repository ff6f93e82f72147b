"""An emulated Moog base on a UDP port, in real time, with a judge beside it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from .arrival_stamps import StampingSocket, bound_socket
from .datagram import own_bytes
from .flawed_link import FlawedLink, LinkFlaws
from .force_sender import ForceSender
from .moog_config import MoogConfig
from .moog_device import MoogDevice
from .moog_judge import MoogJudge
from .moog_judged import JudgedLimits
from .motion_log import MotionLog
from .platform_accelerometer import PlatformAccelerometer, SendForce

Address = tuple[str, int]
Mishap = tuple[float, Callable[[MoogDevice], None]]
"""Something done to the base so many seconds after the start, e.g. ``MoogDevice.press_estop``."""

DEFAULT_PORT = 991
"""UDP port of the real base; binding it takes privileges."""

ENDING = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
    if hasattr(signal, name)
)
"""What switches a base off that runs by itself; its verdict is written."""

_TICK = 0.005  # [s], how often the base is advanced while nothing arrives

MOST_HOSTS = 64
"""Addresses of hosts that are remembered for the verdict."""


class Emulator(asyncio.DatagramProtocol):
    """A base to talk to; use as an async context manager, or :meth:`start` and :meth:`stop`.

    Everything runs on the loop it was started on; :attr:`device` and the links may be tampered
    with from there at any time.

    Attributes:
        device: The base.
        judge: Sees every datagram as it arrived, before the flaws of ``to_base``.
        to_base: Link that commands take.
        to_host: Link that replies take.
    """

    def __init__(
        self,
        config: MoogConfig | None = None,
        *,
        listen: Address = ("127.0.0.1", 0),
        reply_port: int | None = None,
        limits: JudgedLimits | None = None,
        to_base: LinkFlaws | None = None,
        to_host: LinkFlaws | None = None,
        mishaps: Sequence[Mishap] = (),
        log: MotionLog | None = None,
        send_force: SendForce | None = None,
        seed: int = 0,
    ) -> None:
        """A base that is still switched off.

        Args:
            config: The machine.
            listen: Address to bind; port 0 takes a free one, see :attr:`address`.
            reply_port: Port of the host that replies go to; None replies to the sender's.
            limits: What the judge allows.
            to_base: Flaws of the commands' link.
            to_host: Flaws of the replies' link.
            mishaps: What happens to the base, and when after the start [s].
            log: Gets every datagram received; closed by its owner.
            send_force: Gets what an accelerometer on the platform reads, 100 times a second.
            seed: Of everything random.
        """
        config = MoogConfig() if config is None else config
        sensor = None
        if send_force is not None:
            at_home = (0.0, 0.0, config.home_heave, 0.0, 0.0, 0.0)
            sensor = PlatformAccelerometer(config.geometry, send_force, pose=at_home, seed=seed)
        self.device = MoogDevice(config, on_step=sensor.on_step if sensor else None)
        self.judge = MoogJudge(config, limits)
        self.to_base = FlawedLink(to_base, seed=seed + 1)
        self.to_host = FlawedLink(to_host, seed=seed + 2)
        self._listen = listen
        self._reply_port = reply_port
        self._mishaps = sorted(mishaps, key=lambda mishap: mishap[0])
        self._log = log
        self._hosts: set[Address] = set()
        self._replies = 0
        self._transport: asyncio.DatagramTransport | None = None
        self._socket: StampingSocket | None = None
        self._ticking: asyncio.Task[None] | None = None

    @property
    def address(self) -> Address:
        """Address the base listens on."""
        if self._transport is None:
            raise RuntimeError("the emulator has no address before start() and after stop()")
        host, port = self._transport.get_extra_info("sockname")[:2]
        return host, port

    async def start(self) -> Address:
        """Switch the base on and listen.

        Returns:
            The address listened on.

        Raises:
            OSError: The address cannot be bound.
        """
        loop = asyncio.get_running_loop()
        self._socket = bound_socket(self._listen)
        if not self._socket.is_stamping:
            self.judge.trust_no_instants()
        self._transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=self._socket)
        self.device.advance(time.monotonic())
        self._ticking = asyncio.create_task(self._tick(time.monotonic()))
        return self.address

    async def stop(self) -> None:
        """Stop listening; the base keeps the state it has."""
        if self._ticking is not None:
            self._ticking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._ticking
            self._ticking = None
        if self._transport is not None:
            self._transport.close()
            self._transport = self._socket = None
            await asyncio.sleep(0)  # asyncio closes the socket on its next turn

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.stop()

    def summary(self) -> dict[str, object]:
        """The judge's verdict, with what the emulator counted itself; JSON-able."""
        return {
            **self.judge.summary(self.device),
            "faults": [fault.name for fault in self.device.faults],
            "counters": dict(self.device.counters),
            "replies": self._replies,
            "hosts": sorted(f"{host}:{port}" for host, port in self._hosts),
            "lost_to_base": self.to_base.lost,
            "lost_to_host": self.to_host.lost,
        }

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Take one datagram off the socket."""
        now = time.monotonic()
        arrived_ns = time.monotonic_ns() if self._socket is None else self._socket.arrived_ns
        data = own_bytes(data)
        if self._log is not None:
            self._log.write(arrived_ns, data)
        if len(self._hosts) < MOST_HOSTS:
            self._hosts.add(addr[:2])
        self.device.advance(now)
        self.judge.observe(data, arrived_ns * 1e-9, self.device)
        for arrival in self.to_base.carry(now, data):
            self._after(arrival.delay, partial(self._deliver, arrival.datagram, addr))

    def error_received(self, exc: Exception) -> None:
        """Note that a host went away; a base does not mind."""
        self.device.counters["unreachable"] += 1

    def _deliver(self, data: bytes, addr: Address) -> None:
        now = time.monotonic()
        reply = self.device.receive(data, now)
        if reply is not None:
            for arrival in self.to_host.carry(now, reply):
                self._after(arrival.delay, partial(self._send, arrival.datagram, addr))

    def _send(self, reply: bytes, addr: Address) -> None:
        if self._transport is not None:
            port = addr[1] if self._reply_port is None else self._reply_port
            self._transport.sendto(reply, (addr[0], port))
            self._replies += 1

    def _after(self, delay: float, action: Callable[[], None]) -> None:
        if delay > 0.0:
            asyncio.get_running_loop().call_later(delay, action)
        else:
            action()

    async def _tick(self, origin: float) -> None:
        while True:
            now = time.monotonic()
            self.device.advance(now)
            while self._mishaps and now - origin >= self._mishaps[0][0]:
                self._mishaps.pop(0)[1](self.device)
            await asyncio.sleep(_TICK)


def run_emulator(
    listen_host: str,
    listen_port: int,
    config: MoogConfig | None = None,
    *,
    duration: float | None = None,
    reply_port: int | None = None,
    limits: JudgedLimits | None = None,
    to_base: LinkFlaws | None = None,
    to_host: LinkFlaws | None = None,
    mishaps: Sequence[Mishap] = (),
    log_path: Path | None = None,
    summary_path: Path | None = None,
    force_to: Address | None = None,
    key: bytes | None = None,
    seed: int = 0,
    on_ready: Callable[[Address], None] | None = None,
) -> dict[str, object]:
    """Run a base until one of :data:`ENDING`, or for ``duration`` seconds.

    Args:
        listen_host: Address to bind.
        listen_port: Port to bind; 0 takes a free one, told to ``on_ready``.
        config: The machine.
        duration: How long to run [s]; None until a signal.
        reply_port: Port of the host that replies go to; None replies to the sender's.
        limits: What the judge allows.
        to_base: Flaws of the commands' link.
        to_host: Flaws of the replies' link.
        mishaps: What happens to the base, and when after the start [s].
        log_path: File for every datagram received.
        summary_path: File for the verdict, JSON.
        force_to: Where to send, as cues 100 times a second, what an accelerometer on the platform
            reads.
        key: Shared secret those cues are signed with.
        seed: Of everything random.
        on_ready: Called with the address once the base listens.

    Returns:
        The verdict, see :meth:`Emulator.summary`.

    Raises:
        OSError: The address cannot be bound or a file not be written.
    """

    async def run(log: MotionLog, send_force: SendForce | None) -> dict[str, object]:
        done = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in ENDING:
            loop.add_signal_handler(number, done.set)
        emulator = Emulator(
            config,
            listen=(listen_host, listen_port),
            reply_port=reply_port,
            limits=limits,
            to_base=to_base,
            to_host=to_host,
            mishaps=mishaps,
            log=log,
            send_force=send_force,
            seed=seed,
        )
        async with emulator:
            if on_ready is not None:
                on_ready(emulator.address)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(done.wait(), duration)
        return emulator.summary()

    with contextlib.ExitStack() as stack:
        # nobody reads what it would keep in memory
        log = stack.enter_context(MotionLog(log_path, kept=0))
        sender = None
        if force_to is not None:
            sender = stack.enter_context(contextlib.closing(ForceSender(force_to, key=key)))
        verdict = asyncio.run(run(log, sender))
    if summary_path is not None:
        summary_path.write_text(json.dumps(verdict, indent=2) + "\n", encoding="utf-8")
    return verdict
