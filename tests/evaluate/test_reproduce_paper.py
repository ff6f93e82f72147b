"""The paper's figures: what holds, by the server's own code."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from motionserver.core.axes import Axis
from motionserver.errors import ConfigError
from motionserver.evaluate.reproduce.command import numbers, reproduce, write
from motionserver.evaluate.reproduce.paper import (
    PAPER,
    mpc,
    mpc_measured,
    washout,
    worst_case_scale,
)
from motionserver.evaluate.reproduce.signals import brake, drive, step
from motionserver.evaluate.reproduce.thondel2014 import (
    MPC_BOX,
    NOISE_SHARE,
    SHARES,
    Reproduction,
    claims,
    run_all,
)
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")
BOX = MACHINE.box
SCALE = worst_case_scale(brake(), MACHINE)


def test_signals_are_those_of_the_figures():
    for signal, rms, peak in ((step(), 2.31, 3.5), (brake(), 2.94, 6.0), (drive(), 1.50, 3.0)):
        assert np.sqrt(np.mean(signal.wanted**2)) == pytest.approx(rms, abs=0.01)
        assert np.abs(signal.wanted).max() == pytest.approx(peak, abs=0.01)
    assert drive().wanted.tobytes() == drive().wanted.tobytes()


def test_standard_washout_settles_where_the_filters_say():
    run = washout("open", step(), MACHINE)
    assert np.abs(run.x).max() == pytest.approx(3.5 * 0.08163, rel=1e-3)
    assert np.degrees(run.tilt.max()) == pytest.approx(3.5 * 5.8406, rel=1e-3)
    assert run.outside(BOX).mean() == pytest.approx(0.42, abs=0.02)
    assert run.legs_outside > 0.3


def test_worst_case_scale_just_keeps_the_box():
    run = washout("scaled", brake(), MACHINE, SCALE)
    assert pytest.approx(0.404, abs=0.001) == SCALE
    assert np.abs(run.x).max() == pytest.approx(BOX[Axis.SURGE], rel=1e-9)
    assert not run.outside(BOX).any()


@pytest.mark.parametrize("signal", [step(), brake()], ids=["step", "brake"])
def test_mpc_keeps_the_box_and_beats_the_scaled_washout(signal):
    run, rival = mpc("mpc", signal, MACHINE), washout("scaled", signal, MACHINE, SCALE)
    assert not run.outside(BOX).any()
    assert run.rmse <= SHARES[signal.name] * rival.rmse
    assert run.correlation > rival.correlation


def test_mpc_with_table_1_keeps_the_tilt_rate():
    run = mpc("soft", step(), MACHINE, replace(PAPER, tilt_rate=np.radians(3.0)))
    assert np.degrees(np.abs(run.tilt_rate).max()) < 3.1
    assert not run.outside(BOX).any()


def test_halving_moves_the_limit_and_stays_below_it():
    run = mpc("halving", step(), MACHINE, replace(PAPER, halving="paper"))
    assert run.x_max.min() < 0.99 * BOX[Axis.SURGE]
    assert not run.outside(BOX).any()


def test_noise_on_the_measured_acceleration_breaks_no_limit():
    clean = mpc("clean", step(), MACHINE)
    run, measured = mpc_measured("slow", step(), MACHINE, raw=False)
    assert np.std(measured - run.force) == pytest.approx(0.3, abs=0.05)
    assert not run.outside(BOX).any()
    assert run.rmse <= NOISE_SHARE * clean.rmse


def test_unknown_paper_and_folder_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="Allowed: thondel2014"):
        reproduce("thondel2015", tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot be made"):
        reproduce("thondel2014", tmp_path / "file")


@pytest.mark.campaign
@pytest.mark.timeout(1800)
def test_every_claim_holds_and_the_files_are_written(tmp_path):
    found = run_all(MACHINE)
    tried = claims(found)
    assert [claim.text for claim in tried if not claim.holds] == []
    write(found, tried, tmp_path)
    for name in ("fig3.svg", "fig4.svg"):
        assert ElementTree.fromstring((tmp_path / name).read_text()).tag.endswith("svg")
    data = json.loads((tmp_path / "numbers.json").read_text())
    assert data == json.loads(json.dumps(numbers(found, tried)))
    assert all(claim["holds"] for claim in data["claims"])
    assert "<svg" in (tmp_path / "index.html").read_text()
    # a claim that does not hold is seen
    bad = dict(found.runs)
    bad["step", MPC_BOX] = replace(bad["step", MPC_BOX], x=2.0 * bad["step", MPC_BOX].x)
    spoilt = Reproduction(found.machine, found.scale, bad, found.verified, found.measured)
    assert any(not claim.holds for claim in claims(spoilt))
