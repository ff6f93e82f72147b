"""Telling systemd how it goes: READY, STATUS, WATCHDOG, STOPPING over its notification socket."""

from __future__ import annotations

import os
import socket
from typing import Final

SOCKET: Final = "NOTIFY_SOCKET"
WATCHDOG_TIME: Final = "WATCHDOG_USEC"
WATCHDOG_PID: Final = "WATCHDOG_PID"


class Notifier:
    """Sends datagrams to the socket that the service manager named; without one it does nothing.

    Raises:
        ValueError: The manager named a socket that is none.
    """

    def __init__(self) -> None:
        # children must not speak for the service
        name = os.environ.pop(SOCKET, "")
        if name and name[0] not in "/@":
            raise ValueError(f"{SOCKET}: {name!r} is no socket; allowed is a path or @name")
        self._address = "\0" + name[1:] if name.startswith("@") else name
        self.watchdog = _watchdog_time()
        """Longest time between two words that the manager tolerates [s]; 0 = it does not look."""

    def tell(self, **words: str | int) -> None:
        """Send ``KEY=value`` lines, such as ``READY=1``; a manager that is gone is no trouble."""
        if not self._address:
            return
        text = "\n".join(f"{key}={value}" for key, value in words.items())
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as link:
            link.setblocking(False)
            try:
                link.sendto(text.encode(), self._address)
            except OSError:
                return


def _watchdog_time() -> float:
    meant, time = os.environ.pop(WATCHDOG_PID, ""), os.environ.pop(WATCHDOG_TIME, "")
    if not time.isdigit() or meant not in ("", str(os.getpid())):
        return 0.0
    return int(time) * 1e-6
