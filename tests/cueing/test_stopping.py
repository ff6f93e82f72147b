import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.plan import Plan
from motionserver.cueing.stopping import with_stop

real = st.floats(-1.0, 1.0)


@settings(deadline=None)
@given(real, real, real, st.floats(0.1, 1.0))
def test_the_stop_is_the_quartic(x, v, a, duration):
    tables = (np.full((1, 6), value) for value in (x, v, a))
    times, pose, velocity, acceleration = with_stop(np.zeros(1), *tables, duration)
    assert pose[-1, 0] == pytest.approx(x + v * duration / 2 + a * duration**2 / 12)
    plan = Plan(1, 0, 0.0, times, pose, velocity, acceleration)
    s = np.linspace(0, 1, 9)
    # the speed is the cubic with v, a at the start and 0, 0 at the end
    cubic = v * (1 - 3 * s**2 + 2 * s**3) + a * duration * (s - 2 * s**2 + s**3)
    assert plan.evaluate(s * duration)[1][:, 0] == pytest.approx(cubic, abs=1e-7)
