import tomllib
from importlib.resources import files
from math import radians

import numpy as np
import pytest

from motionserver.core.axes import frozen
from motionserver.core.limits import Machine, Pace


@pytest.fixture(scope="session")
def machine():
    text = files("motionserver.presets").joinpath("platforms/t2-compact.toml").read_text()
    data = tomllib.loads(text)
    legs, space, box, pace = (data[key] for key in ("legs", "workspace", "table2", "pace"))
    return Machine(
        name=data["name"],
        base_joints=frozen(data["base_joints"]),
        platform_joints=frozen(data["platform_joints"]),
        neutral_height=data["neutral_height"],
        leg_min=legs["min"],
        leg_max=legs["max"],
        leg_speed=legs["speed"],
        leg_acceleration=legs["acceleration"],
        leg_jerk=legs["jerk"],
        joint_angle=radians(space["joint_angle_deg"]),
        conditioning=space["conditioning"],
        passenger_acceleration=None,
        head=frozen(data["head"]),
        parked_pose=frozen([0.0, 0.0, space["parked"]["heave"], 0.0, 0.0, 0.0]),
        box=frozen(
            [
                box["surge"],
                box["sway"],
                box["heave"],
                *np.radians([box["roll_deg"], box["pitch_deg"], box["yaw_deg"]]),
            ]
        ),
        pace=Pace(pace["speed"], pace["acceleration"], pace["jerk"]),
    )
