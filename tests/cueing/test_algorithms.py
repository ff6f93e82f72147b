"""What every algorithm must do, one inherited suite."""

from dataclasses import replace

import numpy as np
import pytest
from cueing.cueing_loop import play, stimulus_of

from motionserver.core.axes import Axis
from motionserver.core.plan import MAX_DURATION, MAX_KNOTS, rest_at
from motionserver.core.state import PlatformState
from motionserver.cueing.registry import make_cueing
from motionserver.cueing.tuning import Tuning

BRAKE = stimulus_of((-2.0, 0.0, 0.0))
PERIOD = 0.01


class CueingContract:
    tuning: Tuning

    @pytest.fixture
    def cueing(self, machine):
        return make_cueing(machine, self.tuning, PERIOD)

    def test_braking_moves_backward_and_nose_down(self, machine, cueing):
        pose = np.concatenate(play(machine, cueing, [BRAKE] * 60).pose)
        assert pose[-1, Axis.SURGE] < -0.01
        assert pose[-1, Axis.PITCH] > 0.005
        assert np.abs(pose[:, [Axis.SWAY, Axis.ROLL, Axis.YAW]]).max() < 1e-6

    def test_left_turn_moves_left_and_rolls_left_side_up(self, machine, cueing):
        pose = np.concatenate(play(machine, cueing, [stimulus_of((0, 2.0, 0))] * 60).pose)
        assert pose[-1, Axis.SWAY] > 0.01
        assert pose[-1, Axis.ROLL] > 0.005

    def test_crest_and_yaw(self, machine, cueing):
        stimuli = [stimulus_of((0, 0, 1.0), (0, 0, 0.2))] * 20
        pose = np.concatenate(play(machine, cueing, stimuli).pose)
        assert pose[-1, Axis.HEAVE] > 0.002
        assert pose[-1, Axis.YAW] > 0.002

    def test_vehicle_pitch_rate_is_shown(self, machine, cueing):
        pose = np.concatenate(
            play(machine, cueing, [stimulus_of((0, 0, 0), (0, 0.1, 0))] * 30).pose
        )
        assert pose[-1, Axis.PITCH] > 0.01

    def test_onset_has_the_right_sign(self, machine, cueing):
        force, _ = play(machine, cueing, [BRAKE] * 20).felt(machine)
        assert force[:, 0].min() < -0.15
        assert force[:, 0].max() < 0.05

    def test_candidates_begin_at_the_start_and_end_at_rest(self, machine, cueing):
        rng = np.random.default_rng(1)
        stimuli = [stimulus_of(3 * rng.normal(size=3), 0.2 * rng.normal(size=3)) for _ in range(80)]
        played = play(machine, cueing, stimuli)
        for start, plan in zip(played.starts, played.candidates, strict=True):
            assert plan.times[0] == 0.0
            assert (np.diff(plan.times) > 1e-4).all()
            assert plan.times[-1] <= MAX_DURATION
            assert len(plan.times) <= MAX_KNOTS
            assert (plan.pose[0] == start.pose).all()
            assert (plan.velocity[0] == start.velocity).all()
            assert (plan.acceleration[0] == start.acceleration).all()
            assert not plan.velocity[-1].any()
            assert not plan.acceleration[-1].any()

    def test_stays_still_without_a_stimulus(self, machine, cueing):
        played = play(machine, cueing, [stimulus_of((0, 0, 0))] * 20)
        assert np.abs(np.concatenate(played.pose)).max() < self.stillness

    # an inexact solver leaves a trace of its tolerance
    stillness = 1e-9

    def test_steady_force_is_shown_by_tilt(self, machine, cueing):
        force, _ = play(machine, cueing, [stimulus_of((0.5, 0.0, 0.0))] * 500).felt(machine)
        assert force[-1, 0] == pytest.approx(0.5 * self.steady_gain, abs=0.1)

    steady_gain = 1.0

    def test_no_violation_under_rough_treatment(self, machine, cueing):
        rng = np.random.default_rng(2)
        steps = np.repeat(rng.uniform(-8, 8, size=(8, 3)), 40, axis=0)
        rates = np.repeat(rng.uniform(-0.5, 0.5, size=(8, 3)), 40, axis=0)
        stimuli = [stimulus_of(f, r) for f, r in zip(steps, rates, strict=True)]
        assert play(machine, cueing, stimuli).violations(machine) == 0

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
    def test_wild_numbers_do_not_raise(self, machine, cueing, bad):
        stimuli = (
            [BRAKE] * 5 + [stimulus_of((bad, 0, 0))] * 3 + [stimulus_of((0, 0, 0), (0, bad, bad))]
        )
        played = play(machine, cueing, [*stimuli, *[BRAKE] * 10])
        assert played.violations(machine) == 0
        assert played.candidates[-1] is not None

    def test_not_a_number_gives_no_candidate_and_says_so(self, cueing):
        rest = rest_at(np.zeros(6))
        start = PlatformState.at_rest(np.zeros(6))
        assert cueing.propose(start, rest, 0.01, stimulus_of((np.nan, 0, 0))) is None
        assert cueing.report().solver_status != "solved"
        cueing.adopt(rest, 0.0)

    def test_retune_in_the_middle_is_continuous(self, machine, cueing):
        def on_tick(tick):
            if tick == 20:
                cueing.retune(replace(self.tuning, tilt_rate=0.1, scale=1.0, gain=1.0))
            if tick == 40:
                cueing.retune(replace(self.tuning, box=0.7 * self.tuning.box, horizon=1.5))
            if tick == 60:
                cueing.retune(replace(self.tuning, filters="fig3", reference="fade"))

        stimuli = [stimulus_of((2.0, 1.0, 0.5), (0.05, 0.05, 0.1))] * 80
        played = play(machine, cueing, stimuli, on_tick=on_tick)
        assert played.violations(machine) == 0
        assert all(candidate is not None for candidate in played.candidates)
        velocity = np.concatenate(played.velocity)
        assert np.abs(np.diff(velocity, axis=0)).max() < 0.02

    def test_attenuated_plans_are_followed(self, machine, cueing):
        """Half of each candidate is let through: state and rotation part must stay consistent."""
        parent = rest_at(np.zeros(6))
        for tick in range(60):
            start = parent.state(PERIOD)
            plan = cueing.propose(start, parent, PERIOD, stimulus_of((2, 1, 0), (0.1, 0.1, 0.1)))
            assert plan is not None

            def half(plan_=plan, parent_=parent, tick_=tick):
                from motionserver.cueing.governor import govern

                calls = iter([object(), None])
                return govern(plan_, parent_, PERIOD, tick_ + 1, lambda _: next(calls))

            proposal = half()
            assert proposal.kappa == 0.5
            cueing.adopt(proposal.plan, 0.5)
            parent = proposal.plan
        assert 0.0 < parent.pose[0, Axis.SURGE] < 0.2
        assert np.abs(parent.pose[0]).max() < 0.5

    def test_deterministic(self, machine):
        rng = np.random.default_rng(5)
        stimuli = [stimulus_of(2 * rng.normal(size=3)) for _ in range(30)]
        runs = [
            np.concatenate(play(machine, make_cueing(machine, self.tuning, PERIOD), stimuli).pose)
            for _ in range(2)
        ]
        assert (runs[0] == runs[1]).all()

    @pytest.mark.parametrize("period", [0.005, 1 / 60, 0.02])
    def test_other_periods(self, machine, period):
        cueing = make_cueing(machine, self.tuning, period)
        period = round(period / 0.002) * 0.002 if period > 0.01 else period
        played = play(machine, cueing, [BRAKE] * 40, period=0.02 if period > 0.01 else 0.004)
        assert played.violations(machine) == 0


class TestClassical(CueingContract):
    tuning = Tuning(algorithm="classical", gain=1.0)


class TestThondel(CueingContract):
    tuning = Tuning(algorithm="thondel2014")


class TestThondelBoxOnly(CueingContract):
    tuning = Tuning(algorithm="thondel2014", legs=False, halving="paper", filters="fig3")


class TestThondelConstant(CueingContract):
    tuning = Tuning(algorithm="thondel2014", reference="constant", halving="off")


class TestThondelPiqp(CueingContract):
    tuning = Tuning(algorithm="thondel2014", backend="piqp", horizon=1.0)


class TestThondelOsqp(CueingContract):
    tuning = Tuning(algorithm="thondel2014", backend="osqp", horizon=0.8)
    stillness = 3e-4
