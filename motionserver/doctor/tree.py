"""Reads /proc, /sys and /dev below a root; what cannot be read is None, never a guess."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

INFINITE: Final = 2**63 - 1
"""What "unlimited" counts as."""
_CAPABILITIES: Final = {
    "CAP_NET_BIND_SERVICE": 10,
    "CAP_IPC_LOCK": 14,
    "CAP_SYS_NICE": 23,
}
_CONTAINER: Final = ("/.dockerenv", "/run/.containerenv", "/run/systemd/container")
_LARGEST: Final = 4 << 20


@dataclass(frozen=True, slots=True)
class Limit:
    """One resource limit, in the kernel's own unit."""

    soft: int
    hard: int


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a file system begins, and its kind."""

    point: str
    kind: str
    read_only: bool


@dataclass(frozen=True, slots=True)
class Tree:
    """The machine's files below ``root``: "/" for the real ones."""

    root: Path = Path("/")

    def at(self, path: str) -> Path:
        """Where an absolute path lies below the root."""
        return self.root / path.lstrip("/")

    def text(self, path: str) -> str | None:
        """Content of a small file without the white space around it; None if it cannot be read."""
        try:
            return self.at(path).read_bytes()[:_LARGEST].decode("utf-8", "replace").strip()
        except OSError:
            return None

    def lines(self, path: str) -> list[str] | None:
        """Lines of a small file; None if it cannot be read."""
        text = self.text(path)
        return None if text is None else text.splitlines()

    def number(self, path: str) -> int | None:
        """A file that holds one whole number; None if it cannot be read or holds none."""
        text = self.text(path)
        try:
            return None if text is None else int(text)
        except ValueError:
            return None

    def glob(self, pattern: str) -> list[str]:
        """Absolute paths that match, sorted."""
        found = self.root.glob(pattern.lstrip("/"))
        return sorted(f"/{path.relative_to(self.root)}" for path in found)

    def log(self, path: str) -> list[str] | None:
        """Everything a log device such as /dev/kmsg holds now, without waiting for more."""
        try:
            descriptor = os.open(self.at(path), os.O_RDONLY | os.O_NONBLOCK)
        except OSError:
            return None
        chunks: list[bytes] = []
        try:
            while len(chunks) < 100_000 and (chunk := os.read(descriptor, 8192)):
                chunks.append(chunk)
        except BlockingIOError:
            pass  # all read
        except OSError:
            return None
        finally:
            os.close(descriptor)
        return b"".join(chunks).decode("utf-8", "replace").splitlines()

    def limit(self, name: str) -> Limit | None:
        """A limit of this process by its name in /proc/self/limits, such as "Max open files"."""
        for line in self.lines("/proc/self/limits") or []:
            if line.startswith(name):
                words = line[len(name) :].split()
                try:
                    soft, hard = (INFINITE if w == "unlimited" else int(w) for w in words[:2])
                except ValueError:
                    return None
                return Limit(soft, hard)
        return None

    def may(self, capability: str) -> bool | None:
        """Whether this process has a capability now."""
        for line in self.lines("/proc/self/status") or []:
            if line.startswith("CapEff:"):
                return bool(int(line.split()[1], 16) >> _CAPABILITIES[capability] & 1)
        return None

    def mount_of(self, path: Path) -> Mount | None:
        """The file system that an absolute, resolved path lies on."""
        best: Mount | None = None
        for line in self.lines("/proc/self/mountinfo") or []:
            left, _, right = line.partition(" - ")
            words, kind = left.split(), right.split()
            if len(words) < 6 or not kind:
                continue
            point = words[4].replace("\\040", " ")
            # a later mount on the same point hides the earlier one
            if path.is_relative_to(point) and (best is None or len(point) >= len(best.point)):
                best = Mount(point, kind[0], "ro" in words[5].split(","))
        return best

    def is_container(self) -> bool:
        """Whether a container's own marks are there."""
        return any(self.at(mark).exists() for mark in _CONTAINER)

    def groups(self, controller: str) -> Iterator[str]:
        """Folders of our control groups that may rule ``controller``, innermost first.

        Both versions are looked at: version 2 has one tree, version 1 one per controller.
        """
        for line in self.lines("/proc/self/cgroup") or []:
            parts = line.split(":", 2)
            if len(parts) != 3:
                continue
            _, names, path = parts
            if names == "":
                bases = ["/sys/fs/cgroup", "/sys/fs/cgroup/unified"]
            elif controller in names.split(","):
                bases = [f"/sys/fs/cgroup/{names}", f"/sys/fs/cgroup/{controller}"]
            else:
                continue
            steps = [part for part in path.split("/") if part and part != ".."]
            for base in bases:
                for depth in range(len(steps), -1, -1):
                    folder = "/".join([base, *steps[:depth]])
                    if self.at(folder).is_dir():
                        yield folder
