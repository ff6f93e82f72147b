"""Who holds a port: /proc/net names a socket, /proc/PID/fd the process that has it open."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import Final

from motionserver.doctor.tree import Tree

_LISTENS: Final = "0A"
# not the emulator, which is ours too but holds the other end
_OURS: Final = re.compile(r"motionserver\.(guard|planner|web)\b|motionserver run\b")


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that has a socket open.

    Attributes:
        pid: Its process id.
        command: Its command line, words apart by blanks.
    """

    pid: int
    command: str

    @property
    def is_ours(self) -> bool:
        """Whether it is a server of this kind."""
        return _OURS.search(self.command) is not None


def holder_of(tree: Tree, protocol: str, port: int) -> Holder | None:
    """Who holds a port, on whatever address; None if nobody does or it is hidden from us.

    Args:
        tree: The machine's files.
        protocol: "udp" or "tcp".
        port: Local port.
    """
    sockets = {f"socket:[{inode}]" for inode in _inodes(tree, protocol, port)}
    if not sockets:
        return None
    for folder in tree.glob("/proc/[0-9]*"):
        try:
            entries = list(os.scandir(tree.at(f"{folder}/fd")))
        except OSError:
            continue  # another user's, or gone
        for entry in entries:
            try:
                target = os.readlink(entry.path)
            except OSError:
                continue
            if target in sockets:
                command = (tree.text(f"{folder}/cmdline") or "").replace("\0", " ").strip()
                name = command or tree.text(f"{folder}/comm") or "a process without a name"
                return Holder(int(folder.rpartition("/")[2]), name)
    return None


def _inodes(tree: Tree, protocol: str, port: int) -> list[str]:
    out = []
    for table in (protocol, f"{protocol}6"):
        for line in (tree.lines(f"/proc/net/{table}") or [])[1:]:
            words = line.split()
            if len(words) < 10 or int(words[1].rpartition(":")[2], 16) != port:
                continue
            if protocol == "udp" or words[3] == _LISTENS:
                out.append(words[9])
    return out
