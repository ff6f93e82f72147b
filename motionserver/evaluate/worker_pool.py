"""Worker processes of an offline command, which end with it, however it is ended."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from types import FrameType
from typing import Final

_THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def worker_pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Start worker processes by spawn, with one thread each.

    On Ctrl-C or SIGTERM the workers are killed, which fails every result that is waited for: work
    that takes minutes does not outlive its command, and no semaphore is left behind.

    Args:
        processes: How many.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed meanwhile.
        SystemExit: With status 143, SIGTERM arrived meanwhile.
    """
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, context, _leave_signals_to_parent)
    with _signals_kill_workers() as received, _one_thread_each():
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=bool(received), cancel_futures=not received)
            if not received:
                raise
        else:
            pool.shutdown(wait=True)
    if signal.SIGINT in received:
        raise KeyboardInterrupt from None
    if received:
        raise SystemExit(128 + signal.SIGTERM) from None


@contextmanager
def _signals_kill_workers() -> Iterator[list[int]]:
    """Note Ctrl-C and SIGTERM, and kill the workers.

    An exception raised by the signal itself could strike anywhere, also while the pool holds its
    locks; a pool whose workers are gone fails in an orderly way.
    """
    received: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        received.append(number)
        for worker in multiprocessing.active_children():
            worker.kill()

    if threading.current_thread() is not threading.main_thread():
        yield received
        return
    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let workers inherit it: a second thread for such small matrices tripled their time."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update({name: "1" for name in _THREADS if before[name] is None})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


def _leave_signals_to_parent() -> None:
    """Ctrl-C reaches the whole terminal; the parent ends its workers by itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
