"""What is believed of one packet: its owner, order, age and range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from motionserver.core.intake.freshness import SECOND_NS, Freshness, stale_after_ns
from motionserver.core.intake.plausibility import Plausibility
from motionserver.core.intake.ranges import out_of_range
from motionserver.core.intake.sender_clock import SenderClock
from motionserver.core.intake.sequence_order import SequenceOrder
from motionserver.core.intake.spoilage import Spoilage
from motionserver.core.state import DriveMode, VehicleMotion

REORDER_NS: Final = 2 * SECOND_NS
"""Silence after which an owner may be replaced, and its order is forgotten [ns]."""
_MARGIN: Final = 3.0
"""Packets that a gap may have lost, in those that usually come in its time [-]."""


@dataclass(frozen=True, slots=True)
class Owner:
    """Who moves the platform: where the packets come from and which run of it."""

    source: str
    address: str
    session: int


class Gate:
    """Believe or refuse packets of one input, one owner at a time.

    Attributes:
        owner: Who is believed; None before the first packet.
        mode: What the owner says it is doing.
        last_refusal: What was wrong with the newest packet that was out of range.
    """

    def __init__(
        self,
        may_change_owner: Callable[[], bool] = lambda: True,
        look_ns: int = 0,
        is_same_game: Callable[[Owner, Owner], bool] = lambda owner, who: False,
    ) -> None:
        """Take nobody's packets yet.

        Args:
            may_change_owner: Whether another client may move the platform now.
            look_ns: Time between two looks at the input [ns].
            is_same_game: Whether a newcomer is the silent owner itself, on another port: it
                returns to the drive that it left.
        """
        self._look_ns = look_ns
        self.mode = DriveMode.DRIVE
        self.last_refusal = ""
        self.order = SequenceOrder()
        self._may_change_owner = may_change_owner
        self._is_same_game = is_same_game
        self._hand_over(None)

    def _hand_over(self, who: Owner | None) -> None:
        """Begin anew: what is known of one owner says nothing of the next."""
        self.owner = who
        self.freshness = Freshness(self._look_ns)
        self.spoilage = Spoilage()
        self.plausibility = Plausibility()
        self.clock = SenderClock()
        self.order.forget()

    @property
    def lost(self) -> int:
        """Sequence numbers that never came."""
        return self.order.lost

    @property
    def is_restart(self) -> bool:
        """True if the packet just believed begins a new count: what came before ended."""
        return self.order.is_restart

    def refuse(self, source: str, address: str, motion: VehicleMotion) -> str | None:
        """Judge a packet.

        Args:
            source: Name of the input it came by.
            address: Sender's address as text.
            motion: What it says.

        Returns:
            None if it is believed (and noted), else the name of the counter of the refusal:
            "second-client", "replayed", "reordered", "jumped", "old", "out-of-range".
        """
        who = Owner(source, address, motion.session)
        now = motion.arrival_ns
        is_owner = who == self.owner
        refusal = None
        if is_owner:
            if self._is_silent(now):
                self._forget_order()
            refusal = self._out_of_order(motion)
        elif not self._may_own(who, now):
            return "second-client"
        if wrong := out_of_range(motion):
            self.last_refusal = wrong
            self.spoilt(source, address, now)
            return "out-of-range"
        if refusal is not None:
            return refusal
        if not is_owner:
            self._hand_over(who)
            self._out_of_order(motion)
        fresh = self.freshness
        if motion.sender_ns is not None:
            interval = fresh.interval_ns()
            if self.clock.is_late(now, motion.sender_ns, interval, stale_after_ns(interval)):
                return "old"
        self.mode = motion.mode
        fresh.arrived(now)
        self.spoilage.heard(now, is_bad=False)
        if motion.mode is DriveMode.DRIVE:
            self.plausibility.heard(motion)
        return None

    def spoilt(self, source: str, address: str, now_ns: int) -> None:
        """Note a packet that says what cannot be; a stranger's is not the owner's fault."""
        if self.owner is not None and (self.owner.source, self.owner.address) == (source, address):
            self.spoilage.heard(now_ns, is_bad=True)

    def believed_ns(self, now_ns: int, is_cued: bool) -> int:
        """Arrival of the newest packet that may move the platform [ns]; 0 = none.

        What comes from an owner whose packets are spoilt or too rare is told as what never came;
        so is what seems to have wrong units, but that only keeps a drive from beginning.

        Args:
            now_ns: Now [ns].
            is_cued: Whether a drive has begun.
        """
        if self.spoilage.is_spoilt(now_ns) or self.freshness.is_too_slow:
            return 0
        if not is_cued and self.plausibility.complaint():
            return 0
        return self.freshness.newest_ns or 0

    def is_fresh(self, now_ns: int) -> bool:
        """True if the owner's packets arrive in time, and nearly all of them can be believed."""
        fresh = self.freshness
        return not (fresh.is_stale(now_ns) or fresh.is_too_slow or self.spoilage.is_spoilt(now_ns))

    def is_silent(self, now_ns: int) -> bool:
        """True if the owner has said nothing for so long that another may take its place."""
        return self._is_silent(now_ns)

    def _may_own(self, who: Owner, now_ns: int) -> bool:
        if self.owner is None:
            return True
        left = self.mode is DriveMode.BYE or self._is_silent(now_ns)
        return left and (self._may_change_owner() or self._is_same_game(self.owner, who))

    def _is_silent(self, now_ns: int) -> bool:
        age = self.freshness.age_ns(now_ns)
        return age is None or age > REORDER_NS

    def _forget_order(self) -> None:
        """After a silence the sender may be another run of itself, on another way."""
        self.order.forget()
        self.clock.forget()
        self.plausibility = Plausibility()

    def _out_of_order(self, motion: VehicleMotion) -> str | None:
        fresh, stamp = self.freshness, motion.sender_ns
        gap_ns = fresh.age_ns(motion.arrival_ns) or 0
        expected = _MARGIN * fresh.rate_hz() * gap_ns / SECOND_NS
        refusal = self.order.judge(motion.sequence, expected, self.clock.is_older(stamp))
        if self.order.is_restart:
            self.clock.forget()
        return refusal
