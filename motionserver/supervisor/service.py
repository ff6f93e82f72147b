"""The service: opens the platform's socket, starts and watches guard, planner and page."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import signal
from pathlib import Path
from typing import Any, Final

from motionserver.core.safety.states import CUED
from motionserver.errors import ConfigError
from motionserver.supervisor.addresses import claim_platform, open_link, try_addresses, try_way
from motionserver.supervisor.child import Child
from motionserver.supervisor.contents import (
    has_histories,
    is_not_pages,
    is_pages,
    make_contents,
)
from motionserver.supervisor.guards import GUARDS, GuardGroup
from motionserver.supervisor.pulse import POLL, Pulse, is_runnable
from motionserver.supervisor.run_dir_watch import POLL as WATCH
from motionserver.supervisor.run_dir_watch import RunDirWatch
from motionserver.supervisor.rundir import clean, take
from motionserver.supervisor.standstill import IDLE, Standstill, activity_of
from motionserver.supervisor.standstill import POLL as LOOK
from motionserver.telemetry.last_word import write_last_word
from motionserver.telemetry.link import STATES, GuardClock, Maps
from motionserver.telemetry.notify import Notifier
from motionserver.telemetry.oom import SERVICE, set_oom_score
from motionserver.telemetry.run_files import INHERITED
from motionserver.telemetry.signals import PARKING
from motionserver.telemetry.ticker import now_ns

LOST: Final = 4
"""Exit status of a service that parked because its run directory was lost."""
BOX_PATIENCE: Final = 10.0
"""Longest wait for a dump when the service ends [s]."""
log = logging.getLogger("motionserver.supervisor")


class Service:
    """One server on one platform."""

    def __init__(
        self, resolved: dict[str, Any], config_web: bool, local: tuple[str, int], run_dir: Path
    ) -> None:
        """Take the run directory and the platform's socket.

        Args:
            resolved: What `settings.resolve` made of the configuration.
            config_web: True if the page is wanted.
            local: Local address of the platform's socket.
            run_dir: Where the processes meet.

        Raises:
            ConfigError: Another server runs here, or an address cannot be bound.
        """
        self.run_dir = run_dir
        with contextlib.ExitStack() as undo:
            self._lock = undo.enter_context(take(run_dir))
            peer = resolved["platform"]["host"], resolved["platform"]["port"]
            try_way(*peer)
            self._claim = undo.enter_context(claim_platform(*peer))
            self._link = undo.enter_context(open_link(local))
            try_addresses(resolved["sources"], resolved["web"] if config_web else None)
            undo.pop_all()
        self.local_port: int = self._link.getsockname()[1]
        clean(self.run_dir)
        try:
            self._files = make_contents(run_dir, resolved)
            self._maps = Maps(run_dir)
            self._door = self._files.open_door()
        except OSError as error:
            for held in (self._link, self._claim, self._lock):
                held.close()
            raise ConfigError(
                "[server] run_dir", f"{run_dir}: {error.strerror}", "Give a folder with 1 MB free."
            ) from error
        self._make_children(resolved, config_web)
        self._run_dir_watch = RunDirWatch(run_dir, self._files)
        self._leave = asyncio.Event()
        self._manager = Notifier()
        self._why = ""
        self.exit_status = 0

    def _make_children(self, resolved: dict[str, Any], config_web: bool) -> None:
        files, run_dir = self._files, str(self.run_dir)
        where, held = files.handed(is_not_pages)
        told = {INHERITED: where}
        link = self._link.fileno()
        guard = ("-m", "motionserver.guard", run_dir, str(link))
        inherited = (link, self._claim.fileno(), *held)
        guards = [Child(name, guard, inherited, told, True) for name in GUARDS]
        self.guards = GuardGroup(guards, self._maps, files)
        self.planner = Child("planner", ("-m", "motionserver.planner", run_dir), held, told, True)
        self.planner.may_start = self._is_not_cued
        where, held_by_page = files.handed(is_pages)
        page = ("-m", "motionserver.web", str(self.run_dir / "web.json"))
        self.web = Child("web", page, held_by_page, {INHERITED: where}, True)
        self.web.wanted = config_web
        box = resolved["blackbox"]
        watcher = ("-m", "motionserver.telemetry.blackbox", run_dir, box["folder"])
        self.box = Child("black box", (*watcher, str(box["kept"])), held, told, True)
        self.box.wanted = has_histories(files)

    def leave(self, why: str = "") -> None:
        """End softly: park, then stop everything; ``why`` is shown if it is no operator's wish."""
        self._why = self._why or why
        self._leave.set()

    async def run(self) -> int:
        """Run until told to leave and parked.

        Returns:
            0 if the guard ended parked, 3 if it ended standing in a fault, `LOST` if it parked
            because the run directory was lost.
        """
        loop = asyncio.get_running_loop()
        for number in PARKING:
            loop.add_signal_handler(number, self.leave)
        children = (*self.guards.children, self.planner, self.web, self.box)
        set_oom_score(SERVICE)
        keepers = [asyncio.create_task(child.keep()) for child in children]
        works = (self._show(), self._feel_pulse(), self._replace_frozen(), self._watch_run_dir())
        answering = asyncio.create_task(self._hand_out())
        watchers = [asyncio.create_task(work) for work in works]
        teller = asyncio.create_task(self._tell_manager())
        await self._leave.wait()
        log.info("parking%s", f": {self._why}" if self._why else "")
        self._manager.tell(STOPPING=1, STATUS=f"parking {self._why}".strip())
        self._write_snapshot()
        self.planner.wanted = self.web.wanted = False
        self.exit_status = await self.guards.park()
        for watcher in watchers:
            watcher.cancel()
        # the black box may be writing down how the guard ended
        await asyncio.gather(
            self.planner.end(signal.SIGTERM, 3.0),
            self.web.end(signal.SIGTERM, 3.0),
            self.box.end(signal.SIGINT, BOX_PATIENCE),
        )
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(asyncio.gather(*keepers), 5.0)
        teller.cancel()
        answering.cancel()
        ended = "parked" if self.exit_status == 0 else "standing in a fault"
        self._manager.tell(STATUS=f"ended {ended}")
        clean(self.run_dir)
        for held in (self._door, self._files, self._link, self._claim, self._lock):
            held.close()
        if self.exit_status == 0 and self._why:
            self.exit_status = LOST
        return self.exit_status

    def _is_not_cued(self) -> bool:
        """A planner that died is replaced once the platform parks: its successor knows nothing."""
        message = self._maps.clock.read()
        return message is None or STATES[GuardClock.unpack(message[1]).state] not in CUED

    @property
    def active_guard(self) -> Child:
        """The guard that moves the platform."""
        return self.guards.active

    def _deaths(self) -> list[tuple[int, str, int, int]]:
        """Ends that nobody wanted, oldest first: instant [ns], who, exit status, process id."""
        everybody = (*self.guards.children, self.planner, self.web, self.box)
        return sorted(
            (at, child.name, status, pid) for child in everybody for at, status, pid in child.deaths
        )

    async def _feel_pulse(self) -> None:
        """Kill a guard that stands still, so that the spare gets the lock."""
        pulse, loop, active = Pulse(), asyncio.get_running_loop(), self.active_guard
        while True:
            message = self._maps.clock.read()
            written = 0 if message is None else GuardClock.unpack(message[1]).written_ns
            # who it is and what it waits for matters only once its clock stands
            runnable = False
            if written == pulse.written_ns:
                active = self.active_guard
                runnable = active.pid is not None and is_runnable(active.pid)
            is_frozen = pulse.look(loop.time(), active.pid, written, runnable)
            # one that has noted its exit status may still wait for its last log lines
            if is_frozen and not self.guards.has_ended:
                log.error("%s stands still; killed, the spare takes over", active.name)
                active.signal(signal.SIGKILL)
            await asyncio.sleep(POLL)

    async def _replace_frozen(self) -> None:
        """Kill a planner or a page that stands still, so that it is started again."""
        loop = asyncio.get_running_loop()
        watched = (
            (self.planner, self._maps.planner, Standstill()),
            (self.web, self._maps.page, Standstill()),
        )
        while True:
            for child, shown, standstill in watched:
                activity = IDLE if child.pid is None else activity_of(child.pid)
                patience, sign = standstill.patience, shown.newest_sequence()
                if standstill.look(loop.time(), child.pid, sign, activity):
                    log.error(
                        "the %s stands still; killed, another is started (no report for %.0f s)",
                        child.name,
                        patience,
                    )
                    child.signal(signal.SIGKILL)
                elif said := standstill.still_loading():
                    log.info("the %s %s", child.name, said)
            await asyncio.sleep(LOOK)

    async def _tell_manager(self) -> None:
        """Ready once the guard shows itself; then how it goes, and that we are alive."""
        ready, pause = False, self._manager.watchdog / 3.0 or 1.0
        while True:
            message = self._maps.guard.read()
            if message is not None:
                shown = json.loads(message[1])
                more = {} if ready else {"READY": 1}
                ready = True
                status = f"{shown['state']}: {shown['reason']}"
                self._manager.tell(**more, WATCHDOG=1, STATUS=status)
            await asyncio.sleep(pause if ready else 0.05)

    async def _hand_out(self) -> None:
        """Give descriptors to others of this user, see `open_run_file`; one after the other."""
        loop = asyncio.get_running_loop()
        while True:
            link, _ = await loop.sock_accept(self._door)
            with link, contextlib.suppress(OSError, TimeoutError):
                name = await asyncio.wait_for(loop.sock_recv(link, 256), 1.0)
                self._files.answer(link, name)

    async def _watch_run_dir(self) -> None:
        """A run directory that is lost is an event: nobody could ask for parking any more."""
        while True:
            if (message := self._maps.guard.read()) is not None:
                write_last_word(self.run_dir, json.loads(message[1]))
            if lost := self._run_dir_watch.look():
                log.error("%s: no operator is heard any more; parking and ending", lost)
                self.leave(lost)
                return
            await asyncio.sleep(WATCH)

    async def _show(self) -> None:
        """Tell the page who lives."""
        while True:
            self._write_snapshot()
            await asyncio.sleep(0.1)

    def _write_snapshot(self) -> None:
        active, spare, reserve = self.guards.in_order()
        snapshot = {
            "pid": os.getpid(),
            "t_ns": now_ns(),
            "guard": active.pid,
            "spare": spare.pid,
            "reserve": reserve.pid,
            "planner": self.planner.pid,
            "web": self.web.pid,
            "blackbox": self.box.pid,
            "leaving": self._why,
            "deaths": self._deaths(),
            "restarts": {
                "guard": sum(child.restarts for child in self.guards.children),
                "planner": self.planner.restarts,
                "web": self.web.restarts,
                "blackbox": self.box.restarts,
            },
        }
        self._maps.service.write(json.dumps(snapshot).encode())
