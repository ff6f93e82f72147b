"""Base and simulator as processes: whatever the tests' own does, they are punctual."""

import contextlib
import json
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

from rig import PATIENCE, Rig, command, environment, free_port, until


class FarBase:
    """`motionserver emulate`; what it wrote down is the verdict."""

    def __init__(
        self,
        folder: Path,
        address: tuple[str, int] | None = None,
        within: tuple[str, ...] = (),
        may_lose: bool = False,
    ) -> None:
        host, self.port = address or ("127.0.0.1", free_port())
        self._summary = folder / "verdict.json"
        words = ("moog-6dof2000e", "--listen", f"{host}:{self.port}")
        files = ("--summary", str(self._summary), "--log", str(folder / "base.log"))
        wire = ("--may-lose",) if may_lose else ()
        self._command = [*within, *command("emulate", *words, *files, *wire)]

    def start(self) -> None:
        self._process = _started(self._command)
        table = Path(f"/proc/{self._process.pid}/net/udp")
        until(lambda: f":{self.port:04X} " in table.read_text("ascii"), "the base to listen")

    def stop(self) -> dict[str, Any]:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            self._process.wait(PATIENCE)
        verdict: dict[str, Any] = json.loads(self._summary.read_text("utf-8"))
        return verdict


class FarRig(Rig):
    """A server whose base and simulator are no threads of the test."""

    def __init__(
        self,
        folder: Path,
        config: Any = None,
        base: FarBase | None = None,
        sim_within: tuple[str, ...] = (),
        cues_to: str = "",
        **more: Any,
    ) -> None:
        self._simulators: list[subprocess.Popen[bytes]] = []
        self._sim_within, self._cues_to = sim_within, cues_to
        super().__init__(folder, config, base=base or FarBase(folder), **more)

    def drive(self, recording: str = "truck_brake_accel", *_: Any, **__: Any) -> Any:
        """Let a simulator replay a recording for ever."""
        to = self._cues_to or f"127.0.0.1:{self.cue_port}"
        words = command("replay", recording, "--to", to, "--loop")
        self._simulators.append(_started([*self._sim_within, *words]))

    def drives_again(self) -> None:
        """An operator's hands: reset, engage, until it runs."""

        def runs() -> bool:
            state = self.state
            if state in ("FAULT", "SAFE"):
                self._try("reset")
            elif state == "PARKED":
                self._try("engage")
            return state == "RUN" and self.is_moving()

        self.wait_for(runs, "driving again")

    def _try(self, op: str) -> None:
        with contextlib.suppress(OSError):
            self.ask(op)
        time.sleep(0.1)

    def __exit__(self, *info: object) -> None:
        for simulator in self._simulators:
            simulator.kill()
            simulator.wait(PATIENCE)
        super().__exit__(*info)


def _started(words: list[str]) -> subprocess.Popen[bytes]:
    # a group of its own: a signal to the test's is none to it
    return subprocess.Popen(
        words, env=environment(), stdout=subprocess.DEVNULL, start_new_session=True
    )
