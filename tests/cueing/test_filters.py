from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from motionserver.core.axes import GRAVITY
from motionserver.cueing.filters import (
    FILTER_SETS,
    Corner,
    channel,
    check_controllable,
    discretise,
    filter_set,
    high_pass,
    low_pass,
    rate_high_pass,
)

FIG3 = FILTER_SETS["fig3"]
PLANT = channel(FIG3.high, FIG3.low)


def test_fig3_poles():
    poles = np.sort(np.linalg.eigvals(PLANT.A).real)
    assert poles == pytest.approx([-20, -12.5, -3.5, -3.5, -2, -2], abs=1e-5)


def test_fig3_last_rows_and_input():
    assert PLANT.A[2] == pytest.approx([-245, -152.25, -27, 0, 0, 0])
    assert PLANT.A[5] == pytest.approx([0, 0, 0, -50, -54, -16.5])
    assert pytest.approx([0, 0, 20, 0, 0, 5.09684], abs=1e-5) == PLANT.B


def test_fig3_steady_state():
    rest = -np.linalg.solve(PLANT.A, PLANT.B)
    assert rest[0] == pytest.approx(0.08163, abs=1e-5)
    assert np.degrees(rest[3]) == pytest.approx(5.8406, abs=1e-4)
    assert rest[2] + GRAVITY * rest[3] == pytest.approx(1.0)


def test_fig3_zero_order_hold_at_ten_milliseconds():
    a, b = discretise(PLANT, 0.01)
    assert a[2] == pytest.approx([-2.141652, -1.342088, 0.756980, 0, 0, 0], abs=1e-6)
    assert a[5] == pytest.approx([0, 0, 0, -0.460513, -0.499721, 0.845467], abs=1e-6)
    assert b == pytest.approx([3e-6, 9.15e-4, 0.174829, 1e-6, 2.41e-4, 0.046943], abs=5e-7)


@pytest.mark.parametrize(
    ("omega", "gain"),
    [(0.1, 1.00), (0.3, 0.97), (1, 0.73), (2, 0.32), (3, 0.25), (5, 0.55), (10, 0.77), (20, 0.68)],
)
def test_fig3_frequency_response(omega, gain):
    row = np.array([0, 0, 1, GRAVITY, 0, 0])
    answer = row @ np.linalg.solve(1j * omega * np.eye(6) - PLANT.A, PLANT.B)
    assert abs(answer) == pytest.approx(gain, abs=0.006)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.002, 0.5), st.floats(-5.0, 5.0))
def test_hold_is_exact(step, u):
    start = np.array([0.01, -0.1, 0.5, 0.02, 0.03, -0.1])
    a, b = discretise(PLANT, step)
    truth = solve_ivp(
        lambda _, x: PLANT.A @ x + PLANT.B * u, (0, step), start, rtol=1e-10, atol=1e-12
    )
    assert a @ start + b * u == pytest.approx(truth.y[:, -1], abs=1e-7)


def test_shared_pole_is_refused():
    same = Corner(2.0, 1.0, 0.05)
    with pytest.raises(ValueError, match="cannot be controlled"):
        check_controllable(channel(same, same), "test")
    equal_lags = channel(Corner(3.5, 1.0, 0.05), Corner(2.0, 1.0, 0.05))
    with pytest.raises(ValueError, match="share a corner or a lag"):
        check_controllable(equal_lags, "test")


@pytest.mark.parametrize("name", sorted(FILTER_SETS))
def test_shipped_sets_are_controllable(name):
    assert filter_set(name).name == name


def test_unknown_set():
    with pytest.raises(ValueError, match="fig3"):
        filter_set("fig4")


def test_a_set_with_a_shared_pole_is_refused_by_name(monkeypatch):
    bad = replace(FIG3, low=FIG3.high)
    monkeypatch.setitem(FILTER_SETS, "bad", bad)
    with pytest.raises(ValueError, match="'bad'"):
        filter_set("bad")


def test_high_pass_shows_onset_and_washes_out():
    block = high_pass(FIG3.high)
    answer = np.array([0, 0, 1]) @ np.linalg.solve(200j * np.eye(3) * 0.05 - block.A, block.B)
    assert abs(answer) == pytest.approx(0.8, abs=0.1)
    rest = -np.linalg.solve(block.A, block.B)
    assert rest[1:] == pytest.approx([0, 0])


def test_low_pass_shows_the_input_by_gravity():
    block = low_pass(FIG3.low)
    assert -GRAVITY * np.linalg.solve(block.A, block.B)[0] == pytest.approx(1.0)


def test_rate_high_pass_passes_attitude_then_fades():
    block = rate_high_pass(0.5, 0.03)
    assert np.sort(np.linalg.eigvals(block.A).real) == pytest.approx(
        [-1 / 0.03, -1 / 0.03, -0.5], rel=1e-4
    )
    # a rate of 1 rad/s for 0.1 s turns by 0.1 rad, which then fades with 1/0.5 s
    a, b = discretise(block, 0.1)
    turned = a @ (b * 1.0)
    later = discretise(block, 2.0)[0] @ turned
    assert turned[0] == pytest.approx(0.1, rel=0.2)
    assert later[0] == pytest.approx(turned[0] * np.exp(-1.0), rel=0.1)
