"""What is said of a packet whose values no vehicle has."""

import math

import numpy as np
import pytest
from motions import motion, preview

from motionserver.core.intake.ranges import out_of_range


def test_nothing_is_said_of_what_vehicles_do() -> None:
    assert out_of_range(motion()) == ""
    assert out_of_range(motion(attitude=(0.1, -0.1), preview=preview([0.0, 0.1]))) == ""


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"attitude": (170.0, 0.0)}, "roll 170 rad is beyond pi, no attitude: is it in degrees?"),
        (
            {"attitude": (0.0, -12.5)},
            "pitch -12.5 rad is beyond pi/2, no attitude: is it in degrees?",
        ),
        (
            {"force": (98.2, 0.0, -9.8123)},
            "specific force (98.2, 0, -9.812) m/s2 is beyond 10 g: is it sent in m/s2?",
        ),
        (
            {"rates": (0.0, -70.0, 1.0)},
            "body rates (0, -70, 1) rad/s are beyond 4000 deg/s: are they in rad/s?",
        ),
        ({"speed": 12345.6}, "speed 1.235e+04 m/s is beyond 1000 m/s: is it sent in m/s?"),
        ({"preview": preview([0.1, 0.1])}, "preview times must rise from 0 to at most 60 s"),
        (
            {"preview": preview([0.1], x=100.0)},
            "preview: a specific force is beyond 10 g: is it sent in m/s2?",
        ),
        (
            {"preview": preview([0.1], rate=71.0)},
            "preview: a body rate is beyond 4000 deg/s: is it sent in rad/s?",
        ),
    ],
)
def test_what_no_vehicle_does_is_named_with_its_unit(wrong, said) -> None:
    assert out_of_range(motion(**wrong)) == said


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_microradian_is_left_to_rounding(sign) -> None:
    for most, attitude in (
        (math.pi + 1e-6, lambda angle: (angle, 0.0)),
        (math.pi / 2.0 + 1e-6, lambda angle: (0.0, angle)),
    ):
        assert out_of_range(motion(attitude=attitude(sign * most))) == ""
        beyond = sign * float(np.nextafter(most, 9.0))
        assert "is beyond pi" in out_of_range(motion(attitude=attitude(beyond)))
