"""How often an address may guess a token, and who is not held up by another's guesses."""

from __future__ import annotations

import ipaddress
import logging
import time
from collections.abc import Callable
from typing import Final, TypeVar

MOST: Final = 10
"""Wrong tokens an address may send at once."""
REFILL: Final = 6.0
"""Time after which it may send one more [s]."""
_REMEMBERED: Final = 1024
"""Addresses, and proven tokens, that are remembered; the oldest are forgotten."""
_SPOKEN: Final = 60.0
"""Least time between two lines in the log [s]."""

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")
_log = logging.getLogger(__name__)


class Attempts:
    """Counts wrong tokens by address; a right one that came from there before is never held up.

    At 256 bits a token is not guessed however fast; the limit is for tokens that people chose,
    and it keeps log and processor for others. A program that shares its address with the operator
    (another user of this computer, a neighbour behind the same router) must not be able to lock
    the operator out, so a token that was right from an address stays believed from there.

    Args:
        now: Monotonic clock [s].
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._left: dict[str, tuple[float, float]] = {}
        self._proven: dict[tuple[str, str], None] = {}
        self._spoken_at = -_SPOKEN

    def wait(self, address: str) -> float:
        """Time until this address may try a token again, 0 if at once [s]."""
        return max(0.0, (1.0 - self._tries(network_of(address))) * REFILL)

    def is_proven(self, address: str, token_id: str) -> bool:
        """Whether this token was right from this address before."""
        return (network_of(address), token_id) in self._proven

    def right(self, address: str, token_id: str) -> None:
        """A token was right."""
        who = network_of(address), token_id
        self._proven.pop(who, None)
        _forget_oldest(self._proven)
        self._proven[who] = None

    def wrong(self, address: str) -> None:
        """A token was wrong."""
        network = network_of(address)
        left = max(0.0, self._tries(network) - 1.0)
        self._left.pop(network, None)
        _forget_oldest(self._left)
        self._left[network] = left, self._now()
        if left < 1.0 and self._now() - self._spoken_at >= _SPOKEN:
            self._spoken_at = self._now()
            _log.warning(
                "wrong tokens from %s: further ones are not looked at for a while", network
            )

    def _tries(self, network: str) -> float:
        left, at = self._left.get(network, (float(MOST), 0.0))
        return min(float(MOST), left + (self._now() - at) / REFILL)


def network_of(address: str) -> str:
    """What counts as one guesser: an IPv4 address, or the /64 that one IPv6 host owns whole."""
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return ""
    if isinstance(ip, ipaddress.IPv4Address):
        return str(ip)
    if ip.ipv4_mapped is not None:
        return str(ip.ipv4_mapped)
    return str(ipaddress.IPv6Network((int(ip), 64), strict=False))


def _forget_oldest(known: dict[_Key, _Value]) -> None:
    while len(known) >= _REMEMBERED:
        del known[next(iter(known))]
