"""What is believed of one packet: its owner, order, age and range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array
from motionserver.core.intake.freshness import SECOND_NS, Freshness
from motionserver.core.intake.plausibility import Plausibility
from motionserver.core.intake.spoilage import Spoilage
from motionserver.core.state import DriveMode, VehicleMotion

REORDER_NS: Final = 2 * SECOND_NS
"""Silence after which an owner may be replaced [ns]."""
IMPLAUSIBLE_FORCE: Final = 10.0 * GRAVITY
"""Specific force no road vehicle survives: the packet is not believed [m/s2]."""
IMPLAUSIBLE_RATE: Final = np.radians(4000.0)
"""Body rate beyond every vehicle: the packet is not believed [rad/s]."""
FASTEST: Final = 1000.0
"""Speed beyond every vehicle: the packet is not believed [m/s]."""
FARTHEST: Final = 60.0
"""A preview beyond this is not believed [s]."""
_LEAK: Final = 100e-6
"""Upward drift of the least delay, so that a slow sender clock is followed [s/s]."""


@dataclass(frozen=True, slots=True)
class Owner:
    """Who moves the platform: where the packets come from and which run of it."""

    source: str
    address: str
    session: int


class Gate:
    """Believe or refuse packets of one input, one owner at a time."""

    def __init__(
        self, may_change_owner: Callable[[], bool] = lambda: True, look_ns: int = 0
    ) -> None:
        """Take nobody's packets yet.

        Args:
            may_change_owner: Whether another client may move the platform now.
            look_ns: Time between two looks at the input [ns].
        """
        self._look_ns = look_ns
        self.mode = DriveMode.DRIVE
        self.lost = 0
        self._may_change_owner = may_change_owner
        self._hand_over(None)

    def _hand_over(self, who: Owner | None) -> None:
        """Begin anew: what is known of one owner says nothing of the next."""
        self.owner = who
        self.freshness = Freshness(self._look_ns)
        self.spoilage = Spoilage()
        self.plausibility = Plausibility()
        self._sequence: int | None = None
        # least delay [ns], let drift since its instant [ns]
        self._quickest: tuple[float, int] | None = None

    def refuse(self, source: str, address: str, motion: VehicleMotion) -> str | None:
        """Judge a packet.

        Args:
            source: Name of the input it came by.
            address: Sender's address as text.
            motion: What it says.

        Returns:
            None if it is believed (and noted), else the name of the counter of the refusal:
            "second-client", "replayed", "reordered", "old", "out-of-range".
        """
        who = Owner(source, address, motion.session)
        now = motion.arrival_ns
        silent = self._is_silent(now)
        if who != self.owner:
            if not self._may_own(now):
                return "second-client"
        elif (order := self._order(motion)) is not None:
            return order
        if not _is_plausible(motion):
            self.spoilt(source, address, now)
            return "out-of-range"
        if who != self.owner:
            self._hand_over(who)
        elif silent:
            # a longer way or a sender's clock that stood still: the delay is learnt anew
            self._quickest = None
        elif self._is_old(motion):
            return "old"
        if motion.sequence is not None and self._sequence is not None:
            self.lost += max(0, ((motion.sequence - self._sequence) & 0xFFFFFFFF) - 1)
        self._sequence = motion.sequence
        self.mode = motion.mode
        self.freshness.arrived(now)
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

        What comes from an owner whose packets are spoilt is told as what never came; so is what
        seems to have wrong units, but that only keeps a drive from beginning.

        Args:
            now_ns: Now [ns].
            is_cued: Whether the platform is up and cued.
        """
        if self.spoilage.is_spoilt(now_ns) or (not is_cued and self.plausibility.complaint()):
            return 0
        return self.freshness.newest_ns or 0

    def is_fresh(self, now_ns: int) -> bool:
        """True if the owner's packets arrive in time, and nearly all of them can be believed."""
        return not self.freshness.is_stale(now_ns) and not self.spoilage.is_spoilt(now_ns)

    def _may_own(self, now_ns: int) -> bool:
        if self.owner is None:
            return True
        left = self.mode is DriveMode.BYE or self._is_silent(now_ns)
        return left and self._may_change_owner()

    def _is_silent(self, now_ns: int) -> bool:
        age = self.freshness.age_ns(now_ns)
        return age is None or age > REORDER_NS

    def _order(self, motion: VehicleMotion) -> str | None:
        if motion.sequence is None or self._sequence is None:
            return None
        ahead = (motion.sequence - self._sequence) & 0xFFFFFFFF
        if ahead == 0:
            return "replayed"
        return "reordered" if ahead >= 1 << 31 else None

    def _is_old(self, motion: VehicleMotion) -> bool:
        """Delayed beyond the stale limit against the least delay seen: a burst after a stall."""
        if motion.sender_ns is None:
            return False
        offset = float(motion.arrival_ns - motion.sender_ns)
        least = offset
        if self._quickest is not None:
            before, at_ns = self._quickest
            least = min(before + (motion.arrival_ns - at_ns) * _LEAK, offset)
        self._quickest = (least, motion.arrival_ns)
        return offset - least > self.freshness.stale_after_ns()


def _is_plausible(motion: VehicleMotion) -> bool:
    """False for what no vehicle does, for what is no number, for a future that is none."""
    if not (_is_within(motion.force, motion.rates) and abs(motion.speed) <= FASTEST):
        return False
    preview = motion.preview
    if preview is None:
        return True
    times = preview.times
    ahead = bool(times[0] >= 0.0 and times[-1] <= FARTHEST and np.all(np.diff(times) > 0.0))
    return ahead and _is_within(preview.force, preview.rates)


def _is_within(force: Array, rates: Array) -> bool:
    # asked so that a NaN is outside
    return bool(
        np.all(np.abs(force) <= IMPLAUSIBLE_FORCE) and np.all(np.abs(rates) <= IMPLAUSIBLE_RATE)
    )
