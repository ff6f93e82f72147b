"""Signals: nothing but SIGKILL ends a process that moves the platform.

Most signals end a process that does not handle them: a closed terminal sends SIGHUP, `pkill` sends
whatever it is told. Here they are ignored, and what asks for an end (SIGTERM, a closed terminal, a
failing power supply) parks. An ignored signal stays ignored over exec, a handled one does not:
between exec and its handlers a child is covered by a mask that it inherits and opens itself.

A real error of the processor (SIGSEGV and others, raised by the kernel) ends a process all the
same: the kernel does not let those be ignored.
"""

from __future__ import annotations

import contextlib
import ctypes
import platform
import signal
from collections.abc import Collection, Iterator
from typing import Final

_HARMLESS: Final = frozenset(
    {
        *(signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH),
        *(signal.SIGKILL, signal.SIGSTOP),
    }
)
"""By default without effect, or beyond anybody's reach."""
PARKING: Final = (
    *(signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT),
    *(signal.SIGPWR, signal.SIGXCPU),
)
"""What asks a service to end: terminal, service manager, power supply, a limit of processor time
that SIGKILL follows."""
_RESERVED: Final = (32, 33)
"""Used by the C library between threads; until it has any, they end a process like all others."""
_SIGACTION: Final = {"x86_64": 13, "aarch64": 134, "riscv64": 134}
"""System call behind sigaction: the C library itself refuses to touch what it reserves."""
_IGNORE: Final = 1
_MASK_BYTES: Final = 8


def lethal_signals() -> frozenset[int]:
    """Signals that end or stop a process by default, but for those that nobody can hold off."""
    return frozenset(int(number) for number in signal.valid_signals()) - _HARMLESS


def ignore_signals(but: Collection[int] = ()) -> None:
    """Ignore everything that ends or stops a process, but for ``but``, which is left as it is."""
    for number in lethal_signals() - set(but):
        signal.signal(number, signal.SIG_IGN)
    _ignore_reserved()


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Block all signals meanwhile: children that are started inherit it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, lethal_signals())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_through() -> None:
    """Open the mask inherited from whoever started this process; its handlers must be in place."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, lethal_signals())


def _ignore_reserved() -> None:
    number = _SIGACTION.get(platform.machine())
    if number is None:
        return
    libc = ctypes.CDLL(None, use_errno=True)
    # handler, flags, restorer, mask: all zero but for the handler
    wanted = (ctypes.c_ulong * 4)(_IGNORE)
    found = (ctypes.c_ulong * 4)()
    for reserved in _RESERVED:
        taken = libc.syscall(number, reserved, None, ctypes.byref(found), _MASK_BYTES)
        # one that the C library handles already is its own, and harmless
        if taken == 0 and not found[0]:
            libc.syscall(number, reserved, ctypes.byref(wanted), None, _MASK_BYTES)
