"""Scheduling class, its throttle and locked memory, from made-up machines in every level."""

import pytest

from motionserver.doctor import mends
from motionserver.doctor.finding import Level
from motionserver.doctor.scheduling import memory_lock, realtime_throttle, scheduling_class

FIFO = "SCHED_FIFO 50"
NICE = "nice -10: no permission for SCHED_FIFO"
NORMAL = "normal scheduling: no permission for SCHED_FIFO, ticks may be late under load"
CAPABLE = "CapEff:\t0000000000800000\n"
PLAIN = "CapEff:\t0000000000000000\n"


def limits(soft, hard, locked="8388608"):
    return (
        f"Max locked memory         {locked}              {locked}              bytes\n"
        f"Max realtime priority     {soft}                    {hard}\n"
    )


@pytest.mark.parametrize(
    ("soft", "hard", "status", "granted", "level", "mend"),
    [
        (60, 60, PLAIN, FIFO, Level.OK, ""),
        (0, 0, CAPABLE, FIFO, Level.OK, ""),
        (0, 0, CAPABLE, None, Level.OK, ""),
        (50, 50, PLAIN, None, Level.OK, ""),
        (0, 0, PLAIN, None, Level.WARNING, mends.REALTIME_USER),
        (0, 0, PLAIN, NORMAL, Level.WARNING, mends.REALTIME_USER),
        (0, 0, PLAIN, NICE, Level.ADVICE, mends.REALTIME_USER),
        (0, 95, PLAIN, NORMAL, Level.WARNING, mends.REALTIME_SOFT),
        (0, 50, PLAIN, NORMAL, Level.WARNING, mends.REALTIME_SOFT),
        (0, 49, PLAIN, NORMAL, Level.WARNING, mends.REALTIME_USER),
        (50, 50, PLAIN, NORMAL, Level.WARNING, mends.REALTIME_GROUP),
        (30, 30, CAPABLE, NICE, Level.ADVICE, mends.REALTIME_GROUP),
        (29, 29, PLAIN, NORMAL, Level.WARNING, mends.REALTIME_USER),
        (30, 30, PLAIN, NORMAL, Level.PROBLEM, mends.REALTIME_USER),
        (49, 99, PLAIN, NICE, Level.PROBLEM, mends.REALTIME_SOFT),
    ],
)
def test_scheduling_class_levels(plant, soft, hard, status, granted, level, mend):
    tree = plant({"/proc/self/limits": limits(soft, hard), "/proc/self/status": status})
    finding = scheduling_class(tree, granted, realtime=True)
    assert finding.level is level
    assert finding.mend.startswith(mend)
    assert bool(finding.mend) == bool(mend)
    assert f"RLIMIT_RTPRIO {soft} (hard {hard})" in finding.found
    assert f"CAP_SYS_NICE {'yes' if status is CAPABLE else 'no'}" in finding.found


def test_a_container_is_mended_outside_of_it(plant):
    files = {"/proc/self/limits": limits(0, 0), "/proc/self/status": PLAIN, "/.dockerenv": ""}
    assert scheduling_class(plant(files), NORMAL, True).mend == mends.REALTIME_CONTAINER


def test_a_configuration_that_asks_for_nothing_gets_advice(plant):
    finding = scheduling_class(plant({}), "normal scheduling, as configured", realtime=False)
    assert finding.level is Level.ADVICE
    assert finding.mend == "[server] realtime = true"


def test_a_machine_that_tells_nothing_is_unknown_unless_it_was_tried(plant):
    assert scheduling_class(plant({}), None, True).level is Level.UNKNOWN
    half = plant({"/proc/self/status": PLAIN})
    assert scheduling_class(half, None, True).level is Level.UNKNOWN
    assert scheduling_class(plant({}), FIFO, True).level is Level.OK
    assert scheduling_class(plant({}), NORMAL, True).level is Level.WARNING


@pytest.mark.parametrize(
    ("runtime", "period", "level", "mend"),
    [
        ("950000", "1000000", Level.OK, ""),
        ("500000", "1000000", Level.OK, ""),
        ("400000", "1000000", Level.WARNING, mends.THROTTLE),
        ("0", "1000000", Level.PROBLEM, mends.THROTTLE),
        ("-1", "1000000", Level.ADVICE, mends.THROTTLE),
        (None, "1000000", Level.UNKNOWN, ""),
        ("950000", None, Level.UNKNOWN, ""),
    ],
)
def test_throttle_levels(plant, runtime, period, level, mend):
    files = {
        "/proc/sys/kernel/sched_rt_runtime_us": runtime,
        "/proc/sys/kernel/sched_rt_period_us": period,
    }
    finding = realtime_throttle(plant({k: v for k, v in files.items() if v is not None}))
    assert (finding.level, finding.mend) == (level, mend)


@pytest.mark.parametrize(("own", "level"), [("0", Level.WARNING), ("400000", Level.OK)])
def test_a_control_group_without_a_real_time_share(plant, own, level):
    tree = plant(
        {
            "/proc/sys/kernel/sched_rt_runtime_us": "950000",
            "/proc/sys/kernel/sched_rt_period_us": "1000000",
            "/proc/self/cgroup": "1:cpu:/docker/a\n",
            "/sys/fs/cgroup/cpu/docker/a/cpu.rt_runtime_us": own,
            "/sys/fs/cgroup/cpu/cpu.rt_runtime_us": "950000",
        }
    )
    finding = realtime_throttle(tree)
    assert finding.level is level
    assert finding.mend == ("" if level is Level.OK else mends.REALTIME_GROUP)


SWAPS = "Filename Type Size Used Priority\n"


@pytest.mark.parametrize(
    ("locked", "status", "swaps", "level", "may"),
    [
        ("unlimited", PLAIN, SWAPS, Level.OK, "mlockall allowed"),
        ("8388608", "CapEff:\t0000000000004000\n", SWAPS, Level.OK, "mlockall allowed"),
        ("8388608", PLAIN, SWAPS, Level.OK, "mlockall not allowed: RLIMIT_MEMLOCK 8.0 MiB"),
        ("unlimited", PLAIN, SWAPS + "/dev/sda file 8 0 -2\n", Level.OK, "mlockall allowed"),
        ("8388608", PLAIN, SWAPS + "/dev/sda file 8 0 -2\n", Level.ADVICE, "mlockall not allowed"),
        ("8388608", "nothing", SWAPS, Level.UNKNOWN, "cannot be read"),
    ],
)
def test_memory_lock_levels(plant, locked, status, swaps, level, may):
    tree = plant(
        {
            "/proc/self/limits": limits(0, 0, locked),
            "/proc/self/status": status,
            "/proc/swaps": swaps,
        }
    )
    finding = memory_lock(tree)
    assert finding.level is level
    assert may in finding.found
    assert finding.mend == (mends.SWAP if level is Level.ADVICE else "")
