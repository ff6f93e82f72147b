"""What a recorder keeps of every planner period, written by the planner into a mapped file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Final

TRACE_BYTES: Final = 8192


@dataclass(frozen=True, slots=True)
class Trace:
    """One period.

    Attributes:
        t_ns: When it began, CLOCK_MONOTONIC [ns].
        algorithm: What drives.
        kappa: Share of its candidate in its plan; None without a candidate.
        wanted: Wanted specific force minus g e_z, (3,) [m/s2].
        felt: Felt specific force minus g e_z at the hand-over, (3,) [m/s2].
        sides: Of every side engine, by name: felt force x, y, z [m/s2] and kappa.
        proposal: Number of the proposed plan; 0 without one.
        took: From waking to proposing [s]; 0 if there was nothing to think about.
        late: How late the period began [s].
        trouble: Why there is no better plan, in words, cut short; "" if all is well.
    """

    t_ns: int
    algorithm: str
    kappa: float | None
    wanted: tuple[float, ...]
    felt: tuple[float, ...]
    sides: Mapping[str, tuple[float | None, ...]]
    proposal: int = 0
    took: float = 0.0
    late: float = 0.0
    trouble: str = ""

    def pack(self) -> bytes:
        """Write as bytes."""
        return json.dumps(astuple(self), separators=(",", ":")).encode()

    @classmethod
    def unpack(cls, data: bytes) -> Trace:
        """Read what `pack` wrote.

        Raises:
            ValueError: It is something else.
        """
        try:
            t_ns, algorithm, kappa, wanted, felt, sides, proposal, *more = json.loads(data)
            took, late, trouble = more
            pairs = {str(name): tuple(values) for name, values in sides.items()}
            return cls(
                int(t_ns), str(algorithm), kappa, tuple(wanted), tuple(felt), pairs,
                int(proposal), float(took), float(late), str(trouble),
            )  # fmt: skip
        except (TypeError, AttributeError, ValueError) as error:
            raise ValueError(f"not a trace of this version: {error}") from error
