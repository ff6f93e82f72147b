"""What `chaos` is told: per cent and milliseconds in, one checked description of a link out."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Final

from motion_clients.fault_proxy import resolve
from motion_clients.flawed_link import LinkFlaws

from motionserver.errors import ConfigError
from motionserver.settings.config import split_address

LONGEST_MS: Final = 10_000.0
"""Longest delay, jitter or time held back [ms]."""

_SHARES: Final = ("loss", "duplicate", "reorder", "corrupt", "truncate")
_TIMES: Final = ("delay_ms", "jitter_ms", "reorder_ms")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChaosOptions:
    """The command line of `chaos`, not yet checked.

    Attributes:
        listen: Where senders send, HOST:PORT.
        to: Where it goes on to, HOST:PORT.
        delay_ms: Delay of every packet [ms].
        jitter_ms: Greatest further delay [ms].
        loss: Packets lost [%].
        duplicate: Packets that arrive twice [%].
        reorder: Packets held back [%].
        reorder_ms: For how long [ms].
        corrupt: Packets with flipped bits [%].
        truncate: Packets cut short [%].
        silent: Times in which nothing passes, FROM:UNTIL in seconds after the start.
        are_replies_flawed: Whether replies meet the same flaws, or none.
        seed: Of everything random.
        seconds: How long to run [s]; None until a signal.
        json_out: Where the counters are written.
    """

    listen: str
    to: str
    delay_ms: float = 0.0
    jitter_ms: float = 0.0
    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    reorder_ms: float = 25.0
    corrupt: float = 0.0
    truncate: float = 0.0
    silent: tuple[str, ...] = ()
    are_replies_flawed: bool = True
    seed: int = 0
    seconds: float | None = None
    json_out: Path | None = None

    def flaws(self) -> LinkFlaws:
        """The link described.

        Raises:
            ConfigError: A value is out of range.
        """
        for name in _SHARES:
            if not 0.0 <= getattr(self, name) <= 100.0:
                raise ConfigError(
                    f"--{name}", f"{getattr(self, name):g} %", "Give 0 to 100, in per cent."
                )
        for name in _TIMES:
            if not 0.0 <= getattr(self, name) <= LONGEST_MS:
                raise ConfigError(
                    f"--{name.replace('_', '-')}",
                    f"{getattr(self, name):g} ms",
                    f"Give 0 to {LONGEST_MS:g}, in milliseconds.",
                )
        return LinkFlaws(
            **{name: getattr(self, name) / 100.0 for name in _SHARES},
            delay=self.delay_ms / 1e3,
            jitter=self.jitter_ms / 1e3,
            reorder_delay=self.reorder_ms / 1e3,
            silences=tuple(_silence(text) for text in self.silent),
        )

    def duration(self) -> float:
        """How long to run [s], perhaps for ever.

        Raises:
            ConfigError: It is not positive.
        """
        if self.seconds is None:
            return inf
        if not self.seconds > 0.0:
            raise ConfigError("--seconds", f"{self.seconds:g}", "Give a positive number.")
        return self.seconds

    def ends(self) -> tuple[tuple[str, int], tuple[str, int]]:
        """Hosts and ports to listen on and to send to.

        Raises:
            ConfigError: One is no address, or its name is unknown.
        """
        listen, to = _end("--listen", self.listen), _end("--to", self.to)
        if to[1] == 0:
            raise ConfigError("--to", f"port 0 in {self.to!r}", "Give a port of 1 to 65535.")
        return listen, to

    def flaws_shown(self) -> dict[str, Any]:
        """The flaws in the command line's own units, JSON-able; an open end is None."""
        return {
            **{f"{name}_percent": getattr(self, name) for name in _SHARES},
            **{name: getattr(self, name) for name in _TIMES},
            "silent": [
                [begin, None if end == inf else end]
                for begin, end in (_silence(text) for text in self.silent)
            ],
        }

    def in_words(self) -> str:
        """The flaws for people, e.g. "loss 5 %, delay 20 ms"."""
        told = [f"{name} {getattr(self, name):g} %" for name in _SHARES if getattr(self, name)]
        told += [
            f"{name[:-3]} {getattr(self, name):g} ms" for name in _TIMES[:2] if getattr(self, name)
        ]
        told += [f"silent {text} s" for text in self.silent]
        return ", ".join(told) or "no flaws"


def _silence(text: str) -> tuple[float, float]:
    begin, colon, end = text.partition(":")
    try:
        found = float(begin), float(end) if end else inf
    except ValueError:
        found = (inf, inf)
    if not colon or not 0.0 <= found[0] < found[1]:
        raise ConfigError(
            "--silent",
            f"{text!r} is no stretch of time",
            "Give FROM:UNTIL in seconds after the start, for example 5:7, or 5: for ever.",
        )
    return found


def _end(option: str, text: str) -> tuple[str, int]:
    try:
        host, port = split_address(text)
        resolve(host, port)
    except (ValueError, UnicodeError) as error:
        raise ConfigError(option, str(error), "Give HOST:PORT.") from error
    except OSError as error:
        raise ConfigError(
            option, f"{text!r}: {error.strerror}", "Give HOST:PORT of a host that is known."
        ) from error
    return host, port
