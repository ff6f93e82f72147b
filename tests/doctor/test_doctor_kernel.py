"""The kernel's settings and complaints, in every level."""

import pytest

from motionserver.doctor import mends
from motionserver.doctor.finding import Level
from motionserver.doctor.kernel import clock_source, huge_pages, kernel_log, open_files, swap

SOURCE = "/sys/devices/system/clocksource/clocksource0"


@pytest.mark.parametrize(
    ("source", "others", "level", "mend"),
    [
        ("tsc", "tsc hpet", Level.OK, ""),
        ("kvm-clock", "tsc kvm-clock", Level.OK, ""),
        ("arch_sys_counter", "", Level.OK, ""),
        ("hpet", "tsc hpet acpi_pm", Level.WARNING, mends.CLOCK_SOURCE.format(source="tsc")),
        ("acpi_pm", "hpet acpi_pm", Level.WARNING, "boot with tsc=reliable"),
        ("jiffies", "jiffies", Level.PROBLEM, "boot with tsc=reliable"),
        ("refined-jiffies", "kvm-clock", Level.PROBLEM, "echo kvm-clock | sudo tee"),
        ("sundial", "", Level.UNKNOWN, ""),
        (None, "", Level.UNKNOWN, ""),
    ],
)
def test_clock_source_levels(plant, source, others, level, mend):
    files = {f"{SOURCE}/available_clocksource": others}
    if source is not None:
        files[f"{SOURCE}/current_clocksource"] = f"{source}\n"
    finding = clock_source(plant(files))
    assert finding.level is level
    assert finding.mend.startswith(mend)
    assert bool(finding.mend) == bool(mend)


@pytest.mark.parametrize(
    ("text", "level", "found"),
    [
        ("[always] madvise never", Level.ADVICE, "always"),
        ("always [madvise] never", Level.OK, "madvise"),
        ("always madvise [never]", Level.OK, "never"),
        ("", Level.UNKNOWN, "the kernel does not tell"),
        (None, Level.UNKNOWN, "the kernel does not tell"),
    ],
)
def test_huge_page_levels(plant, text, level, found):
    path = "/sys/kernel/mm/transparent_hugepage/enabled"
    finding = huge_pages(plant({} if text is None else {path: text}))
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend == (mends.HUGE_PAGES if level is Level.ADVICE else "")


HEAD = "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n"


@pytest.mark.parametrize(
    ("text", "level", "found"),
    [
        (HEAD, Level.OK, "none"),
        (HEAD + "/dev/sda2 partition 8388608 0 -2\n", Level.ADVICE, "0.00 of 8.00 GiB in use"),
        (
            HEAD + "/dev/sda2 partition 8388608 524288 -2\n/swap file 1048576 1048576 -3\n",
            Level.WARNING,
            "1.50 of 9.00 GiB in use",
        ),
        (None, Level.UNKNOWN, "/proc/swaps cannot be read"),
    ],
)
def test_swap_levels(plant, text, level, found):
    finding = swap(plant({} if text is None else {"/proc/swaps": text}))
    assert (finding.level, finding.found) == (level, found)
    assert finding.mend == (mends.SWAP if level in (Level.ADVICE, Level.WARNING) else "")


@pytest.mark.parametrize(
    ("soft", "level"),
    [
        ("unlimited", Level.OK),
        ("1024", Level.OK),
        ("1023", Level.WARNING),
        ("256", Level.WARNING),
        ("255", Level.PROBLEM),
        (None, Level.UNKNOWN),
    ],
)
def test_open_file_levels(plant, soft, level):
    line = f"Max open files            {soft}                 4096               files\n"
    finding = open_files(plant({} if soft is None else {"/proc/self/limits": line}))
    assert finding.level is level
    bad = level in (Level.WARNING, Level.PROBLEM)
    assert finding.mend == (mends.OPEN_FILES if bad else "")
    assert finding.found.startswith(soft or "/proc/self/limits")
    assert ("hard 4096" in finding.found) == (soft not in (None, "unlimited"))


@pytest.mark.parametrize(
    ("lines", "level", "found"),
    [
        (["6,1,0,-;Linux version 6.1"], Level.OK, "none in 1 lines of its log"),
        ([], Level.OK, "none in 0 lines of its log"),
        (
            ["0,5,9,-;watchdog: BUG: soft lockup - CPU#1 stuck for 23s! [python:12]"],
            Level.PROBLEM,
            "1 since the boot: soft lockup - CPU#1 stuck for 23s; the longest 23 s",
        ),
        (
            ["3,5,9,-;rcu: INFO: rcu_preempt self-detected stall on CPU"],
            Level.WARNING,
            "1 since the boot: rcu: INFO: rcu_preempt self-detected stall",
        ),
        (
            ["4,5,9,-;sched: RT throttling activated"],
            Level.WARNING,
            "1 since the boot: RT throttling activated",
        ),
        (
            ["4,5,9,-;clocksource: timekeeping watchdog on CPU0: Marking clocksource 'tsc' as "
             "unstable because the skew is too large:"],
            Level.WARNING,
            "1 since the boot: clocksource: timekeeping watchdog on CPU0: Marking",
        ),
        (
            ["4,5,9,-;hrtimer: interrupt took 8400000 ns"] * 2,
            Level.ADVICE,
            "2 since the boot: hrtimer: interrupt took 8400000 ns; the longest 0.0084 s",
        ),
        (
            ["3,5,9,-;INFO: task kworker/0:1:33 blocked for more than 120 seconds."],
            Level.ADVICE,
            "1 since the boot: blocked for more than 120 seconds; the longest 120 s",
        ),
        (
            [f"4,5,9,-;hrtimer: interrupt took {n} ns" for n in (1, 2, 3_000_000)],
            Level.ADVICE,
            "3 since the boot: hrtimer: interrupt took 1 ns; hrtimer: interrupt took 2 ns; "
            "hrtimer: interrupt took 3000000 ns; the longest 0.003 s",
        ),
        (
            [f"4,5,9,-;hrtimer: interrupt took {n} ns" for n in (1, 2, 3, 4, 9_000_000)]
            + ["4,6,9,-;sched: RT throttling activated"],
            Level.WARNING,
            "6 since the boot: hrtimer: interrupt took 1 ns; hrtimer: interrupt took 2 ns; "
            "hrtimer: interrupt took 3 ns and 3 others; the longest 0.009 s",
        ),
    ],
)  # fmt: skip
def test_kernel_log_levels(plant, lines, level, found):
    finding = kernel_log(plant({"/dev/kmsg": "\n".join(lines)}))
    assert finding.level is level
    assert finding.found.startswith(found)
    assert finding.mend == ("" if level is Level.OK else mends.KERNEL_LOG)


def test_what_the_worst_complaint_means_is_said(plant):
    log = "4,1,9,-;hrtimer: interrupt took 9 ns\n4,2,9,-;sched: RT throttling activated\n"
    assert "used their share up" in kernel_log(plant({"/dev/kmsg": log})).means


def test_a_log_that_is_not_open_is_unknown(plant):
    finding = kernel_log(plant({}))
    assert finding.level is Level.UNKNOWN
    assert finding.mend == mends.KERNEL_LOG
