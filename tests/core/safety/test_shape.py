"""The shape of a plan exactly at its edges, and what a refusal tells."""

import numpy as np
import pytest
from verify_scenes import STANDING, edited, table

from motionserver.core.safety.shape import continues, well_formed
from motionserver.core.safety.verdict import Reason, Rejection


def refused(plan, longest=4.0):
    return well_formed(plan, longest)


@pytest.mark.parametrize("count", [1, 257])
def test_the_number_of_knots_is_told(count):
    plan = table(count, times=np.arange(count) * 0.009)
    assert refused(plan) == Rejection(Reason.MALFORMED, value=count, allowed=256)


@pytest.mark.parametrize("first", [-0.1, 1e-9])
def test_where_it_begins_is_told(first):
    plan = table(times=[first, 0.25, 0.5, 0.75, 1.0])
    assert refused(plan) == Rejection(Reason.MALFORMED, when=first)


def test_how_long_it_is_is_told():
    assert refused(table(times=np.linspace(0.0, 2.0, 5)), 2.0) is None
    beyond = float(np.nextafter(2.0, 3.0))
    found = refused(table(times=np.linspace(0.0, beyond, 5)), 2.0)
    assert found == Rejection(Reason.MALFORMED, value=beyond, allowed=2.0)


def test_the_first_step_may_be_a_tenth_of_a_millisecond_but_for_rounding():
    least = 1e-4 - 1e-9
    assert refused(table(times=[0.0, least, 0.5, 0.75, 1.0])) is None
    short = float(np.nextafter(least, 0.0))
    found = refused(table(times=[0.0, short, 0.5, 0.75, 1.0]))
    assert found == Rejection(Reason.MALFORMED, 0.0, None, short, least)


def test_the_first_later_step_below_eight_milliseconds_is_told():
    found = refused(table(times=[0.0, 0.25, 0.5, 0.507, 0.51]))
    assert (found.reason, found.when, found.leg) == (Reason.MALFORMED, 0.5, None)
    assert found.value == pytest.approx(0.007)
    assert found.allowed == pytest.approx(0.008 - 1e-9, abs=1e-15)


def test_a_step_that_is_just_long_enough_is_not_told_for_a_later_one_that_is_short():
    found = refused(table(times=[0.0, 1e-4 - 1e-9, 0.5, 0.507, 1.0]))
    assert found.when == 0.5


@pytest.mark.parametrize("field", ["pose", "velocity", "acceleration"])
def test_numbers_up_to_ten_thousand_are_no_nonsense(field):
    assert refused(edited(field, 1, -1e4)) is None
    found = refused(edited(field, 1, np.nextafter(-1e4, -np.inf)))
    assert found == Rejection(Reason.NOT_FINITE, value=1e4)


@pytest.mark.parametrize("field", ["velocity", "acceleration"])
def test_how_far_from_rest_it_ends_is_told(field):
    assert refused(edited(field, -1, -1e-9)) is None
    found = refused(edited(field, -1, -1.5e-9))
    assert found == Rejection(Reason.NOT_AT_REST, when=1.0, value=1.5e-9, allowed=0.0)


@pytest.mark.parametrize(
    ("field", "tolerance"), [("pose", 1e-7), ("velocity", 1e-6), ("acceleration", 1e-4)]
)
def test_how_far_it_leaves_its_parent_is_told(field, tolerance):
    assert continues(edited(field, 0, -tolerance), STANDING) is None
    beyond = float(np.nextafter(tolerance, 1.0))
    found = continues(edited(field, 0, -beyond), STANDING)
    assert found == Rejection(Reason.DISCONTINUOUS, 0.0, None, beyond, tolerance)


def test_it_must_agree_with_its_parent_at_the_hand_over_and_nowhere_else():
    moving = edited("velocity", 0, 0.5)
    later = moving.state(0.1)
    child = table(
        pose=np.tile(later.pose, (5, 1)),
        velocity=np.vstack((later.velocity, np.zeros((4, 6)))),
        acceleration=np.vstack((later.acceleration, np.zeros((4, 6)))),
    )
    assert continues(child, moving) is None
