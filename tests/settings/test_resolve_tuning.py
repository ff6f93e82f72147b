"""A configuration whose tuning cannot be used, or does nothing, is refused before anything runs."""

import pytest

from motionserver.errors import ConfigError
from motionserver.settings.config import load_config
from motionserver.settings.resolve import resolve


def resolved(folder, tuning, algorithm="mpc", side=()):
    cueing = {"algorithm": algorithm, "tuning": tuning}
    overrides = {"cueing": cueing, "planner": {"side_engines": list(side)}}
    return resolve(load_config(None, overrides), folder)["planner"]["tuning"]


@pytest.fixture
def without_hpipm(monkeypatch):
    monkeypatch.setattr("motionserver.solvers.hpipm_library.find_spec", lambda _: None)


def test_solver_without_its_library_is_refused_with_reason_and_remedy(tmp_path, without_hpipm):
    with pytest.raises(ConfigError) as caught:
        resolved(tmp_path, {"backend": "hpipm"})
    assert caught.value.where == "[cueing.tuning]"
    for part in ("backend = 'hpipm'", "pip install 'motionserver[hpipm]'", "daqp"):
        assert part in str(caught.value)


def test_side_engine_that_cannot_be_made_is_refused_by_name(tmp_path, without_hpipm):
    with pytest.raises(ConfigError, match=r"\[planner\] side_engines: mpc.*hpipm"):
        resolved(tmp_path, {"backend": "hpipm"}, "classical", ["mpc"])


def test_horizon_that_does_not_fit_the_planners_rate_is_refused(tmp_path):
    slow = {"platform": {"rate_hz": 20.0}, "cueing": {"tuning": {"horizon_s": 0.5}}}
    with pytest.raises(ConfigError, match=r"horizon_s = 0\.5: .*pieces do not fit"):
        resolve(load_config(None, slow), tmp_path)


@pytest.mark.parametrize("key", ["gain", "halving", "weight_change"])
def test_tunable_without_effect_is_refused_naming_who_reads_it(tmp_path, key):
    value = {"gain": 0.4, "halving": "off", "weight_change": 0.5}[key]
    with pytest.raises(ConfigError, match=f"{key} = .*no effect with mpc; read by"):
        resolved(tmp_path, {key: value})


def test_tunable_of_a_side_engine_acts_and_is_taken(tmp_path):
    assert resolved(tmp_path, {"gain": 0.4}, side=["classical"])["gain"] == 0.4


def test_removed_tunable_is_refused_saying_so(tmp_path):
    with pytest.raises(ConfigError, match=r"translation_threshold_m_s2.*removed.*leave it out"):
        resolved(tmp_path, {"translation_threshold_m_s2": 0.1})
