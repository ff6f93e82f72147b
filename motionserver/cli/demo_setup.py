"""The demo's configuration: everything on loopback, everything it leaves in one folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def demo_config(
    folder: Path, algorithm: str, base: int, inputs: tuple[int, int], page: int | None
) -> dict[str, Any]:
    """What stands in for a configuration file.

    Args:
        folder: For all that is written.
        algorithm: What drives at the start.
        base: UDP port of the emulated base.
        inputs: UDP ports of the simulator and of the accelerometer on the platform.
        page: TCP port of the page; None for none.
    """
    cue, imu = inputs
    web: dict[str, Any] = {"enabled": page is not None, "tokens_file": str(folder / "tokens.json")}
    return {
        "server": {"run_dir": str(folder / "run"), "state_dir": str(folder / "state")},
        "platform": {"port": base, "local_port": 0},
        "sources": [
            {"kind": "native", "listen": f"127.0.0.1:{cue}"},
            {"kind": "imu", "listen": f"127.0.0.1:{imu}"},
        ],
        "cueing": {"algorithm": algorithm},
        "operator": {"engage": "http"},
        "web": web if page is None else web | {"port": page},
    }
