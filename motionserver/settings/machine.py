"""Machines from TOML: shipped presets and files of the user's own."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.core.axes import AXIS_NAMES, frozen
from motionserver.core.kinematics.hexapod import neutral_conditioning
from motionserver.core.limits import Machine, Pace
from motionserver.core.safety.verify import GUARD_MARGINS, check_ways_home
from motionserver.errors import ConfigError
from motionserver.settings.problems import config_error, read_toml

PACE_SHARE = 0.9
"""Most of a leg limit that raising and parking may use: a move must pass the same check."""
Metre = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-20.0, le=20.0)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=1e4)]
Point = tuple[Metre, Metre, Metre]
Joints = tuple[Point, Point, Point, Point, Point, Point]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _Legs(_Strict):
    min: Positive
    max: Positive
    speed: Positive
    acceleration: Positive
    jerk: Positive | None = None


class _Parked(_Strict):
    heave: Metre = 0.0


class _Workspace(_Strict):
    joint_angle_deg: Annotated[float, Field(strict=True, gt=0.0, le=90.0)] | None = None
    conditioning: Annotated[float, Field(strict=True, gt=0.0, lt=1.0)] | None = None
    passenger_acceleration: Positive | None = None
    parked: _Parked


class _Box(_Strict):
    surge: Positive
    sway: Positive
    heave: Positive
    roll_deg: Annotated[float, Field(strict=True, gt=0.0, lt=80.0)]
    pitch_deg: Annotated[float, Field(strict=True, gt=0.0, lt=80.0)]
    yaw_deg: Annotated[float, Field(strict=True, gt=0.0, lt=80.0)]


class _Pace(_Strict):
    speed: Positive
    acceleration: Positive
    jerk: Positive


class _MachineFile(_Strict):
    name: Annotated[str, Field(min_length=1, max_length=60)]
    neutral_height: Positive
    base_joints: Joints
    platform_joints: Joints
    head: Point = (0.0, 0.0, 0.0)
    legs: _Legs
    workspace: _Workspace
    table2: _Box
    pace: _Pace


def machine_presets() -> list[str]:
    """Names of the shipped machines."""
    folder = files("motionserver.presets") / "platforms"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_machine(name: str) -> Machine:
    """Load a shipped preset by name, or a file by its path (anything that ends in .toml).

    Raises:
        ConfigError: It does not exist, a value is wrong, or the machine contradicts itself.
    """
    path = Path(name)
    if name.endswith(".toml"):
        try:
            text = read_bounded_text(path, SETTINGS_BYTES)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "not UTF-8 text, or no path"
            raise ConfigError(
                name, f"cannot be read ({why})", "Give the path of a machine file."
            ) from error
    elif name in machine_presets():
        path = Path(f"{name}.toml")
        text = (files("motionserver.presets") / "platforms" / path.name).read_text("utf-8")
    else:
        raise ConfigError(
            "[platform] preset",
            f"unknown preset {name!r}",
            f"Allowed: {', '.join(machine_presets())}, or the path of a .toml file.",
        )
    return parse_machine(text, path)


def parse_machine(text: str, path: Path) -> Machine:
    """Read the text of a machine file.

    Raises:
        ConfigError: As `load_machine`.
    """
    try:
        data = _MachineFile.model_validate(read_toml(text, str(path)))
    except ValidationError as error:
        raise config_error(error, path, text, _MachineFile) from error
    angle = data.workspace.joint_angle_deg
    box = data.table2
    machine = Machine(
        name=data.name,
        base_joints=frozen(data.base_joints),
        platform_joints=frozen(data.platform_joints),
        neutral_height=data.neutral_height,
        leg_min=data.legs.min,
        leg_max=data.legs.max,
        leg_speed=data.legs.speed,
        leg_acceleration=data.legs.acceleration,
        leg_jerk=data.legs.jerk,
        joint_angle=None if angle is None else float(np.radians(angle)),
        conditioning=data.workspace.conditioning,
        passenger_acceleration=data.workspace.passenger_acceleration,
        head=frozen(data.head),
        parked_pose=frozen([0.0, 0.0, data.workspace.parked.heave, 0.0, 0.0, 0.0]),
        box=frozen(
            [
                box.surge,
                box.sway,
                box.heave,
                *np.radians([box.roll_deg, box.pitch_deg, box.yaw_deg]),
            ]
        ),
        pace=Pace(data.pace.speed, data.pace.acceleration, data.pace.jerk),
    )
    _check(machine, path)
    return machine


def _check(machine: Machine, path: Path) -> None:
    if machine.leg_min >= machine.leg_max:
        raise ConfigError(
            f"{path}: legs.min", "not shorter than legs.max", "Give the two ends of the stroke."
        )
    if neutral_conditioning(machine) < 1e-3:
        raise ConfigError(
            f"{path}: platform_joints",
            "the hexapod is singular at neutral",
            "Check the joints' order: leg i joins base joint i and platform joint i.",
        )
    for what, start in (("neutral", np.zeros(6)), ("workspace.parked", machine.parked_pose)):
        homes = np.stack((np.zeros(6), machine.parked_pose))
        rejection = check_ways_home(machine, start, homes, GUARD_MARGINS)
        if rejection is not None:
            raise ConfigError(
                f"{path}: {what}",
                f"no allowed straight way between neutral and the parked pose ({rejection})",
                "Check neutral_height, the joints, legs.min, legs.max and workspace.parked.",
            )
    for what, pace, limit in (
        ("speed", machine.pace.speed, machine.leg_speed),
        ("acceleration", machine.pace.acceleration, machine.leg_acceleration),
        ("jerk", machine.pace.jerk, machine.leg_jerk),
    ):
        if limit is not None and pace > PACE_SHARE * limit:
            raise ConfigError(
                f"{path}: pace.{what}",
                f"{pace:g} is more than {PACE_SHARE:.0%} of the legs' own limit {limit:g}",
                f"Raise and park more gently: at most {PACE_SHARE * limit:g}.",
            )


def unchecked_limits(machine: Machine) -> list[str]:
    """Names of limits that the machine's file does not state, so that nobody checks them."""
    names = {
        "leg jerk": machine.leg_jerk,
        "joint angle": machine.joint_angle,
        "conditioning": machine.conditioning,
        "passenger acceleration": machine.passenger_acceleration,
    }
    return [name for name, value in names.items() if value is None]


def describe_pose(pose: np.ndarray) -> str:
    """A pose in millimetres and degrees, for people."""
    parts = [f"{n} {v * 1e3:+.1f} mm" for n, v in zip(AXIS_NAMES[:3], pose[:3], strict=True)]
    parts += [
        f"{n} {np.degrees(v):+.2f} deg" for n, v in zip(AXIS_NAMES[3:], pose[3:], strict=True)
    ]
    return ", ".join(parts)
