"""Reading a machine: what is there is read exactly, what is not is None."""

import os
from pathlib import Path

import pytest

from motionserver.doctor.finding import Finding, Level, unknown, worst
from motionserver.doctor.tree import INFINITE, Limit, Mount, Tree

LIMITS = """\
Limit                     Soft Limit           Hard Limit           Units
Max locked memory         8388608              unlimited            bytes
Max open files            1024                 524288               files
Max realtime priority     0                    95
Max nice priority         nonsense             0
"""
MOUNTS = """\
27 1 254:0 / / rw,relatime - ext4 /dev/vda rw
28 27 0:30 / /run rw,nosuid - tmpfs tmpfs rw,size=4k
29 28 0:31 / /run/lock ro,nosuid shared:5 - tmpfs tmpfs rw
30 27 0:32 / /mnt/two\\040words rw - nfs4 server:/x rw
31 27 0:33 / /twice rw - ext4 /dev/vdb rw
32 31 0:34 / /twice rw - tmpfs tmpfs rw
broken line
"""


def test_text_and_numbers(plant):
    tree = plant({"/proc/a": " 12\n", "/proc/b": "word\n", "/proc/c": "x\ny\n"})
    assert tree.number("/proc/a") == 12
    assert tree.number("/proc/b") is None
    assert tree.number("/proc/none") is None
    assert tree.lines("/proc/c") == ["x", "y"]
    assert tree.text("/proc") is None
    assert tree.glob("/proc/[ab]") == ["/proc/a", "/proc/b"]


def test_limits(plant):
    tree = plant({"/proc/self/limits": LIMITS})
    assert tree.limit("Max locked memory") == Limit(8388608, INFINITE)
    assert tree.limit("Max realtime priority") == Limit(0, 95)
    assert tree.limit("Max nice priority") is None
    assert tree.limit("Max anything") is None
    assert Tree(tree.root / "none").limit("Max open files") is None


@pytest.mark.parametrize(
    ("mask", "nice", "lock", "bind"),
    [
        ("0000000000000000", False, False, False),
        ("0000000000800000", True, False, False),
        ("0000000000004000", False, True, False),
        ("0000000000000400", False, False, True),
        ("000001fffeffffff", True, True, True),
    ],
)
def test_capabilities(plant, mask, nice, lock, bind):
    tree = plant({"/proc/self/status": f"CapPrm:\t000001fffeffffff\nCapEff:\t{mask}\n"})
    assert tree.may("CAP_SYS_NICE") is nice
    assert tree.may("CAP_IPC_LOCK") is lock
    assert tree.may("CAP_NET_BIND_SERVICE") is bind


def test_capabilities_that_cannot_be_read(plant):
    assert plant({}).may("CAP_SYS_NICE") is None


@pytest.mark.parametrize(
    ("path", "kind", "read_only"),
    [
        ("/srv/x", "ext4", False),
        ("/run/motionserver", "tmpfs", False),
        ("/runner", "ext4", False),
        ("/run/lock/x", "tmpfs", True),
        ("/mnt/two words/x", "nfs4", False),
        ("/twice", "tmpfs", False),
    ],
)
def test_the_mount_of_a_path(plant, path, kind, read_only):
    mount = plant({"/proc/self/mountinfo": MOUNTS}).mount_of(Path(path))
    assert isinstance(mount, Mount)
    assert (mount.kind, mount.read_only) == (kind, read_only)


def test_no_mount_table(plant):
    assert plant({}).mount_of(Path("/")) is None


def test_control_groups_of_both_versions(plant):
    tree = plant(
        {
            "/proc/self/cgroup": "7:cpu,cpuacct:/a/b\n5:memory:/m\n0::/u/v\nbroken\n",
            "/sys/fs/cgroup/cpu,cpuacct/a/b/x": "",
            "/sys/fs/cgroup/u/x": "",
        }
    )
    assert list(tree.groups("cpu")) == [
        "/sys/fs/cgroup/cpu,cpuacct/a/b",
        "/sys/fs/cgroup/cpu,cpuacct/a",
        "/sys/fs/cgroup/cpu,cpuacct",
        "/sys/fs/cgroup/u",
        "/sys/fs/cgroup",
    ]


def test_a_path_out_of_the_tree_stays_in_it(plant):
    tree = plant({"/proc/self/cgroup": "0::/../..\n", "/sys/fs/cgroup/x": ""})
    assert list(tree.groups("cpu")) == ["/sys/fs/cgroup"]


def test_a_log_is_read_without_waiting_for_more(tmp_path):
    (tmp_path / "dev").mkdir()
    os.mkfifo(tmp_path / "dev/kmsg")
    reader = os.open(tmp_path / "dev/kmsg", os.O_RDONLY | os.O_NONBLOCK)
    writer = os.open(tmp_path / "dev/kmsg", os.O_WRONLY)
    try:
        os.write(writer, b"6,1,0,-;one\n6,2,0,-;two\n")
        assert Tree(tmp_path).log("/dev/kmsg") == ["6,1,0,-;one", "6,2,0,-;two"]
    finally:
        os.close(writer)
        os.close(reader)
    assert Tree(tmp_path / "none").log("/dev/kmsg") is None
    assert Tree(tmp_path).log("/dev") is None


@pytest.mark.parametrize("mark", ["/.dockerenv", "/run/.containerenv", "/run/systemd/container"])
def test_marks_of_a_container(plant, mark):
    assert not plant({}).is_container()
    assert plant({mark: ""}).is_container()


def test_levels_are_ordered_and_the_worst_counts():
    assert [level.rank for level in Level] == [0, 1, 2, 3, 4]
    assert worst([]) is Level.OK
    mixed = [Finding("a", Level.ADVICE, "", ""), Finding("b", Level.PROBLEM, "", "")]
    assert worst(mixed) is Level.PROBLEM
    assert worst([*mixed[:1], unknown("c", "hidden")]) is Level.ADVICE
    assert unknown("c", "hidden").to_mapping() == {
        "name": "c",
        "level": "unknown",
        "found": "hidden",
        "means": "nothing is claimed about it",
        "mend": "",
    }
