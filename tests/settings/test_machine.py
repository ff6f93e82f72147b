import json
from dataclasses import fields, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from machines import compact, science_fit

from motionserver.core.limits import machine_from_mapping, machine_to_mapping
from motionserver.errors import ConfigError
from motionserver.settings.machine import (
    describe_pose,
    load_machine,
    machine_presets,
    parse_machine,
    unchecked_limits,
)

TEXT = (files("motionserver.presets") / "platforms" / "t2-compact.toml").read_text("utf-8")


def wrong(old, new):
    assert TEXT.count(old) == 1, old
    changed = TEXT.replace(old, new)
    with pytest.raises(ConfigError) as caught:
        parse_machine(changed, Path("m.toml"))
    line = changed[: changed.index(new)].count("\n") + 1 if new else 0
    return str(caught.value), line


def test_the_preset_is_what_it_says():
    machine = load_machine("t2-compact")
    assert "t2-compact" in machine_presets()
    assert (machine.leg_min, machine.leg_max, machine.leg_speed) == (0.9022, 1.1811, 0.6)
    assert machine.joint_angle == pytest.approx(np.pi / 4)
    assert machine.parked_pose.tolist() == [0, 0, -0.17, 0, 0, 0]
    assert machine.box[3:] == pytest.approx(np.radians([17.5, 16.3, 17.5]))
    assert unchecked_limits(machine) == ["passenger acceleration"]
    assert "leg jerk" in unchecked_limits(science_fit())


@pytest.mark.parametrize(
    ("old", "new", "key", "what"),
    [
        ("min = 0.9022", "min = 902.2", "legs.min", "not shorter"),
        ("max = 1.1811", "max = -1.0", "legs.max", "greater than 0"),
        ("speed = 0.6", "speed = inf", "legs.speed", "finite"),
        ("speed = 0.15", "speed = -0.15", "pace.speed", "greater than 0"),
        ("jerk = 2.0", "jerk = nan", "pace.jerk", "found nan"),
        ("speed = 0.15", "speed = 0.541", "pace.speed", "at most 0.54"),
        ("acceleration = 0.5", "acceleration = 7.3", "pace.acceleration", "at most 7.2"),
        ("jerk = 2.0", "jerk = 181.0", "pace.jerk", "at most 180"),
        ("jerk = 2.0", "jork = 2.0", "pace.jork", "'jerk'"),
        ("jerk = 2.0", "", "pace.jerk", "required"),
        ("joint_angle_deg = 45.0", "joint_angle_deg = 95", "workspace.joint_angle_deg", "90"),
        ("joint_angle_deg = 45.0", "joint_angle = 0.7", "workspace.joint_angle", "_deg'"),
        ("conditioning = 0.30", "conditioning = 1.0", "workspace.conditioning", "less than 1"),
        ("joint_angle_deg = 45.0", "joint_angle_deg = true", "workspace.joint", "valid number"),
        ("roll_deg = 17.5", "roll_deg = true", "table2.roll_deg", "valid number"),
        ("surge = 0.198", "surge = 0", "table2.surge", "greater than 0"),
        ("roll_deg = 17.5", "roll_deg = 80", "table2.roll_deg", "less than 80"),
        ("roll_deg = 17.5", "roll = 0.3", "table2.roll", "'roll_deg'"),
        ("heave = -0.17", "heave = -170", "workspace.parked.heave", "-20"),
        ('name = "t2-compact"', 'name = ""', "name", "at least 1"),
        ("head = [0.0, 0.0, 0.0]", "head = [0.0, 0.0]", "head.2", "required"),
        ("neutral_height = 1.0271", "neutral_height = true", "neutral_height", "valid number"),
        ("[pace] ", "[peace] ", "peace", "'pace'"),
    ],
)
def test_what_is_wrong_is_told(old, new, key, what):
    found, _ = wrong(old, new)
    assert "m.toml" in found
    assert f": {key}" in found
    assert what in found


def test_the_line_is_the_one_of_its_own_section():
    for old, new in (
        ("speed = 0.15", "speed = -0.15"),
        ("jerk = 2.0", "jerk = nan"),
        ("max = 1.1811", "max = -1.0"),
        ("surge = 0.198", "surge = 0"),
        ("heave = -0.17", "heave = -170"),
        ("head = [0.0, 0.0, 0.0]", "head = [0.0, 0.0, 99.0]"),
    ):
        found, line = wrong(old, new)
        assert f"m.toml:{line}: " in found


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("neutral_height = 1.0271", "neutral_height = 1.4", "no allowed straight way"),
        ("heave = -0.17", "heave = -0.4", "no allowed straight way"),
        ("min = 0.9022", "min = 1.2", "not shorter"),
    ],
)
def test_a_machine_that_contradicts_itself(old, new, what):
    assert what in wrong(old, new)[0]


def test_a_singular_machine():
    same = "\n".join(["  [0.5, 0.5, -0.3],"] * 6)
    start, end = TEXT.index("platform_joints = ["), TEXT.index("head =")
    with pytest.raises(ConfigError, match="singular"):
        parse_machine(
            TEXT[:start] + f"platform_joints = [\n{same}\n]\n" + TEXT[end:], Path("m.toml")
        )


def test_files(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TEXT)
    assert load_machine(str(path)).digest == compact().digest
    with pytest.raises(ConfigError, match="cannot be read"):
        load_machine(str(tmp_path / "none.toml"))
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="not UTF-8"):
        load_machine(str(path))
    path.write_text("name =")
    with pytest.raises(ConfigError, match="not TOML"):
        load_machine(str(path))
    with pytest.raises(ConfigError, match=r"unknown preset 'moog'.*t2-compact"):
        load_machine("moog")


def test_every_limit_is_in_the_digest():
    machine = science_fit()
    seen = {machine.digest, machine.with_head(machine.head + 0.1).digest}
    for field in fields(machine):
        value = getattr(machine, field.name)
        if isinstance(value, np.ndarray):
            other = value + 1e-12
        elif field.name == "pace":
            other = replace(value, jerk=9.0)
        elif isinstance(value, str):
            other = "other"
        else:
            other = (value or 0.0) + 1e-12
        seen.add(replace(machine, **{field.name: other}).digest)
    assert len(seen) == len(fields(machine)) + 2


@pytest.mark.parametrize("machine", [compact(), science_fit()], ids=lambda m: m.name)
def test_a_machine_travels_as_json(machine):
    back = machine_from_mapping(json.loads(json.dumps(machine_to_mapping(machine))))
    assert back.digest == machine.digest
    with pytest.raises(ValueError, match="read-only"):
        back.box[0] = 9.0


@pytest.mark.parametrize("text", ["a = " + "[" * 3000, "a = " + "9" * 5000])
def test_what_no_reader_of_toml_bears(text):
    with pytest.raises(ConfigError, match=r"m\.toml: not TOML"):
        parse_machine(text, Path("m.toml"))


def test_a_name_that_is_no_path():
    with pytest.raises(ConfigError, match="cannot be read"):
        load_machine("a\0.toml")


def test_a_pose_in_words():
    text = describe_pose(np.array([0.1, 0, -0.2, np.pi / 180, 0, 0]))
    assert text.startswith("surge +100.0 mm, sway +0.0 mm, heave -200.0 mm, roll +1.00 deg")
