"""Who was refused is written down too, but so seldom that it cannot push out what was done."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Final

from motionserver.web.audit import Audit
from motionserver.web.auth import Caller
from motionserver.web.refusal import Refusal

WRITTEN: Final = frozenset({401, 403, 429})
"""Statuses of strangers, of roles that do not reach, of other sites' pages and of guessers."""
_ROUTE: Final = re.compile(r"/(?:[a-z]{1,12}(?:/[a-z]{1,12}){0,2})?")
"""What may stand in the log of a path that a stranger sent: a token would be longer."""


class Budget:
    """A few at once, then one now and then.

    Args:
        most: How many at once.
        refill: Time after which there is one more [s].
        now: Monotonic clock [s].
    """

    def __init__(self, most: int, refill: float, now: Callable[[], float]) -> None:
        self._most, self._refill, self._now = most, refill, now
        self._left, self._at = float(most), now()
        self._missed = 0

    def take(self) -> int | None:
        """How many were not granted since the last one that was; None if this one is not."""
        now = self._now()
        self._left = min(float(self._most), self._left + (now - self._at) / self._refill)
        self._at = now
        if self._left < 1.0:
            self._missed += 1
            return None
        self._left -= 1.0
        missed, self._missed = self._missed, 0
        return missed


class Refusals:
    """Writes refusals to the audit log.

    Args:
        audit: The log.
        now: Monotonic clock [s].
    """

    def __init__(self, audit: Audit, now: Callable[[], float] = time.monotonic) -> None:
        self._audit = audit
        self._budget = Budget(10, 600.0, now)

    def note(self, refusal: Refusal, method: str, path: str, who: Caller | str) -> None:
        """Write down one refusal, if there is room for it.

        Args:
            refusal: The answer.
            method: Of the request.
            path: Of the request.
            who: Who asked; a stranger's address.
        """
        if refusal.status not in WRITTEN or (unwritten := self._budget.take()) is None:
            return
        known = who if isinstance(who, Caller) else None
        self._audit.write(
            {
                "action": "refused",
                "role": known.role.name.lower() if known else "none",
                "token": known.token_id if known else "",
                "address": known.address if known else who,
                "result": f"{refusal.status} {refusal.body['error']}",
                "method": method if method.isalpha() and len(method) < 8 else "?",
                "path": path if _ROUTE.fullmatch(path) else "?",
                "unwritten": unwritten,
            }
        )
