import math
import tomllib
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.core.axes import frozen
from motionserver.core.limits import Machine, Pace
from motionserver.cueing.tuning import Tuning
from motionserver.settings.fields import TuningError
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import (
    TuningModel,
    apply_changes,
    default_for,
    describe,
)
from motionserver.settings.tuning_proof import make_with


def machine(box=(0.198, 0.22, 0.2, 0.3054, 0.2844, 0.3054)):
    none = frozen(np.zeros((6, 3)))
    still = frozen(np.zeros(6))
    return Machine(
        "small", none, none, 1.0, 0.9, 1.2, 0.6, 8.0, 200.0, None, None, None,
        frozen(np.zeros(3)), still, frozen(box), Pace(0.1, 0.5, 2.0),
    )  # fmt: skip


def test_default_model_means_default_tuning():
    ours, theirs = TuningModel().to_tuning(), Tuning()
    np.testing.assert_allclose(ours.box, theirs.box, rtol=1e-12)
    assert ours.tilt_rate == pytest.approx(theirs.tilt_rate)
    assert ours.horizon == theirs.horizon
    assert TuningModel.from_tuning(theirs) == TuningModel()


NUMBERS = {
    entry["name"]: (entry["min"], entry["max"]) for entry in describe(None) if "min" in entry
}


@given(st.fixed_dictionaries({name: st.floats(*ends) for name, ends in NUMBERS.items()}))
def test_every_allowed_tuning_survives_the_way_to_si_and_back(values):
    model = apply_changes(TuningModel(), values)
    back = TuningModel.from_tuning(model.to_tuning())
    for name in NUMBERS:
        assert getattr(back, name) == pytest.approx(getattr(model, name), rel=1e-9, abs=1e-9)


@given(st.sampled_from(sorted(NUMBERS)), st.floats())
def test_a_number_outside_its_bounds_is_never_taken(name, value):
    low, high = NUMBERS[name]
    if math.isfinite(value) and low <= value <= high:
        assert getattr(apply_changes(TuningModel(), {name: value}), name) == value
        return
    with pytest.raises(TuningError) as caught:
        apply_changes(TuningModel(), {name: value})
    (error,) = caught.value.errors
    assert error.field == name
    assert f"{low:g} to {high:g}" in error.allowed


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"scale": True}, "scale"),
        ({"scale": "0.5"}, "scale"),
        ({"scale": None}, "scale"),
        ({"scale": 10**400}, "scale"),
        ({"legs": 1}, "legs"),
        ({"filters": "other"}, "filters"),
        ({"filters": ["fig3"]}, "filters"),
        ({"algorithm": "no-such-thing"}, "algorithm"),
        ({"leg_speed": 3.0}, "leg_speed"),
    ],
)
def test_wrong_kinds_and_names_are_refused_by_name(changes, field):
    with pytest.raises(TuningError) as caught:
        apply_changes(TuningModel(), changes)
    assert [error.field for error in caught.value.errors] == [field]
    assert caught.value.errors[0].allowed


def test_several_bad_values_are_all_named():
    with pytest.raises(TuningError) as caught:
        apply_changes(TuningModel(), {"scale": 2.0, "horizon_s": -1.0, "gain": 0.5})
    assert {error.field for error in caught.value.errors} == {"scale", "horizon_s"}


def test_box_beyond_the_machine_is_refused_with_the_machines_range():
    small = machine((0.1, 0.22, 0.2, 0.3, 0.28, 0.3))
    with pytest.raises(TuningError) as caught:
        TuningModel().check_machine(small)
    assert {e.field for e in caught.value.errors} >= {"box_surge_m"}
    assert "0.005 to 0.1 m" in {e.allowed for e in caught.value.errors}
    default_for(small).check_machine(small)


def test_description_is_complete_and_stays_within_the_machine():
    entries = {entry["name"]: entry for entry in describe(machine())}
    assert list(entries) == list(TuningModel.model_fields)
    assert entries["box_surge_m"]["max"] == 0.198
    for entry in entries.values():
        assert entry["meaning"].endswith(".")
        assert entry["group"]
        assert "choices" in entry or entry["more"] or entry["is_file"]


def test_built_in_presets_are_valid():
    folder = files("motionserver.presets").joinpath("tunings")
    names = {item.name for item in folder.iterdir() if item.name.endswith(".toml")}
    assert {"passive-3deg.toml", "active-driver-6deg.toml", "paper-2014.toml"} <= names
    for name in names:
        data = tomllib.loads(folder.joinpath(name).read_text())
        assert data["about"]
        apply_changes(TuningModel(), data["values"])


def test_predictor_is_the_path_of_a_file_of_bounded_length():
    assert apply_changes(TuningModel(), {"predictor": "/a/my.json"}).predictor == "/a/my.json"
    for wrong in (7, "x" * 2000):
        with pytest.raises(TuningError) as caught:
            apply_changes(TuningModel(), {"predictor": wrong})
        assert caught.value.errors[0].field == "predictor"
        assert "path of a file" in caught.value.errors[0].allowed


def test_learned_is_refused_by_name_until_there_is_a_file():
    model = apply_changes(TuningModel(), {"reference": "learned"})
    with pytest.raises(TuningError) as caught:
        make_with(load_machine("t2-compact"), 0.01, model)
    assert [error.field for error in caught.value.errors] == ["predictor"]
