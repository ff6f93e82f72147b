"""The commands that mend a machine; deploy/realtime.md shows the same ones."""

from __future__ import annotations

from typing import Final

REALTIME_USER: Final = (
    'printf "$USER - rtprio 60\\n$USER - nice -10\\n" | '
    "sudo tee -a /etc/security/limits.d/motionserver.conf"
)
"""Then log in again."""
REALTIME_SOFT: Final = "ulimit -r 50"
REALTIME_CONTAINER: Final = "docker run --ulimit rtprio=60 --cap-add SYS_NICE"
REALTIME_GROUP: Final = "docker run --cpu-rt-runtime=400000"
THROTTLE: Final = "sudo sysctl -w kernel.sched_rt_runtime_us=950000"
GOVERNOR: Final = (
    "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
)
SWAP: Final = "sudo swapoff -a"
HUGE_PAGES: Final = "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled"
QUOTA_UNIT: Final = "sudo systemctl set-property motionserver.service CPUQuota="
QUOTA_CONTAINER: Final = "docker update --cpu-quota -1 CONTAINER"
RECEIVE_BUFFER: Final = "sudo sysctl -w net.core.rmem_max=212992"
LOW_PORTS: Final = "sudo sysctl -w net.ipv4.ip_unprivileged_port_start={port}"
CLOCK: Final = "sudo timedatectl set-ntp true"
CLOCK_SOURCE: Final = (
    "echo {source} | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"
)
OPEN_FILES: Final = "ulimit -n 4096"
KERNEL_LOG: Final = "sudo dmesg --ctime --level=err,warn"
RUN_DIR: Final = "export MOTIONSERVER_SERVER__RUN_DIR=/dev/shm/motionserver"
LOOK_LONGER: Final = "motionserver bench loop --seconds 60"

MACHINE_WIDE: Final = (
    REALTIME_USER, REALTIME_SOFT, REALTIME_CONTAINER, REALTIME_GROUP, THROTTLE, GOVERNOR, SWAP,
    HUGE_PAGES, QUOTA_UNIT, QUOTA_CONTAINER, RECEIVE_BUFFER, LOW_PORTS.format(port=991), CLOCK,
    CLOCK_SOURCE.format(source="tsc"), OPEN_FILES, KERNEL_LOG, RUN_DIR, LOOK_LONGER,
)  # fmt: skip
"""All of them, as the page shows them."""
