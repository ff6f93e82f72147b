"""The box of a machine's file bounds the tunable box, and nothing else does."""

import math
from pathlib import Path

import numpy as np
import pytest

from motionserver.core.axes import frozen
from motionserver.core.limits import Machine, Pace
from motionserver.settings.fields import TuningError
from motionserver.settings.machine import parse_machine
from motionserver.settings.tuning import BOX_FIELDS, apply_changes, default_for, describe


def machine_with(metres, angle_deg):
    none, still = frozen(np.zeros((6, 3))), frozen(np.zeros(6))
    box = frozen([metres] * 3 + [math.radians(angle_deg)] * 3)
    return Machine(
        "any", none, none, 1.0, 0.9, 1.2, 0.6, 8.0, 200.0, None, None, None,
        frozen(np.zeros(3)), still, box, Pace(0.1, 0.5, 2.0),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("metres", "angle_deg"),
    [(0.0005, 0.05), (0.003, 0.3), (0.04, 8.0), (0.198, 17.5), (1.5, 60.0), (9.0, 79.0)],
)
def test_box_of_any_machine_is_the_whole_box_of_a_fresh_installation(metres, angle_deg):
    model = default_for(machine_with(metres, angle_deg))
    for name in BOX_FIELDS:
        whole = metres if name.endswith("_m") else angle_deg
        assert getattr(model, name) == pytest.approx(whole, rel=1e-6)
    model.check_machine(machine_with(metres, angle_deg))


@pytest.mark.parametrize(("metres", "angle_deg"), [(0.003, 0.3), (0.198, 17.5), (1.5, 60.0)])
def test_described_range_of_the_box_is_what_is_taken(metres, angle_deg):
    machine = machine_with(metres, angle_deg)
    described = {item["name"]: item for item in describe(machine)}
    for name in BOX_FIELDS:
        low, high = described[name]["min"], described[name]["max"]
        assert 0.0 < low < high
        for value in (low, high):
            apply_changes(default_for(machine), {name: value}).check_machine(machine)
        for value in (0.9 * low, 1.1 * high):
            with pytest.raises(TuningError) as caught:
                apply_changes(default_for(machine), {name: value}).check_machine(machine)
            assert f"{low:g} to {high:g}" in caught.value.errors[0].allowed


def test_machine_file_with_a_large_box_starts_with_all_of_it():
    text = (Path(__file__).parents[2] / "motionserver/presets/platforms/t2-compact.toml").read_text(
        "utf-8"
    )
    wide = text.replace("surge = 0.198", "surge = 0.9").replace("yaw_deg = 17.5", "yaw_deg = 60.0")
    assert wide != text
    model = default_for(parse_machine(wide, Path("wide.toml")))
    assert (model.box_surge_m, model.box_yaw_deg) == (0.9, 60.0)
