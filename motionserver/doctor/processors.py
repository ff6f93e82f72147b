"""The processors: how many, how fast, shared with whom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from motionserver.doctor import mends
from motionserver.doctor.finding import Finding, Level, unknown
from motionserver.doctor.tree import Tree

ENOUGH: Final = 2
"""Processors for guard and planner without one waiting for the other."""
STOLEN: Final = ((0.05, Level.PROBLEM), (0.01, Level.WARNING), (0.001, Level.ADVICE))
"""Shares of time that the host took, and how bad that is."""
_STEAL, _GUEST = 7, 8


def governor(tree: Tree) -> Finding:
    """Which rule chooses the processors' clock."""
    name = "frequency governor"
    paths = tree.glob("/sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor")
    found = sorted({text for path in paths if (text := tree.text(path))})
    if not found:
        return unknown(name, "no cpufreq here: the host or the firmware chooses the clock")
    text = f"{', '.join(found)} on {len(paths)} processors"
    if found == ["performance"]:
        return Finding(name, Level.OK, text, "the clock stays high, wake-ups stay short")
    # intel_pstate and amd-pstate call their load-following rule powersave; elsewhere it is the
    # slowest clock there is
    drivers = {tree.text(path.replace("_governor", "_driver")) for path in paths}
    following = all(driver and "pstate" in driver for driver in drivers)
    level = Level.WARNING if "powersave" in found and not following else Level.ADVICE
    return Finding(
        name, level, text,
        "the clock falls while the guard sleeps: plans take longer and their time varies",
        mends.GOVERNOR,
    )  # fmt: skip


def processors(tree: Tree) -> Finding:
    """How many processors this process may use."""
    name = "processors"
    for line in tree.lines("/proc/self/status") or []:
        if line.startswith("Cpus_allowed_list:"):
            allowed = _members(line.split(":", 1)[1])
            break
    else:
        return unknown(name, "/proc/self/status tells no Cpus_allowed_list")
    online = _members(tree.text("/sys/devices/system/cpu/online") or "")
    found = f"{len(allowed)} usable" + (f" of {len(online)} online" if online else "")
    if len(allowed) >= ENOUGH:
        return Finding(name, Level.OK, found, "guard and planner need not wait for each other")
    return Finding(
        name, Level.WARNING, found,
        "planner, guard and page share one: each plan's check and each request delays the other",
        f"give the machine or the container {ENOUGH} processors: docker update --cpuset-cpus 0-1 "
        "CONTAINER" if tree.is_container() else
        f"taskset -c 0-1 motionserver run CONFIG.toml, on a machine of at least {ENOUGH}",
    )  # fmt: skip


def _members(text: str) -> list[int]:
    """Numbers of a list such as "0-3,6"; empty if it is no such list."""
    out: list[int] = []
    for part in text.strip().split(","):
        low, _, high = part.partition("-")
        if not low.isdigit() or (high and not high.isdigit()):
            return []
        out.extend(range(int(low), int(high or low) + 1))
    return out


def quota(tree: Tree) -> Finding:
    """Whether a control group stops us once a share of the processors is used up."""
    name = "processor quota"
    if tree.text("/proc/self/cgroup") is None:
        return unknown(name, "/proc/self/cgroup cannot be read")
    tightest: tuple[float, float, str] | None = None
    throttled = 0
    for folder in tree.groups("cpu"):
        share = _quota_of(tree, folder)
        if share is not None and (tightest is None or share[0] < tightest[0]):
            tightest = (*share, folder)
        throttled = max(throttled, _throttled(tree, folder))
    if tightest is None:
        return Finding(name, Level.OK, "none", "nobody stops the guard for using its time up")
    processors_worth, period, folder = tightest
    found = f"{processors_worth:g} processors in each {period * 1e3:g} ms ({folder}), " + (
        f"throttled {throttled} times so far"
    )
    means = f"once it is used up everything stands for up to {period * 1e3:g} ms"
    mend = mends.QUOTA_CONTAINER if tree.is_container() else mends.QUOTA_UNIT
    if processors_worth < 1.0:
        return Finding(name, Level.PROBLEM, found, means, mend)
    level = Level.WARNING if throttled or processors_worth < ENOUGH else Level.ADVICE
    return Finding(name, level, found, means, mend)


def _quota_of(tree: Tree, folder: str) -> tuple[float, float] | None:
    """Processors' worth and period [s] of one control group; None without a quota."""
    words = (tree.text(f"{folder}/cpu.max") or "").split()
    if len(words) == 2 and words[0].isdigit() and words[1].isdigit():
        return int(words[0]) / int(words[1]), int(words[1]) * 1e-6
    share = tree.number(f"{folder}/cpu.cfs_quota_us")
    period = tree.number(f"{folder}/cpu.cfs_period_us")
    if share is None or period is None or share < 0:
        return None
    return share / period, period * 1e-6


def _throttled(tree: Tree, folder: str) -> int:
    for line in tree.lines(f"{folder}/cpu.stat") or []:
        if line.startswith("nr_throttled "):
            return int(line.split()[1])
    return 0


@dataclass(frozen=True, slots=True)
class Stolen:
    """Time the kernel counted, in its own ticks: all of it, and what the host took."""

    total: int
    steal: int


def stolen(tree: Tree) -> Stolen | None:
    """What /proc/stat tells now; None if it tells nothing of stolen time."""
    for line in tree.lines("/proc/stat") or []:
        words = line.split()
        if words and words[0] == "cpu":
            values = [int(word) for word in words[1:]]
            # guest time is counted in user time already
            return Stolen(sum(values[:_GUEST]), values[_STEAL]) if len(values) > _STEAL else None
    return None


def steal_time(before: Stolen | None, after: Stolen | None) -> Finding:
    """What share of the time the host gave to others while it was watched, and since the boot."""
    name = "steal time"
    if before is None or after is None or after.total <= 0:
        return unknown(name, "/proc/stat tells no stolen time")
    passed = after.total - before.total
    now = (after.steal - before.steal) / passed if passed > 0 else 0.0
    ever = after.steal / after.total
    level = next((level for least, level in STOLEN if max(now, ever) >= least), Level.OK)
    return Finding(
        "steal time", level,
        f"{now:.2%} while watched, {ever:.2%} since the boot",
        "the host leaves our processors to us" if level is Level.OK else
        "the host gives our processors to others: nothing in this machine mends such stalls",
        "" if level is Level.OK else
        "ask for dedicated processors on the host (virsh vcpupin DOMAIN 0 0), or take a machine "
        "without a host",
    )  # fmt: skip
