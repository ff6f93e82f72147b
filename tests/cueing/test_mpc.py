"""The six-axis MPC: its grid, its maps, its outputs, and what it does with a machine."""

from dataclasses import replace

import numpy as np
import pytest
from cueing_loop import play, stimulus_of
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.axes import GRAVITY
from motionserver.core.kinematics.rotation import felt
from motionserver.core.plan import Plan, rest_at
from motionserver.core.state import PlatformState, Preview
from motionserver.cueing.mpc import SixAxis
from motionserver.cueing.mpc_grid import jerk_maps, make_spline_grid
from motionserver.cueing.mpc_nominal import Projection
from motionserver.cueing.mpc_outputs import linearise
from motionserver.cueing.tuning import Tuning
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact").with_head(np.array([0.0, 0.0, 0.7]))
ARM = np.array([0.1, -0.2, 0.7])
periods = st.sampled_from([1 / 120, 0.01, 1 / 60, 0.02])
pieces = st.integers(6, 25)


def wiggle(grid, seed, start=None):
    """A plan on the grid that ends at rest."""
    random = np.random.default_rng(seed)
    jerks = grid.basis @ random.normal(size=(grid.pieces - 2, 6)) * 0.1
    maps = jerk_maps(grid.edges, grid.edges)
    still = np.zeros(6)
    return jerks, Plan(
        1, 1, 0.0, grid.edges, maps.pose @ jerks + still, maps.velocity @ jerks,
        maps.acceleration @ jerks,
    )  # fmt: skip


@given(period=periods, count=pieces)
@settings(max_examples=30, deadline=None)
def test_a_grid_begins_with_two_periods_grows_and_ends_at_the_horizon(period, count):
    grid = make_spline_grid(2.0, period, count)
    lengths = np.diff(grid.edges)
    assert lengths[:2] == pytest.approx([period, period])
    assert (np.diff(lengths) >= -1e-12).all()
    assert grid.horizon == 2.0
    assert grid.nodes[grid.knots] == pytest.approx(grid.edges[1:])
    assert grid.share.sum() == pytest.approx(2.0 - grid.nodes[0] / 2.0)


def test_too_many_pieces_are_refused_with_what_is_allowed():
    with pytest.raises(ValueError, match="allowed 6 to 50"):
        make_spline_grid(0.5, 0.01, 60)


@given(period=periods, count=pieces)
@settings(max_examples=30, deadline=None)
def test_every_combination_of_jerks_ends_at_rest(period, count):
    grid = make_spline_grid(2.0, period, count)
    end = jerk_maps(grid.edges, grid.edges[-1:]).of(grid.basis)
    assert np.abs(end.velocity).max() < 1e-12
    assert np.abs(end.acceleration).max() < 1e-12
    assert np.linalg.matrix_rank(grid.basis) == count - 2


def test_maps_are_the_integrals_of_the_jerk():
    grid = make_spline_grid(2.0, 0.01, 9)
    jerks = np.random.default_rng(1).normal(size=9)
    times = np.linspace(0.0, 2.0, 200_001)
    jerk = jerks[np.minimum(np.searchsorted(grid.edges, times, side="right") - 1, 8)]
    step = times[1]
    acceleration = np.concatenate(([0.0], np.cumsum(jerk[:-1]) * step))
    velocity = np.concatenate(([0.0], np.cumsum(acceleration[:-1]) * step))
    pose = np.concatenate(([0.0], np.cumsum(velocity[:-1]) * step))
    looks = np.arange(0, 200_001, 9_999)
    maps = jerk_maps(grid.edges, times[looks])
    assert maps.acceleration @ jerks == pytest.approx(acceleration[looks], abs=2e-4)
    assert maps.velocity @ jerks == pytest.approx(velocity[looks], abs=2e-4)
    assert maps.pose @ jerks == pytest.approx(pose[looks], abs=2e-4)


@given(seed=st.integers(0, 999), takeover=st.floats(0.0, 1.9))
@settings(max_examples=40, deadline=None)
def test_the_projection_keeps_both_ends(seed, takeover):
    grid = make_spline_grid(2.0, 0.01)
    _, plan = wiggle(grid, seed)
    start = plan.state(takeover)
    projection = Projection(grid)
    nominal = projection.of(start, plan, takeover)
    assert nominal.pose[-1] == pytest.approx(plan.rest_pose, abs=1e-9)
    assert np.abs(nominal.velocity[-1]).max() < 1e-9
    assert np.abs(nominal.acceleration[-1]).max() < 1e-9
    free = start.pose + grid.nodes[0] * start.velocity
    free = free + 0.5 * grid.nodes[0] ** 2 * start.acceleration
    first = jerk_maps(grid.edges, grid.nodes[:1]).pose @ nominal.jerks
    assert nominal.pose[0] == pytest.approx(free + first[0], abs=1e-12)


def test_a_plan_on_the_grid_is_its_own_projection():
    grid = make_spline_grid(2.0, 0.01)
    jerks, plan = wiggle(grid, 3)
    nominal = Projection(grid).of(plan.state(0.0), plan, 0.0)
    assert nominal.jerks == pytest.approx(jerks, abs=1e-7)


def motions(seed, count=6):
    random = np.random.default_rng(seed)
    return random.uniform(-0.3, 0.3, (count, 6)), *random.normal(size=(2, count, 6))


@given(seed=st.integers(0, 999))
@settings(max_examples=30, deadline=None)
def test_outputs_at_the_nominal_are_exact(seed):
    pose, velocity, acceleration = motions(seed)
    outputs = linearise(pose, velocity, acceleration, ARM)
    force, rates = felt(pose, velocity, acceleration, ARM)
    assert outputs.value[:, :3] == pytest.approx(force - [0.0, 0.0, GRAVITY], abs=1e-9)
    assert outputs.value[:, 3:] == pytest.approx(rates, abs=1e-12)


@pytest.mark.parametrize("axis", range(6))
def test_derivatives_of_the_outputs(axis):
    pose, velocity, acceleration = motions(7)
    outputs = linearise(pose, velocity, acceleration, ARM)
    step = np.zeros(6)
    step[axis] = 1e-6
    ahead = felt(pose, velocity, acceleration + step, ARM)[0]
    behind = felt(pose, velocity, acceleration - step, ARM)[0]
    assert outputs.by_acceleration[:, :, axis] == pytest.approx((ahead - behind) / 2e-6, abs=1e-6)
    if axis < 3:
        return
    ahead = felt(pose, velocity + step, acceleration, ARM)[1]
    behind = felt(pose, velocity - step, acceleration, ARM)[1]
    assert outputs.by_velocity[:, :, axis - 3] == pytest.approx((ahead - behind) / 2e-6, abs=1e-6)
    slow = acceleration.copy()
    slow[:, 3:] = 0.0
    outputs = linearise(pose, 0.0 * velocity, slow, ARM)
    ahead = felt(pose + step, 0.0 * velocity, slow, ARM)[0]
    behind = felt(pose - step, 0.0 * velocity, slow, ARM)[0]
    found = outputs.by_pose[:, :3, axis - 3]
    assert found == pytest.approx((ahead - behind) / 2e-6, abs=1e-6)


def brake(ticks, force=-3.0):
    still = stimulus_of((0.0, 0.0, 0.0))
    return [still] * 20 + [stimulus_of((force, 0.0, 0.0))] * ticks


@pytest.mark.parametrize("reference", ["constant", "ar"])
def test_a_hard_brake_stays_inside_every_limit(reference):
    tuning = Tuning(algorithm="mpc", reference=reference)
    played = play(MACHINE, SixAxis(MACHINE, tuning, 0.01), brake(300, -8.0))
    assert played.violations(MACHINE) == 0
    assert np.mean(np.array(played.kappas) > 0.0) > 0.99
    force, _ = played.felt(MACHINE)
    assert force[-1, 0] < -1.2, "sustained braking is felt by tilting"


def test_it_follows_a_small_onset_at_once():
    tuning = Tuning(algorithm="mpc", reference="constant")
    played = play(MACHINE, SixAxis(MACHINE, tuning, 0.01), brake(40, -1.0))
    force, _ = played.felt(MACHINE)
    assert force[5 * (20 + 8), 0] < -0.4


def test_tuned_position_limits_hold():
    box = MACHINE.box * np.array([0.2, 1.0, 1.0, 1.0, 0.3, 1.0])
    tuning = replace(Tuning(algorithm="mpc", reference="constant"), box=box)
    played = play(MACHINE, SixAxis(MACHINE, tuning, 0.01), brake(200, -4.0))
    used = np.abs(np.concatenate(played.pose)).max(axis=0) / box
    assert used[0] < 1.02
    assert used[4] < 1.02


def test_a_passengers_limit_is_kept_by_the_programme_itself():
    machine = replace(MACHINE, passenger_acceleration=1.5)
    tuning = Tuning(algorithm="mpc", reference="constant")
    played = play(machine, SixAxis(machine, tuning, 0.01), brake(100, -5.0))
    second = np.concatenate(played.acceleration)[:, :3]
    assert np.linalg.norm(second, axis=1).max() < 1.5
    assert np.mean(np.array(played.kappas) == 1.0) > 0.9


@pytest.mark.parametrize("limit", [{"joint_angle": np.radians(20.0)}, {"conditioning": 0.85}])
def test_posture_limits_are_in_the_programme(limit):
    machine = replace(MACHINE, **limit)
    tuning = Tuning(algorithm="mpc", reference="constant")
    played = play(machine, SixAxis(machine, tuning, 0.01), brake(200, -5.0))
    kappas = np.array(played.kappas)
    assert np.mean(kappas == 0.0) < 0.02
    assert np.abs(np.concatenate(played.pose)).max() > 0.02


def test_without_a_jerk_limit_it_works_as_well():
    machine = replace(MACHINE, leg_jerk=None)
    played = play(machine, SixAxis(machine, Tuning(algorithm="mpc"), 0.01), brake(50))
    assert min(played.kappas) > 0.0


def test_nonsense_in_gives_no_candidate_and_says_so():
    cueing = SixAxis(MACHINE, Tuning(algorithm="mpc"), 0.01)
    rest = rest_at(np.zeros(6))
    start = PlatformState.at_rest(np.zeros(6))
    assert cueing.propose(start, rest, 0.01, stimulus_of((np.nan, 0.0, 0.0))) is None
    assert cueing.report().solver_status == "not finite"


def test_a_long_turn_is_washed_out_of_yaw():
    tuning = Tuning(algorithm="mpc", reference="constant")
    turning = [stimulus_of((0.0, 0.0, 0.0), (0.0, 0.0, 0.3))] * 1200
    played = play(MACHINE, SixAxis(MACHINE, tuning, 0.01), turning)
    yaw = np.concatenate(played.pose)[:, 5]
    assert yaw.max() > 0.03
    assert abs(yaw[-1]) < 0.7 * yaw.max()


@pytest.mark.parametrize("perception", ["telban-cardullo", "reid-nahon"])
def test_with_perceived_error_it_cues_otherwise_and_stays_inside(perception):
    plain = Tuning(algorithm="mpc", reference="constant")
    weighted = replace(plain, perception=perception)
    forces = []
    for tuning in (plain, weighted):
        played = play(MACHINE, SixAxis(MACHINE, tuning, 0.01), brake(150))
        assert played.violations(MACHINE) == 0
        forces.append(played.felt(MACHINE)[0][:, 0])
    assert np.abs(forces[0] - forces[1]).max() > 0.1
    assert forces[1][-1] < -0.4


def test_a_perception_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="allowed: none, telban-cardullo, reid-nahon"):
        SixAxis(MACHINE, Tuning(algorithm="mpc", perception="dog"), 0.01)


def test_the_report_says_what_the_forecast_rests_on():
    cueing = SixAxis(MACHINE, Tuning(algorithm="mpc", reference="vehicle"), 0.01)
    play(MACHINE, cueing, brake(3))
    assert cueing.report().reference == "vehicle: no driver inputs, ar instead"


def test_at_the_legs_ends_it_does_not_shake():
    """Braking on and on, foretold: what is felt must stay near what is wanted, also sideways."""
    times = np.arange(1, 201) * 0.01
    force = np.tile((-1.6, -0.16, 0.0), (200, 1))
    preview = Preview(times, force, np.zeros((200, 3)))
    stimulus = stimulus_of((-1.6, -0.16, 0.0), preview=preview)
    cueing = SixAxis(MACHINE, Tuning(algorithm="mpc"), 0.01)
    played = play(MACHINE, cueing, [stimulus] * 700)
    felt_force, _ = played.felt(MACHINE)
    late = felt_force[-1000:, 1]
    assert np.std(late) < 0.05
    assert np.mean(np.array(played.kappas[-200:]) == 1.0) > 0.98
