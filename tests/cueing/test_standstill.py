import numpy as np
import pytest

from motionserver.core.state import Stimulus
from motionserver.cueing.standstill import Standstill

INSTANTS = np.arange(1, 41) * 0.05


def ended(speed, force=-4.0, share=1.0, ahead=None):
    surge = np.full(40, force * share) if ahead is None else ahead.copy()
    Standstill(INSTANTS).end(
        surge, Stimulus(np.array([force * share, 0.0, 0.0]), np.zeros(3), share=share, speed=speed)
    )
    return surge


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_braking_ends_when_the_speed_is_used_up(share):
    surge = ended(4.1, share=share)
    # 4.1 m/s at 4 m/s2: 1.025 s
    assert surge[INSTANTS < 1.0] == pytest.approx(-4.0 * share)
    assert surge[INSTANTS > 1.03] == pytest.approx(0.0)


def test_reverse_gear_brakes_forward():
    surge = ended(-2.1, force=2.0)
    assert surge[0] == 2.0
    assert surge[-1] == 0.0
    assert (ended(2.1, force=2.0) == 2.0).all()


@pytest.mark.parametrize(
    ("speed", "share"), [(0.0, 1.0), (0.04, 1.0), (2.0, 0.01), (2.0, 0.0), (30.0, 1.0)]
)
def test_nothing_is_changed_without_knowledge_or_need(speed, share):
    assert (ended(speed, share=share) == -4.0 * share).all()


def test_a_creeping_vehicle_is_half_believed():
    sure = (0.1 - 0.05) / 0.25
    assert ended(0.1)[-1] == pytest.approx(-4.0 * (1.0 - sure))


def test_what_stopped_stays_stopped_though_the_forecast_swings_back():
    ahead = np.where(INSTANTS < 1.0, -6.0, 3.0)
    surge = ended(2.0, force=-6.0, ahead=ahead)
    assert (surge[INSTANTS > 0.4] == 0.0).all()
