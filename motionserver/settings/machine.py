"""Machines from TOML: shipped presets and files of the user's own."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.core.axes import AXIS_NAMES, Array, frozen
from motionserver.core.kinematics.reach import single_axis_reach
from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.settings.machine_file import Complaint, MachineFile
from motionserver.settings.machine_sense import first_complaint
from motionserver.settings.machine_slips import likely_slip, names_of
from motionserver.settings.problems import config_error, place_in_file, read_toml


class MachineAsRead(NamedTuple):
    """A machine, and what its file leaves open.

    Attributes:
        machine: Geometry and limits.
        box_is_computed: True if the file has no [table2]; the box is then what each axis reaches.
        reach: What each axis reaches alone to its nearer side, (6,) [m, rad].
    """

    machine: Machine
    box_is_computed: bool
    reach: Array


_SMALLEST, _LARGEST = 0.4, 1.5
"""Box as a share of what the machine reaches, beyond which it is worth a warning."""


def machine_presets() -> list[str]:
    """Names of the shipped machines."""
    folder = files("motionserver.presets") / "platforms"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_machine(name: str) -> Machine:
    """Load a shipped preset by name, or a file by its path (anything that ends in .toml).

    Raises:
        ConfigError: It does not exist, a value is wrong, or the machine contradicts itself.
    """
    return read_machine(name).machine


def read_machine(name: str) -> MachineAsRead:
    """As `load_machine`, with what there is to say about the file.

    Raises:
        ConfigError: As `load_machine`.
    """
    path = Path(os.path.expanduser(name))
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
    return read_machine_text(text, path)


def parse_machine(text: str, path: Path) -> Machine:
    """Read the text of a machine file.

    Raises:
        ConfigError: As `load_machine`.
    """
    return read_machine_text(text, path).machine


def read_machine_text(text: str, path: Path) -> MachineAsRead:
    """Read the text of a machine file, and what there is to say about it.

    Raises:
        ConfigError: As `load_machine`.
    """
    try:
        data = MachineFile.model_validate(read_toml(text, str(path)))
    except ValidationError as error:
        raise config_error(error, path, text, MachineFile) from error
    complaint = first_complaint(data)
    if complaint is not None:
        raise _refused(data, complaint, None, path, text)
    bare = data.to_machine(np.ones(6))
    reach = single_axis_reach(bare)
    complaint = first_complaint(data, reach)
    if complaint is not None:
        raise _refused(data, complaint, reach, path, text)
    box = reach if data.table2 is None else data.table2.to_si()
    return MachineAsRead(data.to_machine(frozen(box)), data.table2 is None, frozen(reach))


def _refused(
    data: MachineFile, complaint: Complaint, reach: Array | None, path: Path, text: str
) -> ConfigError:
    slip = None if complaint.is_plain else likely_slip(data, complaint, reach)
    place = complaint.place if slip is None else slip.place
    what = complaint.what
    if slip is not None and names_of(place) != names_of(complaint.place):
        what = f"{'.'.join(map(str, complaint.place))}: {what}"
    do = complaint.do
    if slip is not None:
        words = slip.words.capitalize() if slip.words.startswith(("in ", "all ")) else slip.words
        do = f"{words} {slip.do}{f' Or: {do}' if complaint.is_open else ''}"
    return ConfigError(place_in_file(path, text, place), what, do)


def box_as_toml(box: Array) -> str:
    """A box (6,) [m, rad] as it stands in a machine file, on one line."""
    values = [f"{name} = {value:.4g}" for name, value in zip(AXIS_NAMES[:3], box[:3], strict=True)]
    degrees = zip(AXIS_NAMES[3:], np.degrees(box[3:]), strict=True)
    values += [f"{name}_deg = {value:.4g}" for name, value in degrees]
    return f"table2 = {{ {', '.join(values)} }}"


def box_warning(read: MachineAsRead) -> str | None:
    """What is to be said of a box out of proportion to what the machine reaches; None if nothing.

    It is refused nowhere: somebody may want less, and the legs cut down whatever asks for more.
    """
    found = []
    for axis, name in enumerate(AXIS_NAMES):
        box, reach = float(read.machine.box[axis]), float(read.reach[axis])
        if _SMALLEST <= box / max(reach, 1e-9) <= _LARGEST:
            continue
        shown = (box, reach, "m") if axis < 3 else (np.degrees(box), np.degrees(reach), "deg")
        times = f"{box / max(reach, 1e-9):.2g} times"
        found.append(f"{name} {shown[0]:.4g} {shown[2]}, reached {shown[1]:.4g} ({times})")
    if not found:
        return None
    return (
        f"[table2] of {read.machine.name} is out of proportion to what each axis reaches alone: "
        f"{'; '.join(found)}. Write {box_as_toml(read.reach)}, or leave [table2] out"
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
