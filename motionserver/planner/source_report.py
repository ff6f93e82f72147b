"""What the planner reports of the source to the guard, with a sentence when packets are refused."""

from __future__ import annotations

from typing import Final

from motion_protocol import Notices

from motionserver.core.intake.freshness import SECOND_NS
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.state import DriveMode
from motionserver.planner.inputs import Inputs
from motionserver.planner.source_notices import notices_of

_REFUSED_NS: Final = 2 * SECOND_NS
"""How long a refusal explains why no packet is accepted [ns]."""


class SourceReport:
    """Composes the guard's view of the source; the sentence names what is wrong and who sent it."""

    def __init__(self, inputs: Inputs) -> None:
        self._inputs = inputs
        # how many packets were refused by then, and when the last was seen [ns]
        self._refused = (0, 0)

    def status(self, now_ns: int, is_cued: bool) -> CueStatus:
        """Report the source as it is now.

        Args:
            now_ns: When the inputs were read [ns].
            is_cued: Whether a drive has begun: the platform is cued or holds.
        """
        gate = self._inputs.vehicle
        if is_cued and self._inputs.is_paused_by_silence(now_ns):
            # the game keeps its pause by sending nothing; while we look at it, it is no lost client
            newest, heard = now_ns, gate.freshness.newest_ns or 0
            limit = gate.freshness.stale_after_ns()
            return CueStatus(newest, limit, DriveMode.PAUSE, heard, "", now_ns)
        refused = self._inputs.counters["refused"]
        if refused != self._refused[0]:
            self._refused = (refused, now_ns)
        return CueStatus(
            gate.believed_ns(now_ns, is_cued),
            gate.freshness.stale_after_ns(),
            gate.mode,
            gate.freshness.newest_ns or 0,
            self._trouble(now_ns, is_cued),
            now_ns,
        )

    def _trouble(self, now_ns: int, is_cued: bool) -> str:
        gate, (refused, seen_ns) = self._inputs.vehicle, self._refused
        last = f"the last refusal: {self._inputs.last_error}"
        if gate.spoilage.is_spoilt(now_ns):
            share = gate.spoilage.share(now_ns)
            return f"{share:.0%} of the simulator's packets in the last second are bad; {last}"
        for one in notices_of(self._inputs, now_ns):
            if one.kind is Notices.TOO_SLOW or (one.kind is Notices.VALUES and not is_cued):
                return one.text
        if gate.freshness.is_stale(now_ns) and refused and now_ns - seen_ns <= _REFUSED_NS:
            return f"packets arrive and are refused; {last}"
        return ""
