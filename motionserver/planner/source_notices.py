"""What is wrong with a simulator's packets, in words: for page, log, guard and client."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from motion_protocol import NOTICE_TEXT_MAX, Notices

from motionserver.core.intake.freshness import LEAST_HZ, SECOND_NS
from motionserver.planner.inputs import Inputs

RECENT_NS: Final = 2 * SECOND_NS
"""How long a packet that was refused for its values is spoken of [ns]."""
REPEAT_NS: Final = 10 * SECOND_NS
"""Least time between two log lines about the same thing [ns]."""


@dataclass(frozen=True, slots=True)
class Notice:
    """One thing that is wrong.

    Attributes:
        kind: Its bit in the status packet.
        text: What was found, what is allowed, what to do.
    """

    kind: Notices
    text: str

    @property
    def keeps_parked(self) -> bool:
        """True if no drive begins while it lasts."""
        return self.kind is not Notices.SENDER_TIME


def notices_of(inputs: Inputs, now_ns: int) -> list[Notice]:
    """Everything that is wrong with the vehicle's packets now, the gravest first."""
    gate = inputs.vehicle
    found: list[Notice] = []
    if gate.spoilage.is_spoilt(now_ns):
        share = gate.spoilage.share(now_ns)
        text = f"{share:.0%} of the packets in the last second are bad: {inputs.last_error}"
        found.append(Notice(Notices.BAD_SHARE, text))
    refused = inputs.out_of_range
    if refused is not None and now_ns - refused.arrival_ns <= RECENT_NS:
        found.append(Notice(Notices.OUT_OF_RANGE, f"packets are refused: {refused.text}"))
    if gate.freshness.is_too_slow and not gate.is_silent(now_ns):
        rate = 1.0 / gate.freshness.usual_gap()
        text = f"too slow a source ({rate:.2g} Hz): at least {LEAST_HZ:g} Hz are needed, better 60"
        found.append(Notice(Notices.TOO_SLOW, text))
    if complaint := gate.plausibility.complaint():
        found.append(Notice(Notices.VALUES, complaint))
    if gate.clock.complaint:
        found.append(Notice(Notices.SENDER_TIME, gate.clock.complaint))
    previews = inputs.previews.gate
    if not previews.is_silent(now_ns):
        if complaint := previews.plausibility.complaint():
            found.append(Notice(Notices.VALUES, f"preview: {complaint}"))
        if previews.clock.complaint:
            found.append(Notice(Notices.SENDER_TIME, f"preview: {previews.clock.complaint}"))
    return found


def sensor_notices(inputs: Inputs, now_ns: int) -> list[str]:
    """What is wrong with the packets of the platform's own sensor, for the operator."""
    gate = inputs.sensor
    if gate.is_silent(now_ns):
        return []
    found = (gate.plausibility.complaint(), gate.clock.complaint)
    return [f"sensor: {text}" for text in found if text]


def spoken(notices: Sequence[Notice]) -> str:
    """All in one text, short enough for a status packet."""
    text = "; ".join(one.text for one in notices)
    return text.encode()[:NOTICE_TEXT_MAX].decode("utf-8", "ignore")


class NoticeLog:
    """Writes a notice to the log when it appears, at most every ten seconds, never while it lasts.

    Args:
        log: Where to.
    """

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._lasting = Notices.NONE
        self._said_ns: dict[Notices, int] = {}

    def note(self, now_ns: int, notices: Sequence[Notice]) -> None:
        """Take what is wrong now."""
        lasting = Notices.NONE
        for one in notices:
            lasting |= one.kind
            said_ns = self._said_ns.get(one.kind)
            if not one.kind & self._lasting and (said_ns is None or now_ns - said_ns >= REPEAT_NS):
                self._said_ns[one.kind] = now_ns
                self._log.warning("packets of the simulator: %s", one.text)
        self._lasting = lasting
