"""Sines in, gain and phase out."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.core.axes import GRAVITY
from motionserver.cueing.classical import REID_NAHON
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.omct import command
from motionserver.evaluate.omct.boundaries import read_boundaries
from motionserver.evaluate.omct.command import omct
from motionserver.evaluate.omct.run import Point, Response, run_omct
from motionserver.evaluate.omct.sines import (
    ENTRIES,
    FREQUENCIES,
    PERIODS,
    TESTS,
    bin_of,
    make_sine,
    tilt_shown,
    to_recording,
)
from motionserver.evaluate.options import EvaluateOptions
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")
QUICK = (15.849,)


def test_ten_tests_by_six_inputs():
    assert [test.number for test in TESTS] == list(range(1, 11))
    assert {test.entry for test in TESTS} == set(ENTRIES)
    assert len(FREQUENCIES) == 12
    assert np.diff(np.log10(FREQUENCIES)) == pytest.approx(0.2, abs=2e-3)


@given(
    gain=st.floats(0.01, 10.0),
    phase=st.floats(-np.pi, np.pi),
    omega=st.floats(0.5, 15.0),
    offset=st.floats(-5.0, 5.0),
)
def test_one_bin_finds_amplitude_and_phase_whatever_the_samples(gain, phase, omega, offset):
    times = 3.7 + np.arange(int(3 * 2 * np.pi / omega * 250.0)) / 250.0
    signal = offset + gain * np.cos(omega * times + phase)
    assert bin_of(signal, times, omega) == pytest.approx(gain * np.exp(1j * phase), abs=1e-6)


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("omega", [0.251, 3.981])
def test_input_is_the_stated_sine_with_its_gravity(entry, omega):
    sine = make_sine(entry, omega)
    recording = to_recording(sine)
    assert sine.end - sine.begin >= PERIODS * 2.0 * np.pi / omega - 1e-9
    kept = (recording.times >= sine.begin) & (recording.times < sine.end)
    times = recording.times[kept]
    signals = np.column_stack((recording.force, recording.rates))[kept]
    sizes = [abs(bin_of(signals[:, column], times, omega)) for column in range(6)]
    axis = ENTRIES.index(entry)
    assert sizes[axis] == pytest.approx(sine.amplitude, rel=2e-3)
    # a vehicle that pitches or rolls shows gravity; nothing else moves but f_z to second order
    expected = {"pitch": 0, "roll": 1}.get(entry)
    if expected is not None:
        angle = sine.amplitude / omega
        assert sizes[expected] == pytest.approx(GRAVITY * angle, rel=1e-2)
    others = [size for i, size in enumerate(sizes) if i not in (axis, expected)]
    assert max(others) < 1e-3
    assert not recording.rates[0].any() or entry in ("roll", "pitch", "yaw")


def test_tilt_shows_force_with_the_sign_of_the_table():
    pose = np.zeros((2, 6))
    pose[0, 4], pose[1, 3] = np.radians(10.0), np.radians(10.0)
    assert tilt_shown(pose)[0] == pytest.approx([-1.7035, 0.0], abs=1e-4)
    assert tilt_shown(pose)[1] == pytest.approx([0.0, 1.7035], abs=1e-4)


@pytest.fixture(scope="module")
def found():
    tuning = Tuning(scale=0.3, gain=1.0)
    return run_omct(MACHINE, tuning, ["classical"], force=0.5, planner_hz=50.0, frequencies=QUICK)


def test_classical_heave_is_its_own_filter_with_the_hand_over_behind_it(found):
    assert found.violations == 0
    heave = found.responses[9]
    corner = REID_NAHON.heave
    for point in heave.points:
        s = 1j * point.omega
        filtered = s**2 / (s**2 + 2 * corner.zeta * corner.omega * s + corner.omega**2)
        filtered /= 1.0 + corner.tau * s
        assert point.gain == pytest.approx(abs(filtered), rel=0.1)
        # one period to the hand-over and half a one of holding, at 50 Hz
        late = np.degrees(np.angle(filtered)) - point.phase
        assert 0.0 < np.radians(late) / point.omega < 0.06


def test_surge_and_sway_answer_alike(found):
    for one, other in ((5, 7), (6, 8), (0, 2), (1, 3)):
        for a, b in zip(found.responses[one].points, found.responses[other].points, strict=True):
            assert a.gain == pytest.approx(b.gain, rel=0.03)
            assert a.phase == pytest.approx(b.phase, abs=3.0)


def test_delay_is_read_from_the_last_phase():
    response = Response("x", TESTS[0], (Point(1.0, 1.0, 0.0), Point(10.0, 1.0, -57.29577951)))
    assert response.delay == pytest.approx(0.1)


def test_files_hold_everything_and_boundaries_mark(tmp_path):
    file = tmp_path / "limits.toml"
    file.write_text(
        'source = "made up"\n[[boundary]]\ntest = 10\nomega = [0.1, 20.0]\n'
        "gain_low = [5.0, 5.0]\nphase_high_deg = [500, 500]\n"
    )
    options = EvaluateOptions("classical", planner_hz=50.0, jobs=1)
    assert omct(tmp_path / "out", options, 1.0, file, QUICK) == 0
    data = json.loads((tmp_path / "out" / "omct.json").read_text())
    assert len(data["responses"]) == 10
    assert data["responses"][9]["outside"] == list(QUICK)
    assert data["responses"][0]["outside"] == []
    assert data["responses"][6]["late_s"] is None
    text = (tmp_path / "out" / "omct.txt").read_text()
    assert "1 points outside the boundaries of: made up" in text
    assert "forces 1 m/s2" in text
    page = (tmp_path / "out" / "omct.html").read_text()
    assert page.count("<svg") == 10
    assert "made up" in page
    assert not re.search(r"(?:src|href)\s*=|https?://|@import|url\(", page)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing = 1", "no .*boundary"),
        ("[[boundary]]\ntest = 11\nomega = [1.0]", "1 to 10"),
        ("[[boundary]]\ntest = 1\nomega = [1.0]\ngain = [1.0]", "unknown 'gain'"),
        ("[[boundary]]\ntest = 1\nomega = [1.0, 0.5]", "increasing"),
        ("[[boundary]]\ntest = 1\nomega = [1.0]\ngain_low = [1.0, 2.0]", "one length"),
        ("[[boundary]]\ntest = 1\nomega = [1.0]\ngain_low = [nan]", "lists of numbers"),
        ("[[bound", "cannot be read"),
        ("boundary = [1]", "boundary holds 1"),
        ("[[boundary]]\ntest = true\nomega = [1.0]", "1 to 10"),
        ("[[boundary]]\ntest = 2\nomega = [1.0]\n" * 2, "test 2 has two tables"),
    ],
)
def test_senseless_boundaries_are_refused(text, message, tmp_path):
    file = tmp_path / "limits.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_boundaries(file)


@pytest.mark.parametrize(
    ("change", "amplitude", "message"),
    [
        ({"algorithm": "classic"}, 1.0, "--algorithm"),
        ({"algorithm": "classical,classical"}, 1.0, "may stand once"),
        ({}, 0.0, "--amplitude"),
    ],
)
def test_wrong_arguments_of_omct_are_refused(change, amplitude, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        omct(tmp_path, replace(EvaluateOptions("classical"), **change), amplitude, None)


def test_a_folder_that_cannot_be_is_refused_before_anything_is_driven(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "run_omct", lambda *_, **__: pytest.fail("driven"))
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="--out"):
        omct(tmp_path / "file", EvaluateOptions("classical"), 1.0, None)
