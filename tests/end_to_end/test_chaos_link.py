"""The command `chaos` between a simulator and a running server, and between server and base."""

import contextlib
import json
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rig import Base, Rig, assert_soft, command, environment, free_port, until

DAMAGE = ("size", "magic", "byte_order", "version", "incompat", "length", "checksum")
"""Refusals that a packet damaged on its way can meet."""


class Chaos:
    """The command as a process of its own."""

    def __init__(self, folder: Path, port: int, to: int, *flaws: str) -> None:
        self._out = folder / "chaos.json"
        ends = ("--listen", f"127.0.0.1:{port}", "--to", f"127.0.0.1:{to}")
        self.process = subprocess.Popen(
            command("chaos", *ends, "--json", str(self._out), *flaws),
            env=environment(),
            stdout=subprocess.PIPE,
            text=True,
        )

    def wait_ready(self) -> None:
        assert self.process.stdout is not None
        assert "->" in self.process.stdout.readline()

    def end(self) -> dict[str, Any]:
        """End it; what it counted."""
        self.process.send_signal(signal.SIGTERM)
        until(lambda: self.process.poll() is not None, "the end of the proxy")
        assert self.process.returncode == 0
        counted: dict[str, Any] = json.loads(self._out.read_text("utf-8"))
        return counted


@contextlib.contextmanager
def chaos(folder: Path, port: int, to: int, *flaws: str) -> Iterator[Chaos]:
    proxy = Chaos(folder, port, to, *flaws)
    try:
        proxy.wait_ready()
        yield proxy
    finally:
        if proxy.process.poll() is None:
            proxy.process.kill()
        proxy.process.wait()
        if proxy.process.stdout is not None:
            proxy.process.stdout.close()


def test_damaged_cues_are_counted_and_the_drive_goes_on(tmp_path: Path) -> None:
    port = free_port()
    flaws = ("--corrupt", "10", "--truncate", "10", "--loss", "3", "--duplicate", "5")
    flaws += ("--reorder", "3", "--jitter-ms", "5", "--seed", "7")
    with Rig(tmp_path) as rig, chaos(tmp_path, port, rig.cue_port, *flaws) as proxy:
        # from here on nothing that the proxy sends is lost on a closed port
        rig.wait_for(lambda: rig.shown("planner"), "the planner")
        stop = rig.drive(port=port)
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_for(rig.is_moving, "motion")
        rig.wait_plans(300)
        for name in ("length", "checksum"):
            rig.wait_for(lambda n=name: rig.counter(f"refused_{n}") > 3, f"the count of {name}")
        assert set(rig.shown("service")["restarts"].values()) == {0}
        assert rig.counter("tick_errors") == rig.counter("tick_errors", "guard") == 0

        stop.set()
        rig.wait_state("PARKED")
        counted = proxy.end()
        planner = rig.shown("planner")["counters"]
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["speed_max"] > 0.02
    there, back = counted["there"], counted["back"]
    assert there["corrupted"] > 3
    assert there["truncated"] > 3
    assert there["duplicated"] > 0
    assert back["received"] > 0
    # not one damaged packet was believed, and each was counted under what is wrong with it
    damaged = sum(planner.get(f"refused_{name}", 0) for name in DAMAGE)
    assert damaged == there["changed"], (planner, there)
    assert planner["packets"] == there["sent"]
    assert planner["accepted"] == planner["packets"] - planner["refused"]


def test_a_base_behind_a_slow_link_that_breaks_ends_safe(tmp_path: Path) -> None:
    port = free_port()
    config = {"platform": {"port": port}, "cueing": {"algorithm": "classical"}}
    flaws = ("--delay-ms", "3", "--jitter-ms", "5")
    # packets that a link delays unevenly say nothing about when the server sent them
    base = Base(tmp_path / "base.log", may_lose=True)
    with Rig(tmp_path, config, base=base) as rig:
        with chaos(tmp_path, port, rig.base.port, *flaws) as proxy:
            rig.run()
            rig.wait_plans(60)
            assert rig.state == "RUN"
            counted = proxy.end()
        # the cable is cut: the platform is silent, which is a fault
        rig.wait_state("FAULT")
        rig.wait_for(lambda: rig.base.do(lambda e: e.summary()["ended_safe"]), "the base to stand")
        rig.end()
        verdict = rig.verdict()
    assert_soft(verdict)
    assert counted["there"]["sent"] > 60
    assert counted["back"]["sent"] > 60
    assert counted["there"]["lost"] == counted["back"]["lost"] == 0
