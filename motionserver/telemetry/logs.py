"""Logs stay readable: what goes wrong in every tick is told once a second."""

from __future__ import annotations

import logging
from typing import Final

SPACING_NS: Final = 1_000_000_000


class Seldom:
    """Tells an exception with its traceback at most once a second, and how many it left out."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._told_ns: int | None = None
        self._left_out = 0

    def exception(self, now_ns: int, text: str) -> None:
        """Tell the exception being handled, or count it."""
        if self._told_ns is not None and now_ns - self._told_ns < SPACING_NS:
            self._left_out += 1
            return
        more = f" ({self._left_out} more before this one)" if self._left_out else ""
        self._log.exception("%s%s", text, more)
        self._told_ns, self._left_out = now_ns, 0
