"""How often an address may guess a token."""

from __future__ import annotations

import ipaddress
import logging
import time
from collections.abc import Callable
from typing import Final

MOST: Final = 10
"""Wrong tokens an address may send at once."""
REFILL: Final = 6.0
"""Time after which it may send one more [s]."""
_REMEMBERED: Final = 1024
"""Addresses that are remembered; the oldest are forgotten."""
_SPOKEN: Final = 60.0
"""Least time between two lines in the log [s]."""

_log = logging.getLogger(__name__)


class Attempts:
    """Counts wrong tokens by address.

    A token of full length is not guessed however fast; the limit keeps log and processor for
    others, and slows down guesses of a short token that hides behind its hash. It never holds up
    a right token of full length: a program that shares its address with the operator (another
    user of this computer, a neighbour behind the same router) must not lock the operator out.

    Args:
        now: Monotonic clock [s].
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._left: dict[str, tuple[float, float]] = {}
        self._spoken_at = -_SPOKEN

    def wait(self, address: str) -> float:
        """Time until this address may try a token again, 0 if at once [s]."""
        return max(0.0, (1.0 - self._tries(network_of(address))) * REFILL)

    def wrong(self, address: str) -> None:
        """A token was wrong."""
        network = network_of(address)
        left = max(0.0, self._tries(network) - 1.0)
        self._left.pop(network, None)
        while len(self._left) >= _REMEMBERED:
            del self._left[next(iter(self._left))]
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
