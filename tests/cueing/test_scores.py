"""The figures, against the same by hand."""

import numpy as np
import pytest

from motionserver.core.axes import GRAVITY, frozen
from motionserver.core.plan import rest_at
from motionserver.core.state import Stimulus
from motionserver.cueing.scores import WINDOW, Scores

PERIOD = 0.1


def wanting(x, y=0.0):
    return Stimulus(frozen([x, y, 3.0]), frozen(np.zeros(3)))


def tilted(pitch):
    return rest_at(np.array([0.0, 0.0, 0.0, 0.0, pitch, 0.0]), 1)


def test_before_anything_was_heard(machine):
    figures = Scores(machine, PERIOD).figures()
    assert figures.periods == 0
    assert figures.rmse is figures.nrmse is figures.whole is figures.think_p99 is None
    assert figures.leg_use == 0.0


def test_felt_is_compared_with_what_is_wanted_when_it_is_felt(machine):
    scores = Scores(machine, PERIOD)
    pitch = -0.1
    force = -GRAVITY * np.sin(pitch)
    scores.heard(tilted(pitch), 0.0, wanting(99.0))
    scores.heard(tilted(0.0), 0.0, wanting(2.0))
    scores.heard(tilted(0.0), 0.0, wanting(0.0, 1.0))
    figures = scores.figures()
    errors, wanted = [force - 2.0, 0.0, 0.0, -1.0], [2.0, 0.0, 0.0, 1.0]
    assert figures.rmse == pytest.approx(np.sqrt(np.mean(np.square(errors))))
    assert figures.nrmse == pytest.approx(figures.rmse / np.sqrt(np.mean(np.square(wanted))))


def test_nothing_is_compared_over_a_pause(machine):
    scores = Scores(machine, PERIOD)
    scores.heard(tilted(-0.1), 0.0, wanting(1.0))
    scores.pause()
    scores.heard(tilted(0.0), 0.0, wanting(5.0))
    assert scores.figures().rmse is None


def test_a_ratio_to_nothing_is_none(machine):
    scores = Scores(machine, PERIOD)
    for _ in range(5):
        scores.heard(tilted(-0.1), 0.0, wanting(0.0))
    assert scores.figures().rmse > 0.5
    assert scores.figures().nrmse is None


def test_shares_and_times_are_of_the_periods_it_thought_in(machine):
    scores = Scores(machine, PERIOD)
    for kappa, seconds in ((1.0, 0.001), (0.5, 0.002), (0.0, 0.003), (None, 0.004)):
        scores.heard(tilted(0.0), 0.0, wanting(1.0))
        scores.thought(kappa, seconds)
    scores.heard(tilted(0.0), 0.0, wanting(1.0))
    scores._shown = None
    figures = scores.figures()
    assert (figures.whole, figures.part, figures.refused, figures.none) == (0.25,) * 4
    assert figures.think_p50 == pytest.approx(0.0025)
    assert figures.think_p99 == pytest.approx(0.00397)
    assert figures.kappa is None
    assert figures.periods == 5


def test_the_window_slides(machine):
    scores = Scores(machine, PERIOD)
    far = rest_at(np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0]), 1)
    scores.heard(far, 0.0, wanting(1.0))
    use = scores.figures().leg_use
    length = round(WINDOW / PERIOD)
    for _ in range(length - 1):
        scores.heard(tilted(0.0), 0.0, wanting(1.0))
    scores._shown = None
    assert scores.figures().leg_use == use > 0.5
    scores.heard(tilted(0.0), 0.0, wanting(1.0))
    scores._shown = None
    assert scores.figures().leg_use < use
    assert scores.figures().periods == length
