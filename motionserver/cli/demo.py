"""The demo: server, emulated base, a truck's recording over UDP, the page; judged by the base."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import signal
import socket
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from motion_clients.recording import recording_names

from motionserver.cli.demo_faults import FAULTS, send_nan
from motionserver.cli.demo_setup import demo_config
from motionserver.cli.demo_show import line, verdict_text
from motionserver.cli.serving import make_service
from motionserver.errors import ConfigError
from motionserver.evaluate.bench.processes import free_port
from motionserver.evaluate.files import check_file
from motionserver.settings.config import load_config
from motionserver.supervisor.service import Service
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.requests import RequestError, ask
from motionserver.telemetry.signals import PARKING, ignore_signals

PAGE_PORT: Final = 8080
FAULT_AFTER: Final = 12.0
"""When the fault strikes, after the drive began, unless --seconds says where the middle is [s]."""
PATIENCE: Final = 60.0
"""Longest wait for a state [s]."""
SHOW_EVERY: Final = 0.02
"""How often the server's state is looked at [s]."""


class Demo:
    """One demo run."""

    def __init__(
        self,
        seconds: float | None,
        page: bool,
        algorithm: str,
        fault: str,
        recording: str,
        json_out: Path | None,
    ) -> None:
        if fault and fault not in FAULTS:
            raise ConfigError("--fault", f"unknown {fault!r}", f"Allowed: {', '.join(FAULTS)}.")
        if recording not in recording_names():
            names = ", ".join(recording_names())
            raise ConfigError("--recording", f"unknown {recording!r}", f"Allowed: {names}.")
        if seconds is not None and not seconds > 0.0:
            raise ConfigError("--seconds", f"{seconds:g}", "Give a positive number.")
        check_file("--json", json_out)
        # a page that is to be killed must be there
        self.seconds, self.page, self.algorithm = seconds, page or fault == "web-kill", algorithm
        self.fault, self.recording, self.json_out = fault, recording, json_out
        self._children: list[asyncio.subprocess.Process] = []
        self._states: list[str] = []
        self._began = 0.0
        self._answered = False

    def run(self) -> int:
        """Run it; 0 only if the base saw no violation and ended safe."""
        ignore_signals(but=PARKING)
        logging.basicConfig(level=logging.WARNING, format="%(message)s")
        with tempfile.TemporaryDirectory(prefix="motionserver-demo-") as folder:
            return asyncio.run(self._main(Path(folder)))

    async def _main(self, folder: Path) -> int:
        self._began = asyncio.get_running_loop().time()
        base, cue, imu = (free_port(socket.SOCK_DGRAM) for _ in range(3))
        page_port = free_port(socket.SOCK_STREAM, PAGE_PORT)
        page = page_port if self.page else None
        overrides = demo_config(folder, self.algorithm, base, (cue, imu), page)
        config = load_config(None, overrides)
        service = make_service(config, folder / "run", dry_run=False)
        verdict = folder / "verdict.json"
        options = ["--listen", f"127.0.0.1:{base}", "--summary", str(verdict)]
        options += ["--force-to", f"127.0.0.1:{imu}"]
        if self.fault == "platform-loss":
            options += ["--cut-after", str(self._fault_at() + 6.0)]
        emulator = await self._start("emulate", "moog-6dof2000e", *options)
        say(f"motionserver demo: {self.recording} -> {self.algorithm} -> emulated Moog 6DOF2000E")
        if self.page:
            say(f"page  http://127.0.0.1:{page_port}")
        serving = asyncio.create_task(service.run())
        try:
            driving = asyncio.create_task(self._drive(service, folder, cue))
            # whatever ends the drive, a mistake of ours too, ends the demo
            driving.add_done_callback(lambda _: service.leave())
            showing = asyncio.create_task(self._show(folder / "run"))
            status = await serving
            await asyncio.sleep(2 * SHOW_EVERY)
            for task in (driving, showing):
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task
        finally:
            await self._stop_all(emulator)
        return self._conclude(verdict, status)

    def _fault_at(self) -> float:
        return FAULT_AFTER if self.seconds is None else max(1.0, 0.5 * self.seconds - 6.0)

    async def _drive(self, service: Service, folder: Path, cue: int) -> None:
        """Wait for the base, begin the drive, engage, break what shall be broken, end."""
        run_dir = folder / "run"
        await self._until("PARKED")
        if self.page:
            tokens = folder / "tokens.json"
            for _ in range(100):
                if tokens.exists():
                    break
                await asyncio.sleep(0.05)
            with contextlib.suppress(OSError, ValueError, KeyError):
                words = json.loads(tokens.read_text("utf-8"))
                say(f"operator token for the page's buttons: {words['operator']}")
        replay = await self._start("replay", self.recording, "--to", f"127.0.0.1:{cue}", "--loop")
        while True:
            with contextlib.suppress(RequestError):
                answer = await asyncio.to_thread(
                    ask, run_dir / "guard.sock", {"op": "engage", "by": "console"}
                )
                if answer["ok"]:
                    break
            await asyncio.sleep(0.1)
        if await self._until("RUN", "FAULT") and self.fault:
            if self._states[-1] == "RUN":
                await asyncio.sleep(self._fault_at())
            await self._break(service, replay, cue)
            self._answered = await self._until(FAULTS[self.fault])
        if self.seconds is not None:
            await asyncio.sleep(max(0.0, self.seconds - self._time()))
        elif self.fault:
            await asyncio.sleep(4.0)
        else:
            await asyncio.Event().wait()

    async def _break(self, service: Service, replay: asyncio.subprocess.Process, cue: int) -> None:
        say(f"fault: {self.fault}")
        if self.fault in ("cue-loss", "nan"):
            replay.kill()
        if self.fault == "nan":
            self._nan = asyncio.create_task(send_nan(("127.0.0.1", cue)))
        victim = {
            "planner-kill": service.planner,
            "web-kill": service.web,
            "guard-kill": service.active_guard,
        }.get(self.fault)
        if victim is not None:
            victim.signal(signal.SIGKILL)

    async def _until(self, *states: str) -> bool:
        """Wait until the server is in one of ``states``; False if it does not get there."""
        deadline = self._time() + PATIENCE
        while not set(self._states[-1:]) & set(states):
            if self._time() > deadline or self._states[-1:] in (["FAULT"], ["SAFE"]):
                say(f"waited in vain for {' or '.join(states)}, saw {self._states}")
                return False
            await asyncio.sleep(SHOW_EVERY)
        return True

    async def _show(self, run_dir: Path) -> None:
        guard, planner = MappedFile(run_dir / "guard.map"), MappedFile(run_dir / "planner.map")
        tick = 0
        while True:
            snapshot, plans = _read(guard), _read(planner)
            if snapshot is not None:
                if self._states[-1:] != [snapshot["state"]]:
                    self._states.append(snapshot["state"])
                    say(f"{self._time():6.1f} s  {snapshot['state']}: {snapshot['reason']}")
                elif tick % 50 == 0 and snapshot["state"] in ("RUN", "HOLD"):
                    say(f"{self._time():6.1f} s  {line(snapshot, plans)}")
            tick += 1
            await asyncio.sleep(SHOW_EVERY)

    def _time(self) -> float:
        return asyncio.get_running_loop().time() - self._began

    async def _start(self, *arguments: str) -> asyncio.subprocess.Process:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "motionserver",
            *arguments,
            stdout=asyncio.subprocess.DEVNULL,
            # Ctrl-C parks the platform first; the base must live until then
            start_new_session=True,
        )
        self._children.append(process)
        return process

    async def _stop_all(self, emulator: asyncio.subprocess.Process) -> None:
        if emulator.returncode is None and self._states[-1:] != ["PARKED"]:
            # a base that lost its host parks itself: let it come down before it is judged
            await asyncio.sleep(6.0)
        for process in self._children:
            if process.returncode is None:
                process.send_signal(signal.SIGTERM)
        for process in self._children:
            try:
                await asyncio.wait_for(process.wait(), 5.0)
            except TimeoutError:
                process.kill()

    def _conclude(self, verdict: Path, status: int) -> int:
        try:
            summary: dict[str, Any] = json.loads(verdict.read_text("utf-8"))
        except (OSError, ValueError) as error:
            say(f"the base left no verdict: {error}")
            return 1
        summary["server_states"] = self._states
        summary["server_status"] = status
        say(verdict_text(summary))
        if self.json_out is not None:
            self.json_out.write_text(json.dumps(summary, indent=2), "utf-8")
        safe = summary["violations"] == 0 and summary["ended_safe"]
        drove = "RUN" in self._states or self.fault == "platform-loss"
        if not drove:
            say(f"it never ran: {self._states}")
        if self.fault and not self._answered:
            say(f"expected {FAULTS[self.fault]} after {self.fault}, saw {self._states}")
        return 0 if safe and drove and (self._answered or not self.fault) else 1


def _read(source: MappedFile) -> dict[str, Any] | None:
    message = source.read()
    return None if message is None else json.loads(message[1])


def say(text: str) -> None:
    """Print a line at once, also into a pipe; a terminal that has closed ends nothing."""
    with contextlib.suppress(OSError):
        sys.stdout.write(text + os.linesep)
        sys.stdout.flush()
