"""Organs: published anchors, and the filter over uneven nodes against a fine simulation."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from motionserver.cueing.mpc_grid import make_spline_grid
from motionserver.cueing.perception import PLAIN, REID_NAHON, TELBAN_CARDULLO, Perceived


def test_published_gains():
    canals, otoliths = TELBAN_CARDULLO.roll, TELBAN_CARDULLO.force
    assert abs(canals.response(1.0)) == pytest.approx(0.985, abs=5e-4)
    assert abs(canals.response(0.1)) == pytest.approx(0.493, abs=1e-3)
    assert abs(canals.response(0.0)) == pytest.approx(0.0, abs=1e-12)
    assert abs(otoliths.response(0.0)) == pytest.approx(0.4)
    assert abs(otoliths.response(1.0)) == pytest.approx(0.788, abs=1e-3)


@pytest.mark.parametrize("omega", [0.05, 0.7, 3.0, 20.0])
def test_reid_and_nahon_by_their_formula(omega):
    s = 1j * omega
    roll = 6.1 * 30.0 * s**2 / ((6.1 * s + 1) * (0.1 * s + 1) * (30.0 * s + 1))
    force = 0.4 * (13.2 * s + 1) / ((5.33 * s + 1) * (0.66 * s + 1))
    assert REID_NAHON.roll.response(omega) == pytest.approx(roll)
    assert REID_NAHON.force.response(omega) == pytest.approx(force)


@pytest.mark.parametrize("output", [0, 3, 5])
def test_over_the_nodes_it_is_the_transfer_function(output):
    grid = make_spline_grid(2.0, 0.01)
    perceived = Perceived(TELBAN_CARDULLO, grid.nodes, 0.01)
    error = np.cos(2.0 * grid.nodes)
    times = np.linspace(0.0, 2.0, 20_001)
    held = np.interp(times, grid.nodes, error)
    if output < 3:
        plant = TransferFunction([4.0, 0.4], [5.0 * 0.016, 5.016, 1.0])
        gain = abs(0.4 * (1 + 10j) / ((1 + 5j) * (1 + 0.016j)))
    else:
        plant = TransferFunction([80.0 * 5.73, 0.0, 0.0], [80.0 * 5.73, 85.73, 1.0])
        gain = abs(-80.0 * 5.73 / ((1 + 80j) * (1 + 5.73j)))
    _, felt, _ = lsim(plant, held, times)
    expected = PLAIN * error + (1.0 - PLAIN) * np.interp(grid.nodes, times, felt) / gain
    assert perceived.maps[output] @ error == pytest.approx(expected, abs=2e-3)


def test_what_is_remembered_continues_the_past():
    """Two seconds of a held error, then nothing: the memory alone is the rest of the answer."""
    grid = make_spline_grid(2.0, 0.01)
    perceived = Perceived(TELBAN_CARDULLO, grid.nodes, 0.01)
    for _ in range(200):
        perceived.learn(np.ones(6))
    times = np.linspace(0.0, 4.0, 40_001)
    plant = TransferFunction([80.0 * 5.73, 0.0, 0.0], [80.0 * 5.73, 85.73, 1.0])
    _, felt, _ = lsim(plant, (times < 2.0).astype(float), times)
    gain = abs(-80.0 * 5.73 / ((1 + 80j) * (1 + 5.73j)))
    expected = (1.0 - PLAIN) * np.interp(2.0 + grid.nodes, times, felt) / gain
    assert perceived.remembered()[:, 4] == pytest.approx(expected, abs=2e-3)
