import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from own_kinematics import quintic_poses

from motionserver.core.axes import frozen
from motionserver.core.plan import Plan, pack, rest_at, unpack

values = st.floats(-2.0, 2.0)
seeds = st.integers(0, 2**32 - 1)


def random_plan(seed, count=5):
    rng = np.random.default_rng(seed)
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.1, 1.0, count - 1))))
    tables = rng.normal(size=(3, count, 6))
    tables[1:, -1] = 0.0
    return Plan(7, 3, 0.25, frozen(times), *(frozen(table) for table in tables))


@given(seeds, st.integers(2, 12))
def test_knots_are_met(seed, count):
    plan = random_plan(seed, count)
    found = plan.evaluate(plan.times)
    for table, wanted in zip(found, (plan.pose, plan.velocity, plan.acceleration), strict=True):
        assert table == pytest.approx(wanted, abs=1e-9)
    just_before = plan.evaluate(plan.times[1:] - 1e-12)
    for table, wanted in zip(
        just_before, (plan.pose, plan.velocity, plan.acceleration), strict=True
    ):
        assert table == pytest.approx(wanted[1:], abs=1e-4)


@given(seeds)
def test_between_knots_it_is_the_hermite_quintic(seed):
    plan = random_plan(seed)
    times = np.linspace(0.0, plan.duration, 97)
    assert plan.poses(times) == pytest.approx(quintic_poses(plan, times), abs=1e-9)
    assert plan.poses(times) == pytest.approx(plan.evaluate(times)[0], abs=1e-12)


@given(seeds)
def test_velocity_and_acceleration_are_the_derivatives(seed):
    plan = random_plan(seed)
    h = 1e-5
    middles = (plan.times[1:] + plan.times[:-1]) / 2
    behind, ahead = plan.poses(middles - h), plan.poses(middles + h)
    here, velocity, acceleration = plan.evaluate(middles)
    scale = 1.0 + 1e6 / np.diff(plan.times).min() ** 3 * h**2
    assert velocity == pytest.approx((ahead - behind) / (2 * h), abs=1e-5 * scale)
    slope = (plan.evaluate(middles + h)[1] - plan.evaluate(middles - h)[1]) / (2 * h)
    assert acceleration == pytest.approx(slope, abs=1e-4 * scale)
    assert here.shape == velocity.shape == acceleration.shape == (4, 6)


@given(st.lists(values, min_size=6, max_size=6), st.floats(0.1, 4.0))
def test_it_is_exact_for_polynomials_of_degree_five(coefficients, duration):
    poly = np.polynomial.Polynomial(coefficients)
    times = np.array([0.0, 0.3, 0.45, 1.0]) * duration
    tables = [np.repeat(p(times)[:, None], 6, 1) for p in (poly, poly.deriv(), poly.deriv(2))]
    plan = Plan(1, 0, 0.0, frozen(times), *(frozen(table) for table in tables))
    between = np.linspace(0.0, duration, 50)[:-1]
    found = plan.evaluate(between)
    for table, p in zip(found, (poly, poly.deriv(), poly.deriv(2)), strict=True):
        scale = 1.0 + np.abs(p(between)).max() + np.abs(poly(between)).max() / duration**2
        assert table[:, 2] == pytest.approx(p(between), abs=1e-8 * scale)


@given(seeds, st.floats(0.0, 1e6))
def test_after_the_end_it_rests(seed, later):
    plan = random_plan(seed)
    state = plan.state(plan.duration + later)
    assert (state.pose == plan.rest_pose).all()
    assert not state.velocity.any()
    assert not state.acceleration.any()


def test_a_rest_rests():
    pose = np.arange(6) / 10
    plan = rest_at(pose, 5)
    assert (plan.plan_id, plan.parent_id, plan.takeover) == (5, 5, 0.0)
    assert rest_at(pose).plan_id == 0
    assert plan.poses(np.linspace(0, 1, 9)) == pytest.approx(np.tile(pose, (9, 1)))
    with pytest.raises(ValueError, match="read-only"):
        plan.pose[0, 0] = 1.0


def test_a_plan_made_from_one_that_was_played_plays_its_own_tables():
    plan = rest_at(np.zeros(6))
    plan.poses(np.array([0.0]))
    moved = replace(plan, pose=frozen(np.ones((2, 6))))
    assert (moved.poses(np.array([0.0, 1.0])) == 1.0).all()


def test_a_plan_that_was_played_is_still_the_same_plan():
    fresh = random_plan(1)
    plan = replace(fresh)
    unseen = repr(plan)
    plan.poses(np.array([0.0]))
    assert plan == fresh
    assert repr(plan) == unseen


@given(seeds, st.integers(1, 256))
def test_bytes_come_back(seed, count):
    plan = random_plan(seed, count)
    data = pack(plan)
    assert len(data) == 32 + count * 152
    back = unpack(data)
    assert (back.plan_id, back.parent_id, back.takeover) == (7, 3, 0.25)
    for name in ("times", "pose", "velocity", "acceleration"):
        assert (getattr(back, name) == getattr(plan, name)).all()


def test_the_bytes_are_little_endian_in_a_fixed_order():
    data = pack(rest_at(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), 258))
    assert data[:8] == bytes([2, 1, 0, 0, 0, 0, 0, 0])
    assert struct.unpack_from("<II", data, 24) == (2, 0)
    assert struct.unpack_from("<19d", data, 32) == (0, 1, 2, 3, 4, 5, 6, *[0] * 12)
    assert struct.unpack_from("<2d", data, 32 + 152) == (0.01, 1.0)


@given(st.binary(max_size=400))
def test_garbage_is_no_plan(data):
    with pytest.raises(ValueError, match="plan: "):
        unpack(data)


@given(seeds, st.data())
def test_damaged_bytes_are_a_plan_or_an_error(seed, data):
    whole = bytearray(pack(random_plan(seed)))
    cut = data.draw(st.integers(0, len(whole)))
    if cut < len(whole):
        with pytest.raises(ValueError, match="plan: "):
            unpack(bytes(whole[:cut]))
    for _ in range(3):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    try:
        back = unpack(bytes(whole))
    except ValueError:
        return
    assert back.pose.shape == (len(back.times), 6)


def test_four_times_the_knots_of_a_plan_are_read_and_left_to_the_check():
    assert len(unpack(pack(random_plan(1, 1024))).times) == 1024


@pytest.mark.parametrize("count", [0, 1025, 2**32 - 1])
def test_absurd_counts_are_refused(count):
    head = struct.pack("<QQdII", 1, 0, 0.0, count, 0)
    with pytest.raises(ValueError, match="announce"):
        unpack(head + bytes(min(count, 1025) * 152))
