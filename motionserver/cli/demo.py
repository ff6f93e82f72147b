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
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, Final

from motion_clients.recording import recording_names

from motionserver.cli.demo_drive import Driver
from motionserver.cli.demo_faults import FAULTS, send_nan
from motionserver.cli.demo_page import open_when_ready
from motionserver.cli.demo_setup import demo_config
from motionserver.cli.demo_show import verdict_text
from motionserver.cli.demo_watch import SHOW_EVERY, DemoError, FaultError, StateWatch
from motionserver.cli.page_link import ensure_tokens, operator_token, page_link, page_url
from motionserver.cli.running import Server, announced
from motionserver.cli.serving import make_service
from motionserver.errors import ConfigError
from motionserver.evaluate.bench.processes import free_port
from motionserver.evaluate.files import check_file
from motionserver.settings.config import load_config
from motionserver.settings.resolve import resolve
from motionserver.supervisor.service import Service
from motionserver.telemetry.signals import PARKING, ignore_signals

PAGE_PORT: Final = 8080
FAULT_AFTER: Final = 12.0
"""When the fault strikes, after the drive began, unless --seconds says where the middle is [s]."""


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
        open_page: bool = False,
    ) -> None:
        if open_page and not page:
            raise ConfigError("--open", "there is no page with --no-page", "Leave one of them out.")
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
        self.open_page = open_page
        self._children: dict[str, asyncio.subprocess.Process] = {}
        self._answered = False
        self._problem = ""

    def run(self) -> int:
        """Run it; 0 only if the base saw no violation and ended safe."""
        ignore_signals(but=PARKING)
        logging.basicConfig(level=logging.WARNING, format="%(message)s")
        with tempfile.TemporaryDirectory(prefix="motionserver-demo-") as folder:
            return asyncio.run(self._main(Path(folder)))

    async def _main(self, folder: Path) -> int:
        began = asyncio.get_running_loop().time()
        base, cue, imu = (free_port(socket.SOCK_DGRAM) for _ in range(3))
        page_port = free_port(socket.SOCK_STREAM, PAGE_PORT)
        page = page_port if self.page else None
        overrides = demo_config(folder, self.algorithm, base, (cue, imu), page)
        run_dir = folder / "run"
        resolved = resolve(config := load_config(None, overrides), run_dir)
        service = make_service(config, resolved, run_dir)
        verdict = folder / "verdict.json"
        options = ["--listen", f"127.0.0.1:{base}", "--summary", str(verdict)]
        options += ["--force-to", f"127.0.0.1:{imu}"]
        if self.fault == "platform-loss":
            options += ["--cut-after", str(self._fault_at() + 6.0)]
        watch = StateWatch(run_dir, say, began)
        driver = Driver(watch, run_dir, self._check_children)
        with contextlib.ExitStack() as stack:
            try:
                stack.enter_context(announced(Server(run_dir, folder / "state", "demo")))
            except OSError as error:
                say(f"only --run-dir {run_dir} finds this server: {error.strerror}")
            await self._start("emulator", "emulate", "moog-6dof2000e", *options)
            way = f"{self.recording} -> {self.algorithm} -> emulated Moog 6DOF2000E"
            say(f"motionserver demo: {way}")
            helpers = [asyncio.create_task(watch.show())]
            # without it nobody would notice what the server does
            helpers[0].add_done_callback(lambda _: service.leave())
            if self.page:
                helpers.append(asyncio.create_task(self._show_page(resolved["web"], watch.say)))
            watch.say("loading guard, planner and page: some 5 to 20 s")
            serving = asyncio.create_task(service.run())
            try:
                driving = asyncio.create_task(self._drive(service, driver, watch, cue))
                # whatever ends the drive, a mistake of ours too, ends the demo
                driving.add_done_callback(lambda _: service.leave())
                status = await serving
                await asyncio.sleep(2 * SHOW_EVERY)
                for task in (driving, *helpers):
                    task.cancel()
                    with contextlib.suppress(asyncio.CancelledError):
                        await task
            finally:
                await self._stop_all(watch)
        return self._conclude(verdict, status, watch, driver)

    def _show_page(
        self, web: dict[str, Any], tell: Callable[[str], None]
    ) -> Coroutine[None, None, None]:
        """Print the link that gives operator rights; the page may take seconds to answer."""
        tokens = Path(web["tokens_file"])
        ensure_tokens(tokens)
        link = page_link(page_url(web), operator_token(tokens))
        say(f"page  {link}")
        return open_when_ready(web["host"], web["port"], link, self.open_page, tell)

    def _fault_at(self) -> float:
        return FAULT_AFTER if self.seconds is None else max(1.0, 0.5 * self.seconds - 6.0)

    async def _drive(self, service: Service, driver: Driver, watch: StateWatch, cue: int) -> None:
        """Wait for the base, begin the drive, engage, break what shall be broken, end."""
        try:
            try:
                await watch.until("PARKED")
            except FaultError:
                await driver.reset()
            to = f"127.0.0.1:{cue}"
            replay = await self._start("simulator", "replay", self.recording, "--to", to, "--loop")
            if self.fault:
                await self._drive_into_fault(service, driver, watch, replay, cue)
            else:
                await driver.reach_run()
                await driver.keep_driving(self.seconds)
        except DemoError as error:
            self._problem = str(error)
            watch.say(f"the demo ends: {error}")

    async def _drive_into_fault(
        self,
        service: Service,
        driver: Driver,
        watch: StateWatch,
        replay: asyncio.subprocess.Process,
        cue: int,
    ) -> None:
        expected = FAULTS[self.fault]
        try:
            await driver.raise_once()
            await asyncio.sleep(self._fault_at())
            await self._break(service, replay, cue)
            await watch.until(expected)
        except FaultError:
            # a base whose cable is pulled early faults before anything else is broken
            if watch.state != expected:
                raise
        self._answered = True
        await asyncio.sleep(4.0 if self.seconds is None else max(0.0, self.seconds - watch.time))

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

    def _check_children(self) -> None:
        """Notice when the base or the simulator has ended by itself.

        Raises:
            DemoError: One has.
        """
        for name, process in self._children.items():
            if process.returncode is not None:
                raise DemoError(f"the {name} has ended by itself, status {process.returncode}")

    async def _start(self, name: str, *arguments: str) -> asyncio.subprocess.Process:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "motionserver",
            *arguments,
            stdout=asyncio.subprocess.DEVNULL,
            # Ctrl-C parks the platform first; the base must live until then
            start_new_session=True,
        )
        self._children[name] = process
        return process

    async def _stop_all(self, watch: StateWatch) -> None:
        emulator = self._children.get("emulator")
        if emulator and emulator.returncode is None and watch.state != "PARKED":
            # a base that lost its host parks itself: let it come down before it is judged
            await asyncio.sleep(6.0)
        for process in self._children.values():
            if process.returncode is None:
                process.send_signal(signal.SIGTERM)
        for process in self._children.values():
            try:
                await asyncio.wait_for(process.wait(), 5.0)
            except TimeoutError:
                process.kill()

    def _conclude(self, verdict: Path, status: int, watch: StateWatch, driver: Driver) -> int:
        try:
            summary: dict[str, Any] = json.loads(verdict.read_text("utf-8"))
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            say(f"the emulated base left no verdict ({why}): it ended before it could judge")
            return 1
        summary["server_states"] = watch.states
        summary["server_faults"] = driver.faults
        summary["server_status"] = status
        say(verdict_text(summary))
        if self.json_out is not None:
            self.json_out.write_text(json.dumps(summary, indent=2), "utf-8")
        safe = summary["violations"] == 0 and summary["ended_safe"]
        drove = "RUN" in watch.states or self.fault == "platform-loss"
        if driver.faults:
            say(f"faults on the way, each reset by the demo: {'; '.join(driver.faults)}")
        if not drove:
            say(f"it never drove; states: {' '.join(watch.states) or 'none'}")
        if self.fault and not self._answered:
            say(f"expected {FAULTS[self.fault]} after {self.fault}; states: {watch.states}")
        if self._problem:
            say(f"the demo ended early: {self._problem}")
        good = safe and drove and not self._problem and (self._answered or not self.fault)
        return 0 if good else 1


def say(text: str) -> None:
    """Print a line at once, also into a pipe; a terminal that has closed ends nothing."""
    with contextlib.suppress(OSError):
        sys.stdout.write(text + os.linesep)
        sys.stdout.flush()
