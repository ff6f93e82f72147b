import json
from dataclasses import replace

import numpy as np
import pytest

from motionserver.core.state import Stimulus
from motionserver.cueing.predictor import (
    FEATURES,
    Predictor,
    PredictorError,
    load,
    save,
)
from motionserver.cueing.reference import Reference
from motionserver.cueing.reference_learned import Learned
from motionserver.errors import TunableError

INSTANTS = np.array([0.05, 0.25, 0.5, 1.0, 2.0, 3.0])


def some(seed=0, size=0.05):
    rng = np.random.default_rng(seed)
    weights = size * rng.normal(size=(2, 3, FEATURES))
    return Predictor("some", np.array([0.25, 1.0, 2.0]), weights, {"note": "drawn"})


def drive(model, scale=1.0, mirror=1.0, count=300, seed=1):
    rng = np.random.default_rng(seed)
    walk = np.cumsum(0.05 * rng.normal(size=(count, 6)), axis=0)
    for k in range(count):
        signs = np.array([1, mirror, 1, mirror, 1, mirror])
        wanted = scale * walk[k] * signs
        one = Stimulus(wanted[:3], wanted[3:], share=scale, speed=12.0)
        out = model.predict(one, one.rates)
    return out


def test_half_the_scale_is_half_the_forecast():
    whole, half = (drive(Learned(0.01, INSTANTS, some()), scale) for scale in (1.0, 0.5))
    # all but the first guess of the autoregressive model, which has a size
    assert half == pytest.approx(0.5 * whole, abs=0.03 * np.abs(half).max())


def test_left_mirrors_right_and_leaves_surge_alone():
    left, right = (drive(Learned(0.01, INSTANTS, some()), 1.0, sign) for sign in (1.0, -1.0))
    assert right[:, 0] == pytest.approx(left[:, 0])
    assert right[:, 1] == pytest.approx(-left[:, 1])


def test_no_weights_is_the_autoregressive_model():
    nothing = replace(some(), weights=np.zeros((2, 3, FEATURES)))
    learned = drive(Learned(0.01, INSTANTS, nothing))
    assert learned == pytest.approx(drive(Reference("ar", 0.01, INSTANTS, 0.0)))


def test_written_and_read_again(tmp_path):
    save(some(), tmp_path / "p.json")
    again = load(tmp_path / "p.json")
    assert again.weights == pytest.approx(some().weights, abs=1e-6)
    assert again.provenance == {"note": "drawn"}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"format": "other"}, "format 'other'"),
        ({"horizons_s": [0.25, 0.2, 2.0]}, "must increase"),
        ({"horizons_s": [0.0, 1.0, 2.0]}, "above 0"),
        ({"surge": [[0.0] * FEATURES] * 2, "sway": [[0.0] * FEATURES] * 2}, "needed is"),
        ({"sway": [[float("nan")] * FEATURES] * 3}, "no number"),
        ({"sway": [[1e3] * FEATURES] * 3}, "beyond 100"),
        ({"surge": "many"}, "is no predictor"),
    ],
)
def test_a_file_that_is_no_predictor(tmp_path, change, complaint):
    file = tmp_path / "p.json"
    save(some(), file)
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    with pytest.raises(PredictorError, match=complaint):
        load(file)


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(PredictorError, match="cannot be read"):
        load(tmp_path / "nothing.json")
    # none comes with the package: one fitted to other drives holds on nobody's own
    for named, complaint in (("", "needs a predictor"), ("truck", "cannot be read")):
        with pytest.raises(TunableError, match=complaint) as refused:
            Reference("learned", 0.01, INSTANTS, 0.0, named)
        assert refused.value.tunable == "predictor"
        assert "motionserver tune --predictor" in refused.value.allowed


def test_reference_takes_the_file_that_is_named(tmp_path):
    save(some(), tmp_path / "p.json")
    by_file = drive(Reference("learned", 0.01, INSTANTS, 0.0, str(tmp_path / "p.json")))
    assert by_file[:, :2] == pytest.approx(
        drive(Learned(0.01, INSTANTS, load(tmp_path / "p.json")))[:, :2]
    )
