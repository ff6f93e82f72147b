"""Machine files that lie: wrong units, wrong order, wrong axes; and real machines, which are taken.

The geometries come from outside: public rigs and papers, or a hexapod made here from circles.
"""

import copy
import json
import math
import re
import tomllib
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.errors import ConfigError
from motionserver.settings.machine import box_warning, parse_machine, read_machine_text

T2 = tomllib.loads(
    (files("motionserver.presets") / "platforms" / "t2-compact.toml").read_text("utf-8")
)
M = Path("m.toml")


def parsed(data):
    return parse_machine(tomli_w.dumps(data), M)


def refusal(data):
    with pytest.raises(ConfigError) as caught:
        parsed(data)
    return str(caught.value)


def changed(data, **places):
    """A copy with values at "section__key" multiplied by a factor or changed by a function."""
    out = copy.deepcopy(data)
    for name, change in places.items():
        *sections, key = name.split("__")
        inner = out
        for section in sections:
            inner = inner[section]
        apply = change if callable(change) else lambda value, factor=change: times(value, factor)
        inner[key] = apply(inner[key])
    return out


def times(value, factor):
    if isinstance(value, list):
        return [times(item, factor) for item in value]
    return value * factor


def circle(radius, degrees, z=0.0):
    return [
        [
            round(radius * math.cos(math.radians(a)), 5),
            round(radius * math.sin(math.radians(a)), 5),
            z,
        ]
        for a in degrees
    ]


def staggered(base_r, platform_r, base_half, platform_half, height, under=0.0, front_pair=True):
    """A hexapod of two circles: pairs of base joints at 0, 120, 240 deg, platform pairs between."""
    base = [
        base_half,
        120 - base_half,
        120 + base_half,
        240 - base_half,
        240 + base_half,
        -base_half,
    ]
    top = [
        60 - platform_half, 60 + platform_half, 180 - platform_half,
        180 + platform_half, 300 - platform_half, 300 + platform_half,
    ]  # fmt: skip
    if not front_pair:
        base, top = (
            [60 - base_half, 60 + base_half, 180 - base_half, 180 + base_half, 300 - base_half,
             300 + base_half],
            [platform_half, 120 - platform_half, 120 + platform_half, 240 - platform_half,
             240 + platform_half, -platform_half],
        )  # fmt: skip
    b, p = circle(base_r, base), circle(platform_r, top, -under)
    joined = math.dist((*b[0][:2], 0.0), (*p[0][:2], height))
    return b, p, height + under, joined


def rig(name, base, platform, height, legs, motion):
    low, high = legs
    stroke = high - low
    speed, acceleration, jerk = motion
    made = {
        "name": name,
        "neutral_height": height,
        "base_joints": base,
        "platform_joints": platform,
        "legs": {"min": low, "max": high, "speed": speed, "acceleration": acceleration},
        "workspace": {
            "joint_angle_deg": 45.0,
            "conditioning": 0.3,
            "parked": {"heave": -0.25 * stroke},
        },
        "pace": {"speed": 0.25 * speed, "acceleration": 0.06 * acceleration,
                 "jerk": 0.3 * acceleration},
    }  # fmt: skip
    if jerk is not None:
        made["legs"]["jerk"] = jerk
    return made


def published():
    """Public geometries; where a source gives no limits of motion, they are assumed."""
    out = {"t2-compact": T2}
    # LinuxCNC genhexkins defaults, counted counter-clockwise from the front left
    base = [[1.1659, 0.6731, 0.0], [1.1659, 0.6731, 0.0], [-1.1659, 0.6731, 0.0],
            [-1.1659, 0.6731, 0.0], [0.0, -1.3462, 0.0], [0.0, -1.3462, 0.0]]  # fmt: skip
    top = [[0.5313, -0.2481, 0.0], [0.0508, 0.5842, 0.0], [-0.0508, 0.5842, 0.0],
           [-0.5313, -0.2481, 0.0], [-0.4805, -0.3361, 0.0], [0.4805, -0.3361, 0.0]]  # fmt: skip
    out["genhex"] = rig("genhex", base, top, 1.016, (1.3111, 1.7111), (0.6, 8.0, 200.0))
    # least-squares fits to Table 2 of Thoendel 2014
    b, p, h, _ = staggered(1.6347, 0.7392, 17.83, 11.61, 1.0566, 0.1980)
    out["t2-tall"] = rig("t2-tall", b, p, h, (1.3679, 1.6491), (0.6, 8.0, 200.0))
    b, p, h, _ = staggered(0.7952, 0.6585, 22.52, 2.01, 0.4582, 0.1415, front_pair=False)
    out["t2-small"] = rig("t2-small", b, p, h, (0.5290, 0.8081), (0.6, 8.0, 200.0))
    # published anchor lengths of a laboratory hexapod, counted from the front left
    b, p, h, leg = staggered(0.694, 0.753, 14.18, 2.47, 0.5273)
    out["laboratory"] = rig("laboratory", b, p, h, (0.60078, 0.90478), (0.6, 8.0, None))
    # demonstration hexapod of r 0.2 m, home 0.2575 m, half angle 12 deg
    b, p, h, leg = staggered(0.2, 0.2, 12.0, 12.0, 0.2575)
    out["demo"] = rig("demo", b, p, h, (leg - 0.025, leg + 0.025), (0.2, 4.0, 200.0))
    # Moog 6DOF2000E: retracted about 0.71 m, heave travel 0.457 m, mid extension about 0.17 m
    b, p, h, leg = staggered(0.85, 0.6, 8.0, 6.0, 0.62)
    low = round(leg, 4) - 0.166
    out["6dof2000e-like"] = rig("6dof2000e-like", b, p, h, (low, low + 0.343), (0.6, 6.0, None))
    # a 60 inch machine for full-flight simulators
    b, p, h, leg = staggered(3.2, 2.7, 7.0, 7.0, 2.9, front_pair=False)
    out["60-inch"] = rig("60-inch", b, p, h, (leg - 0.75, leg + 0.75), (0.9, 8.0, 100.0))
    # a shaker: short stroke, fast and hard
    b, p, h, leg = staggered(0.7, 0.5, 10.0, 10.0, 0.8)
    out["shaker"] = rig("shaker", b, p, h, (leg - 0.05, leg + 0.05), (1.2, 60.0, 9000.0))
    # a slow heavy one
    out["slow"] = rig("slow", b, p, h, (leg - 0.1, leg + 0.1), (0.05, 0.5, 2.0))
    return out


PUBLISHED = published()


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_machine_is_taken(name):
    parsed(PUBLISHED[name])


RIGS = Path(__file__).parent / "rigs"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("t2_speed_mm", [":23: legs.speed: 600", "In mm/s? Write 0.6"]),
        ("t2_in_mm", ["neutral_height: 1027.1", "All lengths in mm?"]),
        ("t2_clockwise", ["base_joints", "counted clockwise", "the joints tell", "y to the right?",
                          "in the order 6, 5, 4, 3, 2, 1"]),
        ("t2_base_swapped_1_2", ["base_joints", "ase joints 2 and 3 swapped?"]),
        ("similar_hexagons", ["platform_joints", "singular at neutral", "still moves in yaw",
                              "staggered|by 60 deg"]),
        ("linuxcnc_genhex", ["base_joints", "counted clockwise", "in the order 3, 2, 1, 6, 5, 4",
                             "leg_order in the configuration then is [2, 1, 0, 5, 4, 3]"]),
    ],
)  # fmt: skip
def test_rig_that_lies_is_refused_with_the_slip(name, words):
    path = RIGS / f"{name}.toml"
    with pytest.raises(ConfigError) as caught:
        read_machine_text(path.read_text("utf-8"), path)
    text = str(caught.value)
    assert text.startswith(str(path))
    for one in words:
        assert any(part in text for part in one.split("|")), (one, text)


@pytest.mark.parametrize("name", ["tiny_desk", "big_60in"])
def test_rig_with_a_box_out_of_proportion_is_taken_with_a_warning(name):
    path = RIGS / f"{name}.toml"
    read = read_machine_text(path.read_text("utf-8"), path)
    assert not read.box_is_computed
    warning = box_warning(read)
    assert "[table2]" in warning
    factor = {"tiny_desk": "heave 0.2 m, reached 0.0216 (9.3 times)",
              "big_60in": "surge 0.198 m, reached 1.082 (0.18 times)"}[name]  # fmt: skip
    assert factor in warning
    advised = warning.partition("Write ")[2].partition(", or leave")[0]
    data = tomllib.loads(path.read_text("utf-8")) | tomllib.loads(advised)
    assert box_warning(read_machine_text(tomli_w.dumps(data), M)) is None


def test_box_that_fits_has_no_warning():
    assert box_warning(read_machine_text(tomli_w.dumps(T2), M)) is None


def test_order_that_is_proposed_is_taken():
    data = tomllib.loads((RIGS / "linuxcnc_genhex.toml").read_text("utf-8"))
    order = [3, 2, 1, 6, 5, 4]
    parsed(changed(data, **{key: lambda joints: [joints[i - 1] for i in order]
                            for key in ("base_joints", "platform_joints")}))  # fmt: skip


def reordered(order):
    return lambda joints: [joints[i] for i in order]


def flipped(*signs):
    return lambda joints: [[s * v for s, v in zip(signs, joint, strict=True)] for joint in joints]


BOTH = ("base_joints", "platform_joints")
AXES = {"y to the right": (1, -1, 1), "x backwards": (-1, 1, 1),
        "x backwards, y to the right": (-1, -1, 1)}  # fmt: skip


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("start", range(1, 6))
def test_legs_from_another_corner_are_refused_with_the_order(name, start):
    order = [(start + i) % 6 for i in range(6)]
    text = refusal(changed(PUBLISHED[name], **dict.fromkeys(BOTH, reordered(order))))
    back = ", ".join(str(order.index(leg) + 1) for leg in range(6))
    assert f"in the order {back};" in text
    assert f"leg_order in the configuration then is {order}" in text


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("start", range(6))
def test_legs_counted_clockwise_are_refused_with_the_order(name, start):
    order = [(start - i) % 6 for i in range(6)]
    text = refusal(changed(PUBLISHED[name], **dict.fromkeys(BOTH, reordered(order))))
    back = ", ".join(str(order.index(leg) + 1) for leg in range(6))
    assert "clockwise" in text
    assert f"in the order {back};" in text


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("axes", AXES)
def test_joints_along_other_axes_are_refused_with_the_axes(name, axes):
    text = refusal(changed(PUBLISHED[name], **dict.fromkeys(BOTH, flipped(*AXES[axes]))))
    assert axes in text
    assert "x forward, y left" in text


@pytest.mark.parametrize("key", BOTH)
@pytest.mark.parametrize("name", [n for n in PUBLISHED if n != "genhex"])
def test_two_joints_swapped_are_refused_and_named(name, key):
    for one in range(6):
        for other in range(one + 1, 6):
            order = list(range(6))
            order[one], order[other] = other, one
            text = refusal(changed(PUBLISHED[name], **{key: reordered(order)}))
            assert f"joints {one + 1} and {other + 1} swapped?" in text, (one, other, text)


def test_platform_joints_above_the_reference_point_are_refused_with_the_axis():
    text = refusal(changed(T2, platform_joints=flipped(1, 1, -1)))
    assert "platform_joints" in text
    assert "z down?" in text


LENGTH, SPEED, ACCELERATION, JERK = ("mm", "mm/s", "mm/s2", "mm/s3")
KEYS = {
    "neutral_height": LENGTH,
    "base_joints": LENGTH,
    "platform_joints": LENGTH,
    "head": LENGTH,
    "legs__min": LENGTH,
    "legs__max": LENGTH,
    "legs__speed": SPEED,
    "legs__acceleration": ACCELERATION,
    "legs__jerk": JERK,
    "workspace__parked__heave": LENGTH,
    "workspace__passenger_acceleration": ACCELERATION,
    "table2__surge": LENGTH,
    "table2__sway": LENGTH,
    "table2__heave": LENGTH,
    "pace__speed": SPEED,
    "pace__acceleration": ACCELERATION,
    "pace__jerk": JERK,
}


def full(data):
    """With every key that a file may hold."""
    out = copy.deepcopy(data)
    read = read_machine_text(tomli_w.dumps(data), M)
    reach = read.reach
    out["head"] = [0.0, 0.05, 0.8]
    out["workspace"]["passenger_acceleration"] = 6.0
    out["legs"].setdefault("jerk", 30.0 * out["legs"]["acceleration"])
    out["table2"] = {
        "surge": float(reach[0]), "sway": float(reach[1]), "heave": float(reach[2]),
        "roll_deg": math.degrees(reach[3]), "pitch_deg": math.degrees(reach[4]),
        "yaw_deg": math.degrees(reach[5]),
    }  # fmt: skip
    return out


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("name", PUBLISHED)
def test_one_key_in_mm_is_refused_with_the_slip(name, key):
    data = full(PUBLISHED[name])
    parsed(data)
    text = refusal(changed(data, **{key: 1000.0}))
    assert f": {key.replace('__', '.')}" in text
    assert f"n {KEYS[key]}?" in text, text


@pytest.mark.parametrize(
    ("key", "factor", "slip"),
    [
        ("workspace__joint_angle_deg", math.radians(1.0), "In rad?"),
        ("workspace__joint_angle_deg", 1000.0, "1000 times too large?"),
        ("workspace__conditioning", 100.0, "In percent?"),
        ("table2__roll_deg", 1000.0, "1000 times too large?"),
        ("legs__speed", 1e-3, "1000 times too small?"),
        ("legs__acceleration", 1e-3, "1000 times too small?"),
        ("legs__jerk", 1e-3, "1000 times too small?"),
        ("neutral_height", 100.0, "In cm?"),
        ("neutral_height", 1 / 0.0254, "In inch?"),
        ("base_joints", 100.0, "In cm?"),
        ("legs__max", 100.0, "In cm?"),
        ("pace__speed", 1e-3, "1000 times too small?"),
    ],
)
def test_one_key_in_another_unit_is_refused_with_the_slip(key, factor, slip):
    text = refusal(changed(full(T2), **{key: factor}))
    assert any(one in text for one in slip.split("|")), text
    assert f": {key.replace('__', '.')}" in text


@pytest.mark.parametrize("factor", [1000.0, 100.0])
@pytest.mark.parametrize(
    "keys",
    [
        ("legs__min", "legs__max"),
        ("legs__min", "legs__max", "legs__speed", "legs__acceleration", "legs__jerk"),
        ("neutral_height", "base_joints", "platform_joints", "workspace__parked__heave"),
        ("neutral_height", "base_joints", "platform_joints", "workspace__parked__heave",
         "legs__min", "legs__max"),
        ("base_joints", "platform_joints"),
        ("legs__speed", "legs__acceleration", "legs__jerk"),
        ("legs__speed", "legs__acceleration", "legs__jerk", "pace__speed", "pace__acceleration",
         "pace__jerk"),
    ],
)  # fmt: skip
def test_several_keys_in_another_unit_are_refused_with_the_slip(keys, factor):
    unit = {1000.0: "mm", 100.0: "cm"}[factor]
    text = refusal(changed(T2, **dict.fromkeys(keys, factor)))
    if factor == 1000.0 or keys[0] != "legs__speed":  # 60 m/s at 800 m/s2 may be a jerk as well
        assert re.search(rf"in (mm or )?{unit}( or \w+)*\?", text, re.IGNORECASE), text


@st.composite
def sane_rigs(draw):
    """Staggered hexapods of any size with limits of motion as real machines have them."""
    size = draw(st.floats(0.1, 3.5))
    ratio = draw(st.floats(0.45, 1.0))
    base_half, platform_half = draw(st.floats(3, 18)), draw(st.floats(3, 18))
    height = size * draw(st.floats(0.7, 1.3))
    front = draw(st.booleans())
    b, p, h, leg = staggered(
        size, ratio * size, base_half, platform_half, height, draw(st.floats(0, 0.2)) * size, front
    )
    stroke = leg * draw(st.floats(0.2, 0.4))
    low = leg - 0.5 * stroke
    acceleration = draw(st.floats(2.0, 12.0))
    speed = min(stroke / draw(st.floats(0.3, 2.0)), math.sqrt(acceleration * stroke))
    jerk = acceleration * draw(st.floats(8.0, 60.0))
    made = rig("random", b, p, h, (low, low + stroke), (speed, acceleration, jerk))
    made["workspace"]["joint_angle_deg"] = draw(st.floats(35.0, 60.0))
    return made


@settings(max_examples=60, deadline=None)
@given(data=sane_rigs(), key=st.sampled_from(sorted(KEYS)))
def test_sane_rig_is_taken_and_refused_with_one_key_in_mm(data, key):
    data = full(data)
    parsed(data)
    text = refusal(changed(data, **{key: 1000.0}))
    assert f": {key.replace('__', '.')}" in text
    assert f"n {KEYS[key]}?" in text


@settings(max_examples=40, deadline=None)
@given(data=sane_rigs(), way=st.sampled_from([1, -1]), start=st.integers(0, 5))
def test_sane_rig_counted_otherwise_is_refused(data, way, start):
    order = [(start + way * i) % 6 for i in range(6)]
    if order == list(range(6)):
        parsed(data)
        return
    assert "in the order" in refusal(changed(data, **dict.fromkeys(BOTH, reordered(order))))


def test_machine_without_a_box_has_that_of_its_reach():
    data = copy.deepcopy(T2)
    del data["table2"]
    read = read_machine_text(tomli_w.dumps(data), M)
    assert read.box_is_computed
    # the ranges the geometry was fitted to, from Thoendel 2014, Table 2
    table = [0.198, 0.220, 0.200, *np.radians([17.5, 16.3, 17.5])]
    assert read.machine.box == pytest.approx(table, rel=2e-3)
    assert json.dumps(read.machine.box.tolist())
