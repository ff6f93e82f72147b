"""Files of one run that nobody can take away: sealed memory, handed over by descriptor.

Whatever guard and planner map, or read when they start, lies in memory that the service makes. It
cannot be truncated, so that nobody who has it mapped is killed by SIGBUS, and it does not depend on
a folder: the service's processes inherit descriptors. In the run directory lie links for others of
the same user (`status`, `record`); removing those moves nothing.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import socket
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

INHERITED: Final = "RUN_FILES"
"""Environment variable in which a service tells a child its descriptors, as JSON."""
_NO_EXEC: Final = 0x8
"""MFD_NOEXEC_SEAL, from Linux 6.3 on."""
_LARGEST: Final = 256 << 20
"""No file of a run is larger [bytes]."""
DOOR: Final = "files.sock"
"""In the run directory: the service's socket that hands out descriptors."""
_PATIENCE: Final = 2.0
"""Longest wait for a descriptor [s]."""
_FIXED: Final = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL

# taken out of the environment: a process started from here does not inherit the descriptors
_inherited: dict[str, int] = json.loads(os.environ.pop(INHERITED, "{}"))


def located(run_dir: Path, name: str) -> Path:
    """Where a file of a run is opened: by inherited descriptor, or by name in the run directory."""
    descriptor = _inherited.get(name)
    return run_dir / name if descriptor is None else Path(f"/proc/self/fd/{descriptor}")


def open_run_file(path: Path, flags: int = os.O_RDONLY) -> int:
    """Open a file of a run, by its link in the run directory.

    The kernel follows the link for whoever may look into the service's process. A service with more
    capabilities than its reader hands the descriptor over instead, to every process of its user.

    Raises:
        OSError: It cannot be opened.
    """
    try:
        # a link of a service that was killed may lead anywhere by now
        return os.open(path, flags | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    except PermissionError:
        return _asked_for(path)


def read_run_file(run_dir: Path, name: str) -> bytes:
    """Read a file of a run as a whole.

    Raises:
        OSError: It cannot be read.
    """
    descriptor = open_run_file(located(run_dir, name))
    try:
        # from the beginning: a descriptor that was handed over shares its position
        return os.pread(descriptor, min(os.fstat(descriptor).st_size, _LARGEST), 0)
    finally:
        os.close(descriptor)


def _asked_for(path: Path) -> int:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(_PATIENCE)
        link.connect(str(path.parent / DOOR))
        link.sendall(path.name.encode())
        link.shutdown(socket.SHUT_WR)
        _, descriptors, _, _ = socket.recv_fds(link, 1, 1)
    if not descriptors:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return descriptors[0]


class RunFiles:
    """The service's files of one run.

    Attributes:
        descriptors: Of every file, by its name in the run directory.
    """

    def __init__(self, run_dir: Path) -> None:
        self._run_dir = run_dir
        self.descriptors: dict[str, int] = {}

    def take(self, name: str, source: Path, constant: bool = False) -> None:
        """Copy a file into sealed memory, and link it in the run directory.

        Args:
            name: Its name there; nobody finds it before it is what it stays.
            source: The file.
            constant: True if nobody may write it any more, either.

        Raises:
            OSError: It cannot be read, or there is no room.
        """
        content = source.read_bytes()
        if len(content) > _LARGEST:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(source))
        descriptor = _memory(source.name)
        try:
            os.fchmod(descriptor, 0o600)
            # written, not only sized: a page that is missing later kills whoever writes to it
            with open(descriptor, "wb", closefd=False) as memory:
                memory.write(content)
            seals = _FIXED | (fcntl.F_SEAL_WRITE if constant else 0)
            fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, seals)
            self._link(name, descriptor)
        except OSError:
            os.close(descriptor)
            raise
        self.descriptors[name] = descriptor

    def repair_links(self) -> list[str]:
        """Put links back that somebody has removed; their names."""
        missing = [name for name in self.descriptors if not os.path.lexists(self._run_dir / name)]
        repaired = []
        for name in missing:
            with contextlib.suppress(OSError):
                self._link(name, self.descriptors[name])
                repaired.append(name)
        return repaired

    def handed(self, chosen: Callable[[str], bool]) -> tuple[str, tuple[int, ...]]:
        """What a child inherits: a value for `INHERITED`, and the descriptors."""
        found = {name: number for name, number in self.descriptors.items() if chosen(name)}
        return json.dumps(found), tuple(found.values())

    def open_door(self) -> socket.socket:
        """A socket in the run directory at which others of this user get descriptors.

        Raises:
            OSError: It cannot be made.
        """
        path = self._run_dir / DOOR
        path.unlink(missing_ok=True)
        door = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            door.bind(str(path))
            path.chmod(0o600)
            door.listen(8)
        except OSError:
            door.close()
            raise
        return door

    def answer(self, link: socket.socket, name: bytes) -> None:
        """Hand out one descriptor; nothing for a name that there is not."""
        descriptor = self.descriptors.get(name.decode("utf-8", "replace"))
        with contextlib.suppress(OSError):
            socket.send_fds(link, [b"!"], [] if descriptor is None else [descriptor])

    def close(self, but: Iterable[str] = ()) -> None:
        """Let go of everything."""
        for name in set(self.descriptors) - set(but):
            os.close(self.descriptors.pop(name))

    def _link(self, name: str, descriptor: int) -> None:
        path = self._run_dir / name
        temporary = path.with_name(f".{path.name}.link")
        temporary.unlink(missing_ok=True)
        temporary.symlink_to(f"/proc/{os.getpid()}/fd/{descriptor}")
        temporary.replace(path)


def _memory(name: str) -> int:
    flags = os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING
    try:
        return os.memfd_create(name, flags | _NO_EXEC)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return os.memfd_create(name, flags)
