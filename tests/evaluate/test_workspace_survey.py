"""The workspace against kinematics of the tests' own: inside is reachable, just outside is not."""

from dataclasses import replace

import numpy as np
import own_kinematics
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import compact, science_fit

from motionserver.core.axes import frozen
from motionserver.core.kinematics.hexapod import conditioning, neutral_conditioning
from motionserver.core.kinematics.reach import Limit, first_exits, reachable
from motionserver.core.safety.verify import GUARD_MARGINS, check_ways_home
from motionserver.errors import ConfigError
from motionserver.evaluate.workspace.homing import shares, stranded
from motionserver.evaluate.workspace.survey import PAIRS, survey

STROKE_ONLY = replace(compact(), joint_angle=None, conditioning=None)
MACHINES = {"compact": STROKE_ONLY, "science-fit": science_fit()}
DEG = np.radians(1.0)

ways = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).filter(
    lambda way: max(map(abs, way)) > 0.05
)


@pytest.fixture(scope="module")
def found():
    return survey(compact())


def beyond(machine, poses):
    """Farthest any leg is past an end of its stroke, by the tests' own kinematics [m]."""
    legs = own_kinematics.lengths(machine, poses)
    return np.maximum(machine.leg_min - legs, legs - machine.leg_max).max(1)


@settings(max_examples=60, deadline=None)
@given(way=ways, name=st.sampled_from(sorted(MACHINES)))
def test_a_way_is_allowed_up_to_its_exit_and_not_beyond(way, name):
    machine = MACHINES[name]
    direction = np.array(way) * machine.box
    exits = first_exits(machine, direction[None])
    inside = np.linspace(0.0, 1.0, 400)[:, None] * exits.poses[0]
    assert beyond(machine, inside).max() < 1e-9
    outside = direction * (exits.reach[0] * (1.0 + 1e-5) + 1e-7)
    assert beyond(machine, outside[None])[0] > 0.0
    ending = exits.endings[0]
    legs = own_kinematics.lengths(machine, exits.poses)[0]
    end = machine.leg_max if ending.limit is Limit.LONGEST else machine.leg_min
    at_end = {leg + 1 for leg in range(6) if abs(legs[leg] - end) < 2e-5}
    assert set(ending.legs) <= at_end
    assert ending.legs


@settings(max_examples=25, deadline=None)
@given(way=ways)
def test_conditioning_is_kept_on_the_way_and_lost_behind_its_end(way):
    # a stricter machine whose legs are endless: nothing but conditioning is left to end a way
    strict = replace(STROKE_ONLY, leg_min=0.05, leg_max=9.0, conditioning=0.7)
    direction = np.array(way) * strict.box
    exits = first_exits(strict, direction[None])
    share = conditioning(strict, np.linspace(0, 1, 300)[:, None] * exits.poses[0])
    least = 0.7 * neutral_conditioning(strict)
    assert share.min() >= least * (1.0 - 1e-6)
    if exits.endings[0].limit is Limit.CONDITIONING:
        behind = direction * exits.reach[0] * (1.0 + 1e-6)
        assert conditioning(strict, behind[None])[0] < least
        assert exits.endings[0].legs == ()


def test_joint_angles_end_a_way_at_the_leg_that_swings_most():
    machine = replace(STROKE_ONLY, joint_angle=10.0 * DEG)
    exits = first_exits(machine, np.eye(6))
    assert {one.limit for one in exits.endings} >= {Limit.JOINT}
    for row in range(3):
        # for a place alone both ends of a leg swing by the angle between two leg vectors
        if exits.endings[row].limit is not Limit.JOINT:
            continue
        leg = exits.endings[row].legs[0] - 1
        neutral = machine.platform_joints[leg] - machine.base_joints[leg]
        neutral = neutral + np.array([0.0, 0.0, machine.neutral_height])
        moved = neutral + exits.poses[row, :3]
        cosine = neutral @ moved / np.linalg.norm(neutral) / np.linalg.norm(moved)
        assert np.degrees(np.arccos(cosine)) == pytest.approx(10.0, abs=1e-4)


def test_a_pose_behind_a_gap_does_not_count():
    # raised by twice its leg length the same hexapod, upside down, has allowed legs again
    machine = replace(science_fit(), leg_min=0.70, leg_max=0.80)
    over = np.array([[0.0, 0.0, -2.0 * machine.neutral_height, 0.0, 0.0, 0.0]])
    assert beyond(machine, over)[0] < 0.0
    assert reachable(machine, over)[0]
    exits = first_exits(machine, over)
    assert exits.reach[0] < 0.5


@pytest.mark.parametrize("depth", [0.0002, 0.0005, 0.001])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_narrow_gap_ends_a_way(axis, depth):
    # a leg that leans shortens, stands, and lengthens again: the stroke's end just cuts that dip
    way = np.linspace(0.0, 0.6, 6001)
    poses = np.zeros((len(way), 6))
    poses[:, axis] = way
    legs = own_kinematics.lengths(science_fit(), poses)
    machine = replace(science_fit(), leg_min=legs.min() + depth, leg_max=legs.max() + 0.01)
    outside = beyond(machine, poses) > 0.0
    first = way[np.argmax(outside)]
    assert not outside[-1]
    exits = first_exits(machine, np.eye(6)[[axis]])
    assert exits.reach[0] == pytest.approx(first, abs=2e-4)
    assert exits.endings[0].limit is Limit.SHORTEST


@pytest.mark.parametrize(
    ("machine", "low", "high"),
    [
        (
            science_fit(),
            (-0.249, -0.219, -0.258, -17.4, -17.6, -17.6),
            (0.198, 0.219, 0.201, 17.4, 16.3, 17.6),
        ),
        # stroke alone: the machine's file also keeps 30 % of neutral's conditioning
        (
            STROKE_ONLY,
            (-0.1987, -0.2201, -0.1997, -17.49, -24.85, -17.49),
            (0.1979, 0.2201, 0.1998, 17.49, 16.32, 17.49),
        ),
    ],
)
def test_published_ranges_of_single_axes(machine, low, high):
    exits = first_exits(machine, np.concatenate((np.eye(6), -np.eye(6))))
    units = np.array([1.0, 1.0, 1.0, DEG, DEG, DEG])
    coarse = np.where(units == 1.0, 6e-4, 6e-2)
    assert np.all(np.abs(exits.reach[:6] / units - high) < coarse)
    assert np.all(np.abs(-exits.reach[6:] / units - low) < coarse)


def test_backward_surge_shrinks_when_the_nose_is_down():
    machine = science_fit()
    back = np.linspace(0.0, -0.3, 3001)
    poses = np.zeros((len(back), 6))
    poses[:, 0], poses[:, 4] = back, 12.0 * DEG
    good = reachable(machine, poses)
    assert back[np.argmin(good)] == pytest.approx(-0.115, abs=1e-3)


def test_corners_of_table_2_as_published(found):
    scales = np.array([corner.scale for corner in found.corners])
    counts = {size: int(np.sum(scales >= size)) for size in (0.2, 0.3, 0.4, 0.5, 1.0)}
    assert counts == {0.2: 64, 0.3: 30, 0.4: 2, 0.5: 0, 1.0: 0}
    own = np.array([corner.signs for corner in found.corners]) * compact().box
    assert np.array_equal(beyond(compact(), 0.3 * own) <= 0.0, scales >= 0.3)
    assert len({corner.signs for corner in found.corners}) == 64


def test_planes_edges_lie_on_the_limits_and_boxes_are_shared_out(found):
    assert [(one.first, one.second) for one in found.planes] == list(PAIRS)
    for plane in found.planes:
        poses = np.zeros((len(plane.edge), 6))
        poses[:, [plane.first, plane.second]] = plane.edge
        assert reachable(compact(), poses * (1.0 - 1e-6)).all()
        assert not reachable(compact(), poses * (1.0 + 1e-5)).any()
        # the share of the rectangle, counted: the planes of this machine are star-shaped
        half = compact().box[[plane.first, plane.second]]
        grid = np.linspace(-1.0, 1.0, 81)
        poses = np.zeros((81 * 81, 6))
        poses[:, plane.first] = np.repeat(grid, 81) * half[0]
        poses[:, plane.second] = np.tile(grid, 81) * half[1]
        assert plane.share == pytest.approx(reachable(compact(), poses).mean(), abs=0.02)
        corner = np.zeros(6)
        corner[[plane.first, plane.second]] = np.array(plane.worst.signs) * half
        assert reachable(compact(), plane.worst.scale * corner[None] * (1 - 1e-6))[0]
        assert not reachable(compact(), plane.worst.scale * corner[None] * (1 + 1e-5))[0]


def test_shares_and_ways_home_of_random_poses():
    whole, half, small = shares(compact(), compact().box)
    assert whole.reachable == pytest.approx(0.033, abs=0.01)
    assert half.reachable == pytest.approx(0.61, abs=0.03)
    assert small.reachable == pytest.approx(0.99, abs=0.01)
    assert half.stranded == pytest.approx(0.008, abs=0.005)
    assert small.stranded == 0.0
    drawn = np.random.default_rng(7).uniform(-1.0, 1.0, (3000, 6))
    science = science_fit()
    assert reachable(science, 0.5 * drawn * science.box).mean() == pytest.approx(0.60, abs=0.03)


def test_stranded_poses_are_those_that_the_guard_refuses():
    machine = compact()
    drawn = np.random.default_rng(5).uniform(-1.0, 1.0, (4000, 6)) * machine.box * 0.8
    # well inside, so that the guard's margins are no part of the question
    good = drawn[reachable(machine, drawn * 1.02) & reachable(machine, drawn)][:150]
    homes = np.stack((np.zeros(6), machine.parked_pose))
    refused = [check_ways_home(machine, one, homes, GUARD_MARGINS) is not None for one in good]
    lost = stranded(machine, good)
    assert lost.any()
    # the guard keeps margins to the limits, so it refuses a little more, never less
    assert not np.any(lost & ~np.array(refused))
    assert np.sum(np.array(refused) & ~lost) <= 0.03 * len(good)


def test_extremes_are_where_they_are_said_to_be(found):
    steady = conditioning(compact(), np.array([found.conditioning.pose]))[0]
    assert steady / neutral_conditioning(compact()) == pytest.approx(found.conditioning.value)
    assert found.conditioning.value >= 0.30
    assert found.conditioning.value < 0.31
    assert 0.5 < found.swing.value <= compact().joint_angle
    assert 1 <= found.swing.leg <= 6


def test_a_head_above_takes_from_the_tilt():
    found = survey(science_fit())
    pitch = next(one for one in found.about_head if one.name == "pitch")
    alone = next(one for one in found.ranges if one.name == "pitch")
    assert pitch.high < 0.6 * alone.high
    # by hand: the head stays in place when the reference point moves by arm - R arm
    angles = np.linspace(0.0, 12.0 * DEG, 2001)
    poses = np.zeros((len(angles), 6))
    poses[:, 4] = angles
    poses[:, 0] = -1.2 * np.sin(angles)
    poses[:, 2] = 1.2 * (1.0 - np.cos(angles))
    last = angles[np.argmax(beyond(science_fit(), poses) > 0.0)]
    assert pitch.high == pytest.approx(last, abs=0.02 * DEG)


def test_the_same_survey_twice(found):
    again = survey(compact())
    assert again.shares == found.shares
    assert again.ranges == found.ranges
    assert again.corners == found.corners
    assert again.conditioning == found.conditioning


def test_neutral_out_of_reach_is_said():
    with pytest.raises(ConfigError, match="neutral is beyond its own limits"):
        survey(replace(compact(), leg_max=1.0))


def test_a_smaller_box_is_reached_better(found):
    half = survey(compact(), frozen(0.5 * compact().box))
    assert half.machine_corners == found.corners
    for small, large in zip(half.corners, found.corners, strict=True):
        assert small.scale == pytest.approx(2.0 * large.scale, rel=1e-6)
