"""A whole server in real processes, an emulated base beside it, and hands to hurt both."""

import asyncio
import atexit
import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

import tomli_w
from motion_clients.flawed_link import LinkFlaws
from motion_clients.force_sender import ForceSender
from motion_clients.moog_emulator import Emulator
from motion_clients.moog_judged import JudgedLimits
from motion_clients.motion_log import MotionLog
from motion_clients.recording import recording_path
from motion_clients.replay import replay

from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.requests import RequestError, ask

ROOT = Path(__file__).parent.parent
LOGIN = os.environ.get("XDG_RUNTIME_DIR")
RUNTIME = tempfile.TemporaryDirectory(prefix="motion-", ignore_cleanup_errors=True)
atexit.register(RUNTIME.cleanup)
PATIENCE = 60.0
"""Longest wait for anything [s]: the machine may be busy; a wait that ends early costs nothing."""
_ARROW = re.compile(r"motionserver\.guard (\w+) -> (\w+): ")


class GaveUpError(AssertionError):
    """Something that had to happen did not."""


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def prompt() -> None:
    """Let the calling thread be punctual where that is permitted: it plays a device.

    All threads of the tests' process need it: one that is kept waiting may hold the interpreter.
    """
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(20))


def unhurried() -> None:
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def environment() -> dict[str, str]:
    paths = [str(ROOT / name) for name in ("", "protocol", "clients")]
    kept = {k: v for k, v in os.environ.items() if not k.startswith("MOTIONSERVER_")}
    if kept.get("XDG_RUNTIME_DIR") == LOGIN:
        # servers announce themselves there: this worker sees its own alone
        kept["XDG_RUNTIME_DIR"] = RUNTIME.name
    return {**kept, "PYTHONPATH": os.pathsep.join(paths)}


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "motionserver", *arguments]


def cli(*arguments: str, timeout: float = PATIENCE) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments),
        env=environment(),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def until(what: Callable[[], Any], why: str, patience: float = PATIENCE) -> Any:
    """Wait for a true answer."""
    deadline = time.monotonic() + patience
    while not (found := what()):
        if time.monotonic() > deadline:
            raise GaveUpError(f"waited {patience:g} s for {why}")
        time.sleep(0.01)
    return found


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text("ascii").rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


class Base:
    """An emulated base on a loop of its own."""

    def __init__(
        self, log: Path, force_to: tuple[str, int] | None = None, may_lose: bool = False
    ) -> None:
        self._log_path, self._force_to = log, force_to
        self._limits = JudgedLimits(may_lose=may_lose)
        self._loop = asyncio.new_event_loop()
        self._done = asyncio.Event()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._summary: dict[str, Any] = {}
        self.port = 0

    def _run(self) -> None:
        prompt()
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._main())
        finally:
            self._loop.close()

    async def _main(self) -> None:
        with contextlib.ExitStack() as stack:
            log = stack.enter_context(MotionLog(self._log_path))
            sender = None
            if self._force_to is not None:
                sender = stack.enter_context(contextlib.closing(ForceSender(self._force_to)))
            self.emulator = Emulator(log=log, send_force=sender, limits=self._limits)
            async with self.emulator:
                self.port = self.emulator.address[1]
                self._ready.set()
                await self._done.wait()
            self._summary = self.emulator.summary()

    def start(self) -> None:
        self._thread.start()
        if not self._ready.wait(PATIENCE):
            raise GaveUpError("the emulated base did not start")

    def do(self, what: Callable[[Emulator], Any]) -> Any:
        """Run something on the base's own loop."""

        async def now() -> Any:
            return what(self.emulator)

        return asyncio.run_coroutine_threadsafe(now(), self._loop).result(PATIENCE)

    def pull_cable(self) -> None:
        silent = LinkFlaws(silences=((0.0, float("inf")),))

        def cut(emulator: Emulator) -> None:
            emulator.to_base.flaws = emulator.to_host.flaws = silent

        self.do(cut)

    def stop(self) -> dict[str, Any]:
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._done.set)
            self._thread.join(PATIENCE)
        return self._summary


class Rig:
    """Server, base and drives of one test; a context manager that leaves nothing behind."""

    def __init__(
        self,
        folder: Path,
        config: Mapping[str, Mapping[str, Any]] | None = None,
        sources: tuple[dict[str, Any], ...] = (),
        web: bool = False,
        imu: bool = False,
        arguments: tuple[str, ...] = (),
        base: Any = None,
        within: tuple[str, ...] = (),
    ) -> None:
        """Start all.

        Args:
            folder: Where everything is written.
            config: Sections that differ from the rig's own.
            sources: Further sources.
            web: Whether there is a page.
            imu: Whether the base sends what its accelerometer reads.
            arguments: Of the server, behind its configuration.
            base: Another base than `Base`, with its `start`, `port` and `stop`.
            within: Command that runs the server's command, such as ``ip netns exec NAME``.
        """
        self.folder, self.run_dir = folder, folder / "run"
        self.cue_port = free_port()
        self.page_port = free_port(socket.SOCK_STREAM) if web else 0
        imu_port = free_port() if imu else 0
        force_to = ("127.0.0.1", imu_port) if imu else None
        self.base = Base(folder / "base.log", force_to) if base is None else base
        self.base.start()
        wanted = [{"kind": "native", "listen": f"127.0.0.1:{self.cue_port}"}, *sources]
        if imu:
            wanted.append({"kind": "imu", "listen": f"127.0.0.1:{imu_port}"})
        data: dict[str, Any] = {
            "server": {"run_dir": str(self.run_dir), "state_dir": str(folder / "state")},
            "platform": {"port": self.base.port, "local_port": 0},
            "web": {"enabled": web, "port": self.page_port},
            "sources": wanted,
        }
        for section, values in (config or {}).items():
            data[section] = {**data.get(section, {}), **values}
        self.config = folder / "server.toml"
        self.config.write_text(tomli_w.dumps(data), "utf-8")
        self.log = folder / "server.log"
        self._maps: dict[str, MappedFile] = {}
        self._drives: list[tuple[threading.Thread, threading.Event]] = []
        with self.log.open("wb") as log:
            self.server = subprocess.Popen(
                [*within, *command("run", str(self.config), *arguments)],
                env=environment(),
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def __enter__(self) -> Self:
        prompt()
        return self

    def __exit__(self, *_: object) -> None:
        unhurried()
        for _, stop in self._drives:
            stop.set()
        for thread, _ in self._drives:
            thread.join(PATIENCE)
        if self.server.poll() is None:
            self.server.kill()
            self.server.wait(PATIENCE)
        with contextlib.suppress(GaveUpError):
            until(lambda: not self.leftovers(), "children to end", 30.0)
        for pid in self.leftovers():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.base.stop()
        for mapped in self._maps.values():
            mapped.close()

    def shown(self, name: str = "guard") -> dict[str, Any]:
        """Newest snapshot of guard, planner or service; empty before the first."""
        if name not in self._maps:
            try:
                self._maps[name] = MappedFile(self.run_dir / f"{name}.map")
            except (OSError, ValueError):
                return {}
        message = self._maps[name].read()
        return {} if message is None else json.loads(message[1])

    @property
    def state(self) -> str:
        return str(self.shown().get("state", ""))

    def counter(self, name: str, of: str = "planner") -> int:
        return int(self.shown(of).get("counters", {}).get(name, 0))

    def pid(self, name: str) -> int | None:
        """Process id of guard, spare, planner or web, as the supervisor sees it."""
        return self.shown("service").get(name)

    def wait_for(self, what: Callable[[], Any], why: str, patience: float = PATIENCE) -> Any:
        def awaited() -> Any:
            if self.server.poll() is not None:
                return "ended"
            return what()

        try:
            found = until(awaited, why, patience)
        except GaveUpError as error:
            raise GaveUpError(f"{error}; {self.story()}") from None
        if found == "ended" and not what():
            raise GaveUpError(f"the server ended while waiting for {why}; {self.story()}")
        return found

    def wait_state(self, *states: str, patience: float = PATIENCE) -> str:
        self.wait_for(lambda: self.state in states, f"state {' or '.join(states)}", patience)
        return self.state

    def story(self) -> str:
        """What helps to understand a failure."""
        planner = self.shown("planner")
        shown = {k: planner.get(k) for k in ("source", "counters", "trouble")}
        return f"state {self.state}, planner {shown}, log:\n{self.text()[-6000:]}"

    def text(self) -> str:
        return self.log.read_text("utf-8", "replace")

    def transitions(self) -> list[tuple[str, str]]:
        """All changes of state, of all guards, in order, from the log."""
        return [(a, b) for a, b in _ARROW.findall(self.text())]

    def way(self) -> list[tuple[str, str]]:
        """The changes of state without momentary holds: a busy machine may hold for a moment."""
        way: list[tuple[str, str]] = []
        for step in self.transitions():
            if step == ("HOLD", "RUN") and way[-1:] == [("RUN", "HOLD")]:
                way.pop()
            else:
                way.append(step)
        return way

    def ask(self, op: str, **more: Any) -> dict[str, Any]:
        return ask(self.run_dir / "guard.sock", {"op": op, "by": "console", **more}, timeout=5.0)

    def drive(
        self, recording: str = "truck_brake_accel", fmt: Any = "native", port: int = 0, **more: Any
    ) -> threading.Event:
        """Replay a recording for ever; set the answer to end it."""
        stop = threading.Event()

        def send() -> None:
            prompt()
            path = recording_path(recording)
            replay(path, "127.0.0.1", port or self.cue_port, fmt=fmt, stop=stop, loop=True, **more)

        thread = threading.Thread(target=send, daemon=True)
        self._drives.append((thread, stop))
        thread.start()
        return stop

    def engage(self) -> None:
        """Engage as soon as it is granted."""

        def granted() -> bool:
            try:
                return bool(self.ask("engage")["ok"])
            except RequestError:
                return False

        self.wait_state("PARKED")
        self.wait_for(granted, "engaging to be granted")

    def run(self) -> None:
        """Drive, engage, and wait until the platform runs."""
        self.drive()
        self.engage()
        self.wait_state("RUN")
        self.wait_for(self.is_moving, "motion")

    def is_moving(self) -> bool:
        return max(map(abs, self.shown().get("leg_speed", [0.0]))) > 0.01

    def accepted(self) -> int:
        return self.counter("plans_accepted", "guard")

    def wait_plans(self, count: int) -> None:
        """Wait for so many further plans: a measure of time that a slow machine stretches."""
        goal = self.accepted() + count
        self.wait_for(lambda: self.accepted() >= goal, f"{count} plans")

    def send_signal(self, number: int = signal.SIGTERM) -> None:
        self.server.send_signal(number)

    def end(self, number: int = signal.SIGTERM) -> int:
        """End by a signal; the server's exit status."""
        if self.server.poll() is None:
            self.send_signal(number)
        try:
            return self.server.wait(120.0)
        except subprocess.TimeoutExpired:
            raise GaveUpError(f"the server does not end; {self.story()}") from None

    def verdict(self) -> dict[str, Any]:
        """The base's verdict; switches it off."""
        return self.base.stop()

    def leftovers(self) -> list[int]:
        """Processes of this server that live."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and is_alive(int(entry.name)):
                with contextlib.suppress(OSError):
                    if str(self.run_dir).encode() in (entry / "cmdline").read_bytes():
                        found.append(int(entry.name))
        return found


def assert_soft(verdict: Mapping[str, Any]) -> None:
    """The base saw nothing it must not see, and is down or safe."""
    assert verdict["violations"] == 0, verdict["first_violations"]
    assert verdict["ended_safe"], verdict["states_visited"]
