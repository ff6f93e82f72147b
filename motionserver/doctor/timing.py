"""How late a process that only sleeps wakes up, and what rate that promises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from motionserver.doctor.finding import Finding, Level
from motionserver.doctor.mends import LOOK_LONGER
from motionserver.telemetry.histogram import Histogram, middle_of
from motionserver.telemetry.ticker import ticks_per_send

STALL: Final = 0.005
"""A wake-up later than this is a stall [s]."""
FINE: Final = 0.75
"""p99.9 may be this share of a period: 3 ms of 4 at 250 Hz."""
LOST: Final = 0.005
"""Share of slots that may be lost."""
HOPELESS: Final = 0.05
"""Share of lost slots from which a guard cannot keep a platform up."""
LADDER: Final = (240.0, 480.0, 960.0)
"""Rates named as what the same lateness would do for [Hz]."""


@dataclass(frozen=True, slots=True)
class Sleep:
    """What a process that only sleeps on the guard's grid saw.

    Attributes:
        rate_hz: Of its grid [Hz].
        seconds: How long it slept [s].
        late: How late it woke.
        lost: Slots it slept through.
        scheduling: What the kernel granted, in words.
    """

    rate_hz: float
    seconds: float
    late: Histogram
    lost: int
    scheduling: str

    def percentile(self, share: float) -> float:
        """Lateness that ``share`` of the wake-ups do not exceed [s]."""
        return self.late.percentile(share) * 1e-9

    @property
    def lost_share(self) -> float:
        """Lost slots of all slots, 0..1."""
        return self.lost / max(1, self.late.total + self.lost)

    @property
    def stalls(self) -> int:
        """Wake-ups later than `STALL`."""
        return sum(
            count
            for index, count in enumerate(self.late.counts)
            if count and middle_of(index) > STALL * 1e9
        )

    def level_at(self, rate_hz: float) -> Level:
        """How well wake-ups this late would do on a grid of ``rate_hz``."""
        share = self.lost_share
        if rate_hz != self.rate_hz:
            lost = sum(
                count * int(middle_of(index) * rate_hz // 1e9)
                for index, count in enumerate(self.late.counts)
                if count
            )
            share = lost / max(1, self.late.total + lost)
        if share > HOPELESS:
            return Level.PROBLEM
        if share > LOST:
            return Level.WARNING
        return Level.OK if self.percentile(0.999) <= FINE / rate_hz else Level.ADVICE

    def to_mapping(self) -> dict[str, Any]:
        """Write it for JSON."""
        return {
            "rate_hz": self.rate_hz,
            "seconds": self.seconds,
            "scheduling": self.scheduling,
            "ticks": self.late.total,
            "lost": self.lost,
            "stalls": self.stalls,
            "late_p50_ms": round(self.percentile(0.5) * 1e3, 4),
            "late_p99_ms": round(self.percentile(0.99) * 1e3, 4),
            "late_p999_ms": round(self.percentile(0.999) * 1e3, 4),
            "late_max_ms": round(self.percentile(1.0) * 1e3, 4),
        }


def tick_rate_of(packets_hz: float) -> float:
    """The guard's rate [Hz]: the smallest multiple of the platform's that is at least 240 Hz."""
    return ticks_per_send(packets_hz) * packets_hz


_THOUSAND: Final = 1000
"""Wake-ups below which p99.9 is nothing but the largest."""
_WORDS: Final = {
    Level.OK: "fine",
    Level.ADVICE: "fair: a tick in a thousand comes late",
    Level.WARNING: "poor: slots are lost",
    Level.PROBLEM: "not kept",
}


def promise(sleep: Sleep) -> str:
    """The sentence on top: what rate this machine can promise."""
    level = sleep.level_at(sleep.rate_hz)
    word = "p99.9" if sleep.late.total >= _THOUSAND else "largest"
    text = (
        f"guard at {sleep.rate_hz:g} Hz: {word} lateness {sleep.percentile(0.999) * 1e3:.2f} ms "
        f"of a period of {1e3 / sleep.rate_hz:.2f} ms, {_WORDS[level]}"
    )
    if level is not Level.OK:
        return text
    more = [rate for rate in LADDER if rate > sleep.rate_hz and sleep.level_at(rate) is Level.OK]
    return f"{text}; by wake-ups alone {more[-1]:g} Hz too" if more else text


def wake_up_lateness(sleep: Sleep) -> Finding:
    """How late the guard would wake."""
    level = sleep.level_at(sleep.rate_hz)
    if sleep.scheduling.startswith("SCHED_FIFO"):
        mend = f"{LOOK_LONGER}; mend what else stands here"
    else:
        mend = "mend scheduling class first, then: motionserver doctor --seconds 60"
    cuts = " / ".join(f"{sleep.percentile(share) * 1e3:.3f}" for share in (0.5, 0.99, 0.999))
    return Finding(
        "wake-up lateness",
        level,
        f"p50 / p99 / p99.9 {cuts} ms at {sleep.rate_hz:g} Hz, {sleep.lost} of "
        f"{sleep.late.total + sleep.lost} slots lost in {sleep.seconds:g} s, "
        f"{sleep.scheduling.partition(':')[0]}",
        "no tick of the guard can be more punctual; a late one pauses the plan's clock, "
        "nothing jumps",
        "" if level is Level.OK else mend,
    )


def stalls(sleep: Sleep, packets_hz: float) -> Finding:
    """How often and how long nothing ran, judged by when the platform would be missed.

    Args:
        sleep: What was measured.
        packets_hz: Packets the platform expects per second.
    """
    longest = sleep.percentile(1.0) if sleep.stalls else 0.0
    silence = max(0.1, 6.0 / packets_hz)
    if not sleep.stalls:
        level, means = Level.OK, "nothing held the processor while it was watched"
    elif longest < 2.0 / packets_hz:
        level, means = Level.ADVICE, "a packet comes late; the base does not miss it"
    elif longest < silence:
        level, means = Level.WARNING, "packets are missing; the plan pauses, the base may complain"
    else:
        level = Level.PROBLEM
        means = f"beyond {silence * 1e3:.0f} ms the answers of the base count as lost: FAULT"
    noun = "wake-up" if sleep.stalls == 1 else "wake-ups"
    found = f"{sleep.stalls} {noun} later than {STALL * 1e3:g} ms in {sleep.seconds:g} s"
    if sleep.stalls:
        found += f", the longest {longest * 1e3:.1f} ms"
    return Finding("stalls", level, found, means, "" if level is Level.OK else LOOK_LONGER)


def timer_grain(resolution: float) -> Finding:
    """Whether the kernel has high-resolution timers.

    Args:
        resolution: Of CLOCK_MONOTONIC by clock_getres [s]: one period of the kernel's tick
            without high-resolution timers.
    """
    fine = resolution <= 1e-6
    return Finding(
        "timer grain",
        Level.OK if fine else Level.PROBLEM,
        f"{resolution * 1e9:.0f} ns" if fine else f"{resolution * 1e3:g} ms",
        "timers are finer than any tick"
        if fine
        else "the kernel has no high-resolution timers: ticks of 4 ms cannot be kept",
        "" if fine else "boot without highres=off, with a kernel that has CONFIG_HIGH_RES_TIMERS=y",
    )
