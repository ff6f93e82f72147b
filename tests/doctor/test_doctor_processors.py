"""Processors: governor, number, quota and what the host takes, in every level."""

import pytest

from motionserver.doctor import mends
from motionserver.doctor.finding import Level
from motionserver.doctor.processors import (
    Stolen,
    governor,
    processors,
    quota,
    steal_time,
    stolen,
)

CPUS = "/sys/devices/system/cpu"


def governed(*governors, driver="acpi-cpufreq"):
    files = {}
    for number, name in enumerate(governors):
        files[f"{CPUS}/cpu{number}/cpufreq/scaling_governor"] = f"{name}\n"
        files[f"{CPUS}/cpu{number}/cpufreq/scaling_driver"] = f"{driver}\n"
    return files


@pytest.mark.parametrize(
    ("files", "level", "found"),
    [
        (governed("performance", "performance"), Level.OK, "performance on 2 processors"),
        (governed("schedutil"), Level.ADVICE, "schedutil on 1 processors"),
        (governed("performance", "ondemand"), Level.ADVICE, "ondemand, performance on 2"),
        (governed("powersave"), Level.WARNING, "powersave on 1"),
        (governed("powersave", driver="intel_pstate"), Level.ADVICE, "powersave on 1"),
        (governed("powersave", driver="amd-pstate-epp"), Level.ADVICE, "powersave on 1"),
        ({}, Level.UNKNOWN, "no cpufreq here"),
    ],
)
def test_governor_levels(plant, files, level, found):
    finding = governor(plant(files))
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend == ("" if level in (Level.OK, Level.UNKNOWN) else mends.GOVERNOR)


@pytest.mark.parametrize(
    ("allowed", "online", "level", "found"),
    [
        ("0-3", "0-3", Level.OK, "4 usable of 4 online"),
        ("0,2-3", "0-7", Level.OK, "3 usable of 8 online"),
        ("1", "0-3", Level.WARNING, "1 usable of 4 online"),
        ("0-1", None, Level.OK, "2 usable"),
        (None, "0-3", Level.UNKNOWN, "/proc/self/status tells no Cpus_allowed_list"),
    ],
)
def test_processor_levels(plant, allowed, online, level, found):
    files = {}
    if allowed is not None:
        files["/proc/self/status"] = f"Cpus_allowed:\tff\nCpus_allowed_list:\t{allowed}\n"
    if online is not None:
        files[f"{CPUS}/online"] = f"{online}\n"
    finding = processors(plant(files))
    assert (finding.level, finding.found) == (level, found)


def test_one_processor_is_mended_where_it_was_taken(plant):
    status = {"/proc/self/status": "Cpus_allowed_list:\t0\n"}
    assert processors(plant(status)).mend.startswith("taskset -c 0-1")
    assert "docker update" in processors(plant({**status, "/.dockerenv": ""})).mend


def v2(limit, throttled=0, folder="/sys/fs/cgroup/a"):
    return {
        "/proc/self/cgroup": "0::/a/b\n",
        f"{folder}/cpu.max": f"{limit}\n",
        f"{folder}/cpu.stat": f"usage_usec 5\nnr_throttled {throttled}\n",
        "/sys/fs/cgroup/a/b/cgroup.procs": "",
    }


def v1(quota_us):
    return {
        "/proc/self/cgroup": "3:cpu,cpuacct:/x\n",
        "/sys/fs/cgroup/cpu,cpuacct/x/cpu.cfs_quota_us": f"{quota_us}\n",
        "/sys/fs/cgroup/cpu,cpuacct/x/cpu.cfs_period_us": "50000\n",
    }


@pytest.mark.parametrize(
    ("files", "level", "found"),
    [
        (v2("max 100000"), Level.OK, "none"),
        ({"/proc/self/cgroup": "0::/\n"}, Level.OK, "none"),
        (v1(-1), Level.OK, "none"),
        (v2("400000 100000"), Level.ADVICE, "4 processors in each 100 ms"),
        (v2("400000 100000", 7), Level.WARNING, "4 processors in each 100 ms"),
        (v2("150000 100000"), Level.WARNING, "1.5 processors in each 100 ms"),
        (v2("200000 100000"), Level.ADVICE, "2 processors in each 100 ms"),
        (v2("100000 100000"), Level.WARNING, "1 processors in each 100 ms"),
        (v2("50000 100000"), Level.PROBLEM, "0.5 processors in each 100 ms"),
        (v2("50000 100000", folder="/sys/fs/cgroup/a/b"), Level.PROBLEM, "0.5 processors"),
        ({**v1(25000), "/sys/fs/cgroup/cpu,cpuacct/x/cpu.cfs_period_us": ""}, Level.OK, "none"),
        (v1(25000), Level.PROBLEM, "0.5 processors in each 50 ms"),
        ({}, Level.UNKNOWN, "/proc/self/cgroup cannot be read"),
    ],
)
def test_quota_levels(plant, files, level, found):
    finding = quota(plant(files))
    assert finding.level is level
    assert finding.found.startswith(found)
    bad = level not in (Level.OK, Level.UNKNOWN)
    assert finding.mend == (mends.QUOTA_UNIT if bad else "")
    if level is Level.WARNING and "4 processors" in found:
        assert "throttled 7 times" in finding.found


def test_the_tightest_of_nested_quotas_counts(plant):
    files = {**v2("400000 100000"), "/sys/fs/cgroup/a/b/cpu.max": "20000 100000\n"}
    finding = quota(plant({**files, "/.dockerenv": ""}))
    assert finding.found.startswith("0.2 processors in each 100 ms (/sys/fs/cgroup/a/b)")
    assert finding.mend == mends.QUOTA_CONTAINER


def test_stolen_time_is_read_and_guest_time_is_not_counted_twice(plant):
    tree = plant({"/proc/stat": "cpu  100 20 30 800 5 1 4 40 90 9\ncpu0 1 2 3\n"})
    assert stolen(tree) == Stolen(1000, 40)


@pytest.mark.parametrize(
    "text", ["cpu  1 2 3 4\n", "cpu  1 2 3 4 5 6 7\n", "\nintr 5\n", "cpu0 1 2 3 4 5 6 7 8\n", ""]
)
def test_a_kernel_that_tells_no_stolen_time(plant, text):
    assert stolen(plant({"/proc/stat": text})) is None


@pytest.mark.parametrize(
    ("before", "after", "level", "found"),
    [
        (Stolen(10000, 0), Stolen(20000, 0), Level.OK, "0.00% while watched, 0.00% since"),
        (Stolen(10000, 1), Stolen(20000, 10), Level.OK, "0.09% while watched"),
        (Stolen(10000, 0), Stolen(20000, 20), Level.ADVICE, "0.20% while watched, 0.10% since"),
        (Stolen(10000, 200), Stolen(20000, 200), Level.WARNING, "0.00% while watched, 1.00%"),
        (Stolen(1000000, 0), Stolen(1001000, 20), Level.WARNING, "2.00% while watched"),
        (Stolen(1000000, 0), Stolen(1001000, 60), Level.PROBLEM, "6.00% while watched"),
        (Stolen(1000, 0), Stolen(1000, 0), Level.OK, "0.00% while watched"),
        (Stolen(0, 0), Stolen(0, 0), Level.UNKNOWN, "/proc/stat tells no stolen time"),
        (None, Stolen(1000, 0), Level.UNKNOWN, "/proc/stat tells no stolen time"),
        (Stolen(1000, 0), None, Level.UNKNOWN, "/proc/stat tells no stolen time"),
    ],
)
def test_steal_levels(before, after, level, found):
    finding = steal_time(before, after)
    assert finding.level is level
    bad = level not in (Level.OK, Level.UNKNOWN)
    assert bool(finding.mend) == bad
    assert ("nothing in this machine mends" in finding.means) == bad
    assert finding.found.startswith(found)
