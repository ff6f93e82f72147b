"""What the histories hold: fixed records of guard and intake, named once for writer and reader."""

from __future__ import annotations

import struct
from typing import Any, Final

from motionserver.core.axes import AXIS_NAMES
from motionserver.core.device import Order, Phase
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason
from motionserver.core.state import DriveMode

KEPT: Final = 60.0
"""How far back the black box remembers [s]."""

STATES: Final = tuple(State)
ORDERS: Final = tuple(Order)
PHASES: Final = ("", *Phase)
MEASURED: Final = ("", "legs", "pose")
VERDICTS: Final = ("", "accepted", *Reason)
MODES: Final = {mode.value: mode.name.lower() for mode in DriveMode}


class Layout:
    """A record of named fields, and the words that some of its numbers stand for.

    Args:
        fields: Name and `struct` letter of every field, in order.
        words: What the numbers of a field mean.
    """

    def __init__(
        self,
        fields: tuple[tuple[str, str], ...],
        words: dict[str, tuple[str, ...] | dict[int, str]],
    ) -> None:
        self.names = tuple(name for name, _ in fields)
        self._struct = struct.Struct("<" + "".join(letter for _, letter in fields))
        self._words = [words.get(name) for name in self.names]
        self.size = self._struct.size
        self.pack = self._struct.pack

    def row(self, data: bytes) -> list[Any]:
        """The fields of one record, numbers replaced by their words; nan becomes None.

        Raises:
            struct.error: The bytes have another length.
            LookupError: A number stands for nothing.
        """
        values = self._struct.unpack(data)
        return [
            value if words is None else words[value]
            for value, words in zip(map(_plain, values), self._words, strict=True)
        ]


def _plain(value: Any) -> Any:  # noqa: ANN401  (whatever struct unpacks)
    if isinstance(value, float):
        return round(value, 9) if value - value == 0.0 else None
    return value


def _six(name: str, units: bool = True) -> tuple[tuple[str, str], ...]:
    if units:
        return tuple(
            (f"{name}_{axis}_{'m' if i < 3 else 'rad'}{'_s' if name == 'velocity' else ''}", "d")
            for i, axis in enumerate(AXIS_NAMES)
        )
    return tuple((f"{name}_{number}", "d") for number in range(1, 7))


def _three(name: str, unit: str) -> tuple[tuple[str, str], ...]:
    return tuple((f"{name}_{axis}_{unit}", "d") for axis in "xyz")


GUARD: Final = Layout(
    (
        ("t_ns", "Q"),
        ("state", "B"),
        ("order", "B"),
        ("is_sent", "B"),
        ("late_max_ns", "Q"),
        ("ticks", "I"),
        ("playing_id", "Q"),
        ("playing_clock_s", "d"),
        ("newest_id", "Q"),
        ("proposal_id", "Q"),
        ("verdict", "B"),
        ("verdict_at_s", "d"),
        ("verdict_leg", "b"),
        ("verdict_value", "d"),
        ("verdict_allowed", "d"),
        ("cue_newest_ns", "Q"),
        ("cue_stale_after_ns", "Q"),
        ("cue_mode", "B"),
        ("feedback_ns", "Q"),
        ("phase", "B"),
        ("estop", "B"),
        ("tracking_error_m", "d"),
        *_six("pose"),
        *_six("velocity"),
        *_six("leg_m", units=False),
        ("measured", "B"),
        *_six("measured", units=False),
    ),
    {
        "state": STATES,
        "order": ORDERS,
        "verdict": VERDICTS,
        "phase": PHASES,
        "cue_mode": MODES,
        "measured": MEASURED,
    },
)
"""One row per packet to the platform, and per verdict between two packets.

``is_sent`` tells the two apart, ``late_max_ns`` and ``ticks`` are of the ticks since the row
before, ``measured_1`` to ``_6`` are legs [m] or a pose [m, rad] as ``measured`` says.
"""

PACKET: Final = Layout(
    (
        ("arrival_ns", "Q"),
        ("sender_ns", "q"),
        ("session", "Q"),
        ("sequence", "q"),
        ("mode", "B"),
        ("at_platform", "B"),
        *_three("force", "m_s2"),
        *_three("rates", "rad_s"),
        ("speed_m_s", "d"),
    ),
    {"mode": MODES},
)
"""One row per believed packet; -1 where the sender's format has no number."""
