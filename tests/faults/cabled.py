"""Simulator, server and base in three network namespaces, with cables that can be pulled."""

import contextlib
import os
import subprocess
import time
from pathlib import Path
from typing import Self

from far_ends import FarBase, FarRig

SIM, SERVER_TO_SIM = "10.83.1.1", "10.83.1.2"
SERVER_TO_BASE, BASE = "10.83.2.1", "10.83.2.2"
CUES = f"{SERVER_TO_SIM}:4600"
BASE_PORT = 991
SIDES = {"server": ("server", "to_base"), "base": ("base", "base0"), "simulator": ("sim", "sim0")}
"""Where a cable can be pulled: namespace and device."""


def ip(*arguments: str) -> None:
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


def why_not() -> str:
    """Why cables cannot be laid here; empty if they can."""
    name = f"try-{os.getpid()}"
    try:
        ip("netns", "add", name)
        try:
            kind = ("type", "veth", "peer", "name", "try1", "netns", name)
            ip("link", "add", "try0", "netns", name, *kind)
        finally:
            ip("netns", "del", name)
    except OSError as error:
        return str(error)
    return ""


class Cables:
    """Three namespaces in a row; a context manager that removes them."""

    def __init__(self) -> None:
        self._names = {who: f"{who}-{os.getpid()}" for who in ("sim", "server", "base")}

    def within(self, who: str) -> tuple[str, ...]:
        """What runs a command in a namespace."""
        return ("ip", "netns", "exec", self._names[who])

    def __enter__(self) -> Self:
        for name in self._names.values():
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        self._lay(("sim", "sim0", SIM), ("server", "to_sim", SERVER_TO_SIM))
        self._lay(("server", "to_base", SERVER_TO_BASE), ("base", "base0", BASE))
        return self

    def _lay(self, *ends: tuple[str, str, str]) -> None:
        (one, here, _), (other, there, _) = ends
        one, other = self._names[one], self._names[other]
        kind = ("type", "veth", "peer", "name", there, "netns", other)
        ip("link", "add", here, "netns", one, *kind)
        for who, device, address in ends:
            ip("-n", self._names[who], "addr", "add", f"{address}/24", "dev", device)
            ip("-n", self._names[who], "link", "set", device, "up")

    def __exit__(self, *_: object) -> None:
        for name in self._names.values():
            with contextlib.suppress(OSError):
                ip("netns", "del", name)

    def pull(self, side: str, seconds: float) -> None:
        """Pull a cable at one side, and put it back."""
        who, device = SIDES[side]
        ip("-n", self._names[who], "link", "set", device, "down")
        try:
            time.sleep(seconds)
        finally:
            ip("-n", self._names[who], "link", "set", device, "up")


class CabledRig(FarRig):
    """A server between a simulator and a base, each behind a cable."""

    def __init__(self, cables: Cables, folder: Path) -> None:
        self.cables = cables
        cues = {"kind": "native", "listen": CUES, "allow_unsigned": True}
        super().__init__(
            folder,
            {"platform": {"host": BASE, "local_host": SERVER_TO_BASE}},
            base=FarBase(folder, (BASE, BASE_PORT), cables.within("base"), may_lose=True),
            sim_within=cables.within("sim"),
            cues_to=CUES,
            sources=(cues,),
            within=cables.within("server"),
        )
