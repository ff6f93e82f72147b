import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_clients.leg_servos import LegServos

DT = 0.002
STROKE = 0.2789


def servos():
    return LegServos([0.1] * 6, stroke=STROKE, speed=0.78, acceleration=10.4)


@given(targets=st.lists(st.tuples(*[st.floats(-0.5, 0.8)] * 6), max_size=12))
@settings(max_examples=40, deadline=None)
def test_no_target_makes_a_leg_leave_its_speed_acceleration_or_stroke(targets):
    legs = servos()
    for target in [*targets, None]:
        if target is None:
            legs.brake()
        else:
            legs.follow(target, 1 / 60)
        for _ in range(20):
            before, at = list(legs.speeds), list(legs.extensions)
            legs.step(DT)
            for i in range(6):
                assert 0.0 <= legs.extensions[i] <= STROKE
                assert abs(legs.speeds[i]) <= 0.78 + 1e-9
                is_at_stop = legs.extensions[i] in (0.0, STROKE)
                assert is_at_stop or abs(legs.speeds[i] - before[i]) <= 10.4 * DT + 1e-9
                assert abs(legs.extensions[i] - at[i]) <= 0.78 * DT + 1e-9


def test_gentle_move_keeps_its_speed_and_arrives():
    legs = servos()
    legs.move_gently([0.2] * 6, 0.1, 0.5)
    fastest = 0.0
    for _ in range(2000):
        legs.step(DT)
        fastest = max(fastest, *legs.speeds)
    assert fastest <= 0.102
    assert legs.is_at_rest
    assert legs.extensions == pytest.approx([0.2] * 6, abs=1e-5)


def test_braking_stands_and_stays():
    legs = servos()
    legs.follow([0.11] * 6, 1 / 60)
    for _ in range(8):
        legs.step(DT)
    assert not legs.is_at_rest
    legs.brake()
    for _ in range(100):
        legs.step(DT)
    assert legs.is_at_rest
    assert legs.target == tuple(legs.extensions)


def test_stuck_leg_stays_while_the_others_arrive():
    legs = servos()
    legs.stuck.add(2)
    legs.move([0.12] * 6, 1.0)
    for _ in range(700):
        legs.step(DT)
    assert legs.extensions[2] == 0.1
    assert legs.extensions[0] == pytest.approx(0.12, abs=1e-5)
    assert legs.is_at_rest
