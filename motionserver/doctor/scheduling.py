"""What the kernel lets guard and planner have: real-time class, its throttle, locked memory."""

from __future__ import annotations

from typing import Final

from motionserver.doctor import mends
from motionserver.doctor.finding import Finding, Level, unknown
from motionserver.doctor.measure import GUARD_PRIORITY
from motionserver.doctor.tree import INFINITE, Tree

PLANNER_PRIORITY: Final = 30
"""What the planner asks for with SCHED_FIFO."""
_NORMAL: Final = "guard and planner compete with everything else: ticks are late under load"


def scheduling_class(tree: Tree, granted: str | None, realtime: bool) -> Finding:
    """Whether SCHED_FIFO is granted, and by what.

    Args:
        tree: The machine's files.
        granted: What a process that asked for it got, in the words of `take_priority`; None if
            nobody asked.
        realtime: [server] realtime.
    """
    name = "scheduling class"
    if not realtime:
        return Finding(
            name, Level.ADVICE, "not asked for: [server] realtime = false", _NORMAL,
            "[server] realtime = true",
        )  # fmt: skip
    limit, able = tree.limit("Max realtime priority"), tree.may("CAP_SYS_NICE")
    by = [
        "RLIMIT_RTPRIO " + ("unknown" if limit is None else f"{limit.soft} (hard {limit.hard})"),
        "CAP_SYS_NICE " + ("unknown" if able is None else "yes" if able else "no"),
    ]
    facts = ", ".join(by)
    if granted is not None and granted.startswith("SCHED_FIFO"):
        return Finding(
            name, Level.OK, f"{granted} granted; {facts}",
            "guard and planner win against everything of normal priority",
        )  # fmt: skip
    permitted = able or (limit is not None and limit.soft >= GUARD_PRIORITY)
    if granted is None and permitted:
        return Finding(
            name, Level.OK, f"SCHED_FIFO permitted, not tried; {facts}",
            "guard and planner win against everything of normal priority",
        )  # fmt: skip
    if granted is None and (limit is None or able is None):
        return unknown(name, facts)
    if permitted:
        mend = mends.REALTIME_GROUP
    elif limit is not None and limit.hard >= GUARD_PRIORITY:
        mend = mends.REALTIME_SOFT
    elif tree.is_container():
        mend = mends.REALTIME_CONTAINER
    else:
        mend = mends.REALTIME_USER + ", then log in again"
    if not able and limit is not None and PLANNER_PRIORITY <= limit.soft < GUARD_PRIORITY:
        return Finding(
            name, Level.PROBLEM, f"SCHED_FIFO up to {limit.soft}: {facts}",
            f"the planner gets its {PLANNER_PRIORITY}, the guard not its {GUARD_PRIORITY}: "
            "thinking would hold up sending",
            mend,
        )  # fmt: skip
    nice = granted is not None and granted.startswith("nice")
    return Finding(
        name, Level.ADVICE if nice else Level.WARNING,
        f"SCHED_FIFO refused, {(granted or 'not tried').partition(':')[0]}; {facts}",
        "better than normal, yet late beside real-time work" if nice else _NORMAL,
        mend,
    )  # fmt: skip


def realtime_throttle(tree: Tree) -> Finding:
    """What share of a second real-time processes may have, here and in our control group."""
    name = "real-time throttle"
    runtime = tree.number("/proc/sys/kernel/sched_rt_runtime_us")
    period = tree.number("/proc/sys/kernel/sched_rt_period_us")
    if runtime is None or period is None:
        return unknown(name, "kernel.sched_rt_runtime_us cannot be read")
    for folder in tree.groups("cpu"):
        own = tree.number(f"{folder}/cpu.rt_runtime_us")
        if own == 0:
            return Finding(
                name, Level.WARNING, f"{folder}: cpu.rt_runtime_us 0",
                "this control group has no real-time share: SCHED_FIFO is refused in it",
                mends.REALTIME_GROUP,
            )  # fmt: skip
    found = f"{runtime / 1000:g} of every {period / 1000:g} ms for real-time processes"
    if runtime < 0:
        return Finding(
            name, Level.ADVICE, "off: real-time processes may take all time",
            "a solver that runs away would hold the machine for ever", mends.THROTTLE,
        )  # fmt: skip
    if 2 * runtime < period:
        level = Level.PROBLEM if runtime == 0 else Level.WARNING
        means = "guard and planner are stopped for the rest of each period"
        return Finding(name, level, found, means, mends.THROTTLE)
    return Finding(
        name, Level.OK, found, "a solver that runs away cannot hold the machine; leave it as it is"
    )


def memory_lock(tree: Tree) -> Finding:
    """Whether guard and planner may lock their memory; without swap nothing depends on it."""
    name = "memory lock"
    limit, able = tree.limit("Max locked memory"), tree.may("CAP_IPC_LOCK")
    if limit is None or able is None:
        return unknown(name, "RLIMIT_MEMLOCK or the capabilities cannot be read")
    soft = "unlimited" if limit.soft == INFINITE else f"{limit.soft / 2**20:.1f} MiB"
    may = able or limit.soft == INFINITE
    found = f"mlockall {'allowed' if may else 'not allowed'}: RLIMIT_MEMLOCK {soft}, " + (
        f"CAP_IPC_LOCK {'yes' if able else 'no'}"
    )
    swapping = [line for line in (tree.lines("/proc/swaps") or [])[1:] if line.strip()]
    if may:
        return Finding(name, Level.OK, found, "guard and planner lock theirs: it stays in memory")
    if swapping:
        return Finding(
            name, Level.ADVICE, found,
            "guard and planner cannot lock theirs: on a machine that swaps its pages may leave it",
            mends.SWAP,
        )  # fmt: skip
    return Finding(name, Level.OK, found, "without swap it stays in memory unlocked too")
