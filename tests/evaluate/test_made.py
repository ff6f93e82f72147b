"""An evaluation whose tuning cannot be used is refused before anything is driven."""

from dataclasses import replace

import pytest
from machines import compact

from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.options import tuning_from
from motionserver.evaluate.ranges import check_made

MACHINE = compact()


@pytest.mark.parametrize("name", ["mpc", "thondel2014"])
def test_solver_without_its_library_is_refused_with_remedy(monkeypatch, name):
    monkeypatch.setattr("motionserver.solvers.hpipm_library.find_spec", lambda _: None)
    tuning = replace(Tuning(), backend="hpipm")
    check_made(MACHINE, tuning, ["classical"], 100.0)
    with pytest.raises(ConfigError, match=r"tuning of .*: backend.*hpipm.*Allowed: .*pip install"):
        check_made(MACHINE, tuning, ["classical", name], 100.0)


def test_horizon_that_does_not_fit_the_planner_rate_is_refused():
    with pytest.raises(ConfigError, match=r"mpc: horizon.*at least 0\.75 s"):
        check_made(MACHINE, replace(Tuning(), horizon=0.5), ["mpc"], 20.0)


def test_preset_file_of_an_earlier_version_is_read_with_a_warning(tmp_path, capsys):
    file = tmp_path / "old.toml"
    file.write_text('about = ""\n[values]\nscale = 0.4\ntranslation_threshold_m_s2 = 0.2\n')
    assert tuning_from(MACHINE, str(file)).scale == 0.4
    assert "translation_threshold_m_s2 is left out" in capsys.readouterr().err
