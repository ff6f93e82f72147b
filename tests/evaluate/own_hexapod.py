"""Hexapod kinematics of the tests' own: nothing of the server's is used to judge the server."""

import tomllib
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT / "clients" / "motion_clients" / "recordings"
T2_COMPACT = tomllib.loads(
    (ROOT / "motionserver" / "presets" / "platforms" / "t2-compact.toml").read_text()
)


def own_legs(pose):
    """Pin-to-pin lengths (N, 6) of poses (N, 6), from the machine's file and scipy."""
    base = np.array(T2_COMPACT["base_joints"])
    top = np.array(T2_COMPACT["platform_joints"])
    turn = Rotation.from_euler("ZYX", pose[:, [5, 4, 3]])
    legs = np.empty((len(pose), 6))
    for leg in range(6):
        pin = pose[:, :3] + turn.apply(top[leg]) - base[leg]
        pin[:, 2] += T2_COMPACT["neutral_height"]
        legs[:, leg] = np.linalg.norm(pin, axis=1)
    return legs


def own_violations(pose, rate):
    """Samples beyond stroke, leg speed, acceleration or jerk, by name."""
    limits, legs = T2_COMPACT["legs"], own_legs(pose)
    out = {"stroke": int(np.sum((legs < limits["min"]) | (legs > limits["max"])))}
    for order, name in ((1, "speed"), (2, "acceleration"), (3, "jerk")):
        moved = np.abs(np.diff(legs, order, axis=0)) * rate**order
        out[name] = int(np.sum(moved > limits[name]))
    return out


NO_VIOLATIONS = {"stroke": 0, "speed": 0, "acceleration": 0, "jerk": 0}
