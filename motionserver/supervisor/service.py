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
from motionserver.supervisor.pulse import POLL, Pulse, is_runnable
from motionserver.supervisor.rundir import clean, take
from motionserver.supervisor.standstill import IDLE, Standstill, activity_of
from motionserver.supervisor.standstill import POLL as LOOK
from motionserver.telemetry.blackbox.room import make_room
from motionserver.telemetry.link import STATES, GuardClock, Maps
from motionserver.telemetry.notify import Notifier
from motionserver.telemetry.signals import PARKING
from motionserver.telemetry.ticker import now_ns

PARK_PATIENCE: Final = 90.0
"""Longest wait for the guard to park when the service ends [s]."""
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
        web = dict(resolved["web"])
        core = {key: value for key, value in resolved.items() if key != "web"}
        clean(self.run_dir)
        try:
            for name, content in (("config.json", core), ("web.json", web)):
                # keys of signed sources are in it
                (run_dir / name).touch(mode=0o600)
                (run_dir / name).write_text(json.dumps(content), "utf-8")
            self._maps = Maps(run_dir, create=True)
        except OSError as error:
            self._let_go()
            raise ConfigError(
                "[server] run_dir", f"{run_dir}: {error.strerror}", "Give a folder with 1 MB free."
            ) from error
        descriptor = self._link.fileno()
        guard = ("-m", "motionserver.guard", str(run_dir), str(descriptor))
        inherited = descriptor, self._claim.fileno()
        self.guards = [Child(name, guard, inherited) for name in ("guard", "spare guard")]
        self.planner = Child("planner", ("-m", "motionserver.planner", str(run_dir)))
        self.planner.may_start = self._is_not_cued
        self.web = Child("web", ("-m", "motionserver.web", str(run_dir / "web.json")))
        self.web.wanted = config_web
        self.box = self._black_box(resolved)
        self._leave = asyncio.Event()
        self._manager = Notifier()
        self.exit_status = 0

    def _black_box(self, resolved: dict[str, Any]) -> Child:
        """What keeps the last minute and writes it down; without room for it there is none."""
        box, planner = resolved["blackbox"], resolved["planner"]
        kept = box["kept"]
        if kept:
            try:
                make_room(self.run_dir, resolved["platform"]["rate_hz"], 1.0 / planner["period"])
            except OSError as error:
                log.warning("no black box: no room for it (%s)", error.strerror)
                kept = 0
        where = (str(self.run_dir), box["folder"], str(kept))
        child = Child("black box", ("-m", "motionserver.telemetry.blackbox", *where))
        child.wanted = kept > 0
        return child

    def leave(self) -> None:
        """End softly: park, then stop everything."""
        self._leave.set()

    async def run(self) -> int:
        """Run until told to leave and parked.

        Returns:
            0 if the guard ended parked, 3 if it ended standing in a fault.
        """
        loop = asyncio.get_running_loop()
        for number in PARKING:
            loop.add_signal_handler(number, self.leave)
        children = (*self.guards, self.planner, self.web, self.box)
        keepers = [asyncio.create_task(child.keep()) for child in children]
        works = (self._show(), self._feel_pulse(), self._replace_frozen())
        watchers = [asyncio.create_task(work) for work in works]
        teller = asyncio.create_task(self._tell_manager())
        await self._leave.wait()
        log.info("parking")
        self._manager.tell(STOPPING=1, STATUS="parking")
        self.planner.wanted = self.web.wanted = False
        self.exit_status = await self._park()
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
        ended = "parked" if self.exit_status == 0 else "standing in a fault"
        self._manager.tell(STATUS=f"ended {ended}")
        clean(self.run_dir)
        self._let_go()
        return self.exit_status

    def _let_go(self) -> None:
        for held in (self._link, self._claim, self._lock):
            held.close()

    async def _park(self) -> int:
        """Let the active guard park; the spare is told too, and parks if its turn comes."""
        active, spare = self._active()
        for guard in (active, spare):
            guard.wanted = False
            guard.signal(signal.SIGTERM)
        deadline = asyncio.get_running_loop().time() + PARK_PATIENCE
        result = 3
        while (left := deadline - asyncio.get_running_loop().time()) > 0.0:
            try:
                status = await active.ended(left)
            except TimeoutError:
                break
            if status in (0, 3):
                result = status
                break
            log.warning("%s ended with %s while parking; the other parks", active.name, status)
            active, spare = spare, active
            if active.pid is None:
                await active.start("leave")
        await asyncio.gather(*(guard.end(signal.SIGKILL, 1.0) for guard in (active, spare)))
        return result

    def _is_not_cued(self) -> bool:
        """A planner that died is replaced once the platform parks: its successor knows nothing."""
        message = self._maps.clock.read()
        return message is None or STATES[GuardClock.unpack(message[1]).state] not in CUED

    @property
    def active_guard(self) -> Child:
        """The guard that moves the platform."""
        return self._active()[0]

    def _active(self) -> tuple[Child, Child]:
        """The guard that holds the lock, by its own word, and the other."""
        message = self._maps.guard.read()
        pid = None if message is None else json.loads(message[1])["pid"]
        first, second = self.guards
        return (second, first) if second.pid == pid and pid is not None else (first, second)

    def _deaths(self) -> list[tuple[int, str, int, int]]:
        """Ends that nobody wanted, oldest first: instant [ns], who, exit status, process id."""
        everybody = (*self.guards, self.planner, self.web, self.box)
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
            if pulse.look(loop.time(), active.pid, written, runnable):
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

    async def _show(self) -> None:
        """Tell the page who lives."""
        while True:
            active, spare = self._active()
            self._maps.service.write(
                json.dumps(
                    {
                        "pid": os.getpid(),
                        "t_ns": now_ns(),
                        "guard": active.pid,
                        "spare": spare.pid,
                        "planner": self.planner.pid,
                        "web": self.web.pid,
                        "blackbox": self.box.pid,
                        "deaths": self._deaths(),
                        "restarts": {
                            "guard": sum(child.restarts for child in self.guards),
                            "planner": self.planner.restarts,
                            "web": self.web.restarts,
                            "blackbox": self.box.restarts,
                        },
                    }
                ).encode()
            )
            await asyncio.sleep(0.1)
