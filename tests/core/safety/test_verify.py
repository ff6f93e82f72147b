from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machines import compact
from own_kinematics import quintic_poses, worst
from verify_scenes import STANDING, edited, reason, table

from motionserver.core.axes import frozen
from motionserver.core.plan import Plan
from motionserver.core.safety.shape import continues, well_formed
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.verify import (
    GUARD_MARGINS,
    check_legs,
)


def test_standing_still_is_allowed():
    assert reason(table()) is None
    assert reason(table(2)) is None
    assert reason(table(256, times=np.linspace(0, 4.0, 256))) is None


@pytest.mark.parametrize("field", ["pose", "velocity", "acceleration"])
@pytest.mark.parametrize("row", [0, 2, 4])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e5, -1e300])
def test_what_is_no_number_is_refused(field, row, value):
    assert reason(edited(field, row, value)) is Reason.NOT_FINITE


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("row", [0, 2, 4])
def test_times_that_are_no_numbers(row, value):
    times = np.linspace(0.0, 1.0, 5)
    times[row] = value
    assert reason(table(times=times)) is Reason.NOT_FINITE
    assert reason(replace(table(), takeover=value)) is Reason.NOT_FINITE


@pytest.mark.parametrize(
    "times",
    [
        [0.0, 0.25, 0.25, 0.5, 1.0],
        [0.0, 0.5, 0.25, 0.75, 1.0],
        [0.0, 0.25, 0.5, 1.0, 0.75],
        [1e-9, 0.25, 0.5, 0.75, 1.0],
        [-0.1, 0.25, 0.5, 0.75, 1.0],
        [0.0, -0.25, 0.5, 0.75, 1.0],
        [0.0, 0.0, 0.5, 0.75, 1.0],
        [0.0, 0.00009, 0.5, 0.75, 1.0],
        [0.0, 0.5, 0.5079, 0.75, 1.0],
        [0.0, 1e308, -1e308, 0.75, 1.0],
        [0.0, 1e308, 2.0, 1e308, 1.0],
        [0.0, 1.0, 2.0, 3.0, 4.01],
        [0.0, 1.0, 2.0, 3.0, 1e300],
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 5.0, 3.0, 4.0],
    ],
)
def test_times_out_of_order_are_malformed(times):
    assert reason(table(times=times)) is Reason.MALFORMED


@pytest.mark.parametrize(
    "times", [[0.0, 0.0001, 0.0081, 0.0161, 4.0], [0.0, 0.008, 0.016, 0.024, 0.032]]
)
def test_the_closest_knots_allowed(times):
    assert reason(table(times=times)) is None


@pytest.mark.parametrize("count", [257, 1000])
def test_too_many_knots(count):
    times = np.arange(count) * 0.009
    assert reason(table(count, times=times)) is Reason.MALFORMED


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_knots(count):
    assert reason(table(count, times=np.zeros(count))) is Reason.MALFORMED


@pytest.mark.parametrize("field", ["pose", "velocity", "acceleration"])
@pytest.mark.parametrize("shape", [(5, 5), (4, 6), (6,), (5, 6, 1)])
def test_tables_of_another_shape(field, shape):
    assert reason(table(**{field: np.zeros(shape)})) is Reason.MALFORMED
    assert reason(table(times=np.zeros((5, 1)))) is Reason.MALFORMED


@pytest.mark.parametrize("field", ["velocity", "acceleration"])
@pytest.mark.parametrize("value", [1.1e-9, -1.0, 9e3])
def test_a_plan_that_does_not_end_at_rest(field, value):
    assert reason(edited(field, -1, value)) is Reason.NOT_AT_REST
    assert well_formed(edited(field, -1, 0.9e-9), 4.0) is None


@pytest.mark.parametrize(
    ("field", "tolerance"), [("pose", 1e-7), ("velocity", 1e-6), ("acceleration", 1e-4)]
)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_jump_at_the_hand_over(field, tolerance, sign):
    assert continues(edited(field, 0, sign * tolerance * 0.99), STANDING) is None
    assert reason(edited(field, 0, sign * tolerance * 1.01)) is Reason.DISCONTINUOUS


def test_a_spike_between_two_samples_is_seen():
    """Knots closer than the samples could hide half a metre between them."""
    times = [0.0, 1.0003, 1.001, 1.0017, 2.0]
    assert reason(table(times=times, pose=np.eye(5, 6, -2) * 0.5)) is Reason.MALFORMED


@given(st.integers(0, 2**32 - 1))
def test_what_passes_keeps_its_jerk_at_every_phase(seed):
    """Knots at their closest, jerk that turns between the samples, scaled until it just passes."""
    rng = np.random.default_rng(seed)
    machine, dt, count = compact(), rng.uniform(0.008, 0.02), int(rng.integers(4, 20))
    times = np.arange(count + 10) * dt
    times[1:] -= rng.choice([0.0, dt - 0.0003, dt - 0.003])
    shape = rng.normal(size=(3, count + 10, 6)) * (rng.random(6) < 0.5)
    shape *= rng.choice([0.0, 1.0], (3, 1, 1))
    shape[:, 0] = shape[:, count:] = 0.0
    powers = [dt**3, dt**2, dt]

    def scaled(size):
        rows = (frozen(part * power * size) for part, power in zip(shape, powers, strict=True))
        return Plan(1, 0, 0.1, frozen(times), *rows)

    low, high = 0.0, 1e5
    for _ in range(25):
        middle = (low + high) / 2
        passes = check_legs(machine, scaled(middle), STANDING, None, GUARD_MARGINS) is None
        low, high = (middle, high) if passes else (low, middle)
    for phase in rng.random(3):
        instants = np.arange(0.0, times[-1], 0.002) + phase * 0.002
        found = worst(machine, quintic_poses(scaled(low), instants), 0.002)
        assert max(found.values()) <= 1.0, found
