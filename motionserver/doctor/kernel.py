"""The kernel's own settings and complaints."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from motionserver.doctor import mends
from motionserver.doctor.finding import Finding, Level, unknown
from motionserver.doctor.tree import INFINITE, Tree

GOOD_SOURCES: Final = frozenset(
    {"tsc", "kvm-clock", "arch_sys_counter", "riscv_clocksource", "timebase"}
    | {"hyperv_clocksource_tsc_page", "xen"}
)
"""Clock sources read without asking a device."""
SLOW_SOURCES: Final = frozenset({"hpet", "acpi_pm", "hyperv_clocksource_msr", "refined-jiffies"})
COARSE_SOURCES: Final = frozenset({"jiffies", "refined-jiffies"})
FEW_FILES, ENOUGH_FILES = 256, 1024
"""Below the first the page runs out with 64 visitors; the second is the usual limit."""
_SHOWN: Final = 3
_HELD: Final = "something held a processor; a guard there was late by as much"


@dataclass(frozen=True, slots=True)
class _Complaint:
    """One kind of line in the kernel's log.

    Attributes:
        pattern: Finds it; its group, if any, is how long something stood.
        unit: Of that number [s].
        level: How bad it is.
        means: What it means for the motion.
    """

    pattern: str
    unit: float
    level: Level
    means: str = _HELD


_COMPLAINTS: Final = (
    _Complaint(r"soft lockup.*stuck for (\d+)s", 1.0, Level.PROBLEM),
    _Complaint(r"rcu.*(?:self-detected stall|detected stalls)", 0.0, Level.WARNING),
    _Complaint(
        r"RT throttling activated",
        0.0,
        Level.WARNING,
        "real-time processes used their share up and were stopped; one that spins does the "
        "same to the guard",
    ),
    _Complaint(
        r"clocksource: .* unstable|Marking clocksource .* unstable",
        0.0,
        Level.WARNING,
        "the kernel gave its clock up for a slower one",
    ),
    _Complaint(r"hrtimer: interrupt took (\d+) ns", 1e-9, Level.ADVICE),
    _Complaint(
        r"blocked for more than (\d+) seconds",
        1.0,
        Level.ADVICE,
        "a process waited for a disk or the network; the guard waits for neither",
    ),
)


def clock_source(tree: Tree) -> Finding:
    """What the kernel reads the time from."""
    name = "clock source"
    folder = "/sys/devices/system/clocksource/clocksource0"
    source = tree.text(f"{folder}/current_clocksource")
    if not source:
        return unknown(name, "the kernel does not tell its clock source")
    if source in GOOD_SOURCES:
        return Finding(name, Level.OK, source, "reading the time takes tens of nanoseconds")
    others = (tree.text(f"{folder}/available_clocksource") or "").split()
    better = next((other for other in others if other in GOOD_SOURCES), None)
    mend = (
        mends.CLOCK_SOURCE.format(source=better)
        if better
        else "boot with tsc=reliable if the processor's counter is constant"
    )
    if source in COARSE_SOURCES:
        return Finding(
            name, Level.PROBLEM, source, "the time moves in steps of milliseconds: no tick is kept",
            mend,
        )  # fmt: skip
    if source in SLOW_SOURCES:
        return Finding(
            name, Level.WARNING, source, "each look at the clock asks a device: microseconds each",
            mend,
        )  # fmt: skip
    return unknown(name, f"{source}, which is not known here")


def huge_pages(tree: Tree) -> Finding:
    """Whether the kernel gathers pages behind the back of everybody."""
    name = "transparent huge pages"
    text = tree.text("/sys/kernel/mm/transparent_hugepage/enabled")
    chosen = re.search(r"\[(\w+)\]", text or "")
    if chosen is None:
        return unknown(name, "the kernel does not tell; it may have been built without them")
    if chosen[1] == "always":
        return Finding(
            name, Level.ADVICE, "always",
            "the kernel may move the memory of guard and planner while they run", mends.HUGE_PAGES,
        )  # fmt: skip
    return Finding(name, Level.OK, chosen[1], "nobody's memory is moved unasked")


def swap(tree: Tree) -> Finding:
    """Whether memory may go to a disk, and whether it did."""
    name = "swap"
    lines = tree.lines("/proc/swaps")
    if lines is None:
        return unknown(name, "/proc/swaps cannot be read")
    areas = [line.split() for line in lines[1:] if len(line.split()) >= 4]
    if not areas:
        return Finding(name, Level.OK, "none", "memory stays in memory")
    size, used = (sum(int(area[column]) for area in areas) / 2**20 for column in (2, 3))
    return Finding(
        name, Level.WARNING if used > 0 else Level.ADVICE, f"{used:.2f} of {size:.2f} GiB in use",
        "a page that is not locked may go to the disk; fetched back it costs a tick 10 ms and more",
        mends.SWAP,
    )  # fmt: skip


def open_files(tree: Tree) -> Finding:
    """How many files each process may have open."""
    name = "open files"
    limit = tree.limit("Max open files")
    if limit is None:
        return unknown(name, "/proc/self/limits cannot be read")
    found = "unlimited" if limit.soft == INFINITE else f"{limit.soft} (hard {limit.hard})"
    if limit.soft >= ENOUGH_FILES:
        return Finding(name, Level.OK, found, "enough for the page's 64 visitors and the rest")
    level = Level.PROBLEM if limit.soft < FEW_FILES else Level.WARNING
    return Finding(
        name, level, found, "the page refuses visitors, then restarts fail", mends.OPEN_FILES
    )


def kernel_log(tree: Tree) -> Finding:
    """What the kernel itself wrote down about things that stood, with their length."""
    name = "kernel's stalls"
    lines = tree.log("/dev/kmsg")
    if lines is None:
        return unknown(name, "the kernel's log is not open to this user", mends.KERNEL_LOG)
    seen: list[str] = []
    kinds: list[_Complaint] = []
    longest = 0.0
    for line in lines:
        for kind in _COMPLAINTS:
            if match := re.search(kind.pattern, line):
                if kind.unit:
                    longest = max(longest, int(match[1]) * kind.unit)
                seen.append(match[0])
                kinds.append(kind)
    if not kinds:
        return Finding(name, Level.OK, f"none in {len(lines)} lines of its log", "nothing stood")
    shown = list(dict.fromkeys(seen))
    found = f"{len(seen)} since the boot: " + "; ".join(shown[:_SHOWN])
    if len(shown) > _SHOWN:
        found += f" and {len(shown) - _SHOWN} others"
    if longest:
        found += f"; the longest {longest:.3g} s"
    worst = max(kinds, key=lambda kind: kind.level.rank)
    return Finding(name, worst.level, found, worst.means, mends.KERNEL_LOG)
