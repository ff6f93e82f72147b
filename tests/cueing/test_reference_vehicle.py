"""The vehicle model on a car it knows nothing of, and on everything that can go wrong with it."""

import numpy as np
import own_vehicle
import pytest

from motionserver.core.state import Driver, Stimulus
from motionserver.cueing.reference import Reference, believable

HORIZONS = np.array([0.25, 0.5, 1.0])
STANDS = Driver(0.0, 0.0, 0.0, 0.0, 1)


@pytest.fixture(scope="module")
def car():
    return own_vehicle.drive(60.0)


def stimuli(car, share=0.6, wheel=1.0):
    force, rates, speed, controls = car
    for k in range(len(speed)):
        throttle, brake, steering = controls[k]
        driver = Driver(throttle, brake, 0.0, wheel * steering, 2)
        yield Stimulus(
            share * force[k], share * rates[k], share=share, speed=speed[k], driver=driver
        )


def run(model, stimuli):
    return np.stack([model.predict(believable(one)) for one in stimuli])


def errors(told, truth, begin=1000):
    """Rms error per horizon, (K, 6)."""
    out = []
    for index, horizon in enumerate(HORIZONS):
        shift = round(horizon / 0.01)
        missed = told[begin:-shift, index] - truth[begin + shift :]
        out.append(np.sqrt(np.mean(missed**2, axis=0)))
    return np.array(out)


def test_pedals_and_wheel_foretell_more_than_the_past_does(car):
    truth = 0.6 * np.concatenate(car[:2], axis=1)
    vehicle, ar = (
        errors(run(Reference(name, 0.01, HORIZONS, 0.0), stimuli(car)), truth)
        for name in ("vehicle", "ar")
    )
    # surge, sway, yaw rate; the further ahead, the more depends on what the driver does next
    assert (vehicle[:, 0] < np.array([0.85, 0.85, 0.94]) * ar[:, 0]).all()
    assert (vehicle[:, 1] < np.array([0.9, 0.94, 0.95]) * ar[:, 1]).all()
    assert (vehicle[:, 5] < np.array([0.6, 0.75, 0.97]) * ar[:, 5]).all()


def test_the_parameters_become_those_of_the_car(car):
    model = Reference("vehicle", 0.01, HORIZONS, 0.0)
    run(model, stimuli(car))
    plant = model._axes._plant
    ratio, understeer = plant.turn.theta[plant.turn.best]
    assert ratio == pytest.approx(own_vehicle.RATIO * own_vehicle.WHEELBASE, rel=0.1)
    assert understeer == pytest.approx(own_vehicle.RATIO * own_vehicle.UNDERSTEER, rel=0.3)
    throttle, brake, drag, _ = plant.surge.theta[plant.surge.best]
    assert 2.0 < throttle < 4.6
    assert brake == pytest.approx(9.0, rel=0.15)
    assert drag >= 0.0


def test_it_learns_from_all_of_the_turning_though_only_its_onset_is_shown(car):
    whole, onset = (Reference("vehicle", 0.01, HORIZONS, 0.0) for _ in range(2))
    for one in list(stimuli(car))[:1500]:
        told = whole.predict(one)
        shown = Stimulus(
            one.force, 0.0 * one.rates, share=one.share, speed=one.speed, driver=one.driver
        )
        part = onset.predict(shown, one.rates)
    assert part[:, :2] == pytest.approx(told[:, :2])
    assert part[:, 5] == pytest.approx(told[:, 5] - one.rates[2] * np.exp(-HORIZONS))


def test_a_wheel_with_the_wrong_sign_is_not_trusted(car):
    model = Reference("vehicle", 0.01, HORIZONS, 0.0)
    truth = 0.6 * np.concatenate(car[:2], axis=1)
    wrong = errors(run(model, stimuli(car, wheel=-1.0)), truth)
    ar = errors(run(Reference("ar", 0.01, HORIZONS, 0.0), stimuli(car)), truth)
    assert model._axes.trust[1] < 0.3
    assert (wrong[:, 1] < 1.15 * ar[:, 1]).all()


def without_driver(one):
    return Stimulus(one.force, one.rates, share=one.share, speed=one.speed)


def test_without_a_driver_it_is_the_autoregressive_model_and_says_so(car):
    silent = [without_driver(one) for one in stimuli(car)]
    truth = 0.6 * np.concatenate(car[:2], axis=1)
    model = Reference("vehicle", 0.01, HORIZONS, 0.0)
    # not to the last digit: they learn in different periods
    assert errors(run(model, silent), truth)[:, :2] == pytest.approx(
        errors(run(Reference("ar", 0.01, HORIZONS, 0.0), silent), truth)[:, :2], rel=0.06
    )
    assert model.describe() == "vehicle: no driver inputs, ar instead"


def test_a_driver_that_comes_and_goes_makes_no_step(car):
    known = list(stimuli(car))[:3000]
    comes_and_goes = [one if (k // 500) % 2 else without_driver(one) for k, one in enumerate(known)]
    model, always, never = (Reference("vehicle", 0.01, HORIZONS, 0.0) for _ in range(3))
    out = run(model, comes_and_goes)
    told = run(always, known)
    plain = run(never, [without_driver(one) for one in known])
    own_step = max(np.abs(np.diff(each[:, :, :2], axis=0)).max() for each in (told, plain))
    # besides what the forecasts do by themselves: their difference times a step of the presence
    between = np.abs(told - plain)[:, :, :2].max() * 0.01 / 0.5
    assert np.abs(np.diff(out[:, :, :2], axis=0)).max() < 2.0 * own_step + 2.0 * between
    assert model.describe().startswith("vehicle: trusted")


def test_a_cue_too_small_teaches_nothing(car):
    model = Reference("vehicle", 0.01, HORIZONS, 0.0)
    before = model._axes._plant.surge.theta.copy()
    assert np.isfinite(run(model, list(stimuli(car, share=0.01))[:300])).all()
    assert model.describe() == "vehicle: cue too small, ar instead"
    assert (model._axes._plant.surge.theta == before).all()


@pytest.mark.parametrize(
    "driver",
    [
        Driver(np.nan, 0.0, 0.0, 0.0, 1),
        Driver(0.0, 0.0, 0.0, np.inf, 1),
        Driver(7.0, -3.0, 2.0, 1e9, -1),
        Driver(1.0, 1.0, 0.0, 3.0, -1),
        Driver(1.0, 0.0, 1.0, -8.0, 0),
    ],
)
@pytest.mark.parametrize("speed", [0.0, -3.0, 60.0, np.nan])
def test_wild_controls_stay_bounded(driver, speed):
    rng = np.random.default_rng(0)
    model = Reference("vehicle", 0.01, HORIZONS, 0.0)
    for k in range(400):
        wild = driver if k % 3 else STANDS
        one = Stimulus(3 * rng.normal(size=3), rng.normal(size=3), speed=speed, driver=wild)
        out = model.predict(believable(one))
        assert np.isfinite(out).all()
        assert np.abs(out[:, :2]).max() < 60.0


def test_reverse_gear_drives_backwards_and_brakes_forwards():
    # a car of one line: 3 m/s2 per throttle, 8 per brake, a lag of 0.2 s
    force, speed, found = 0.0, 0.0, []
    model = Reference("vehicle", 0.01, HORIZONS, 0.0)
    for k in range(6000):
        t = (0.01 * k) % 6.0
        backwards = k >= 3000
        sign = -1.0 if backwards else 1.0
        throttle, brake = (0.8, 0.0) if t < 2.0 else (0.0, 0.5 if t > 3.0 and speed else 0.0)
        push = sign * 3.0 * throttle - 8.0 * brake * np.sign(speed)
        force += (push - force) * 0.01 / 0.2
        faster = speed + 0.01 * force
        if speed * faster < 0.0:
            faster = force = 0.0
        speed = faster
        driver = Driver(throttle, brake, 0.0, 0.0, -1 if backwards else 1)
        one = Stimulus(np.array([force, 0, 0]), np.zeros(3), speed=speed, driver=driver)
        out = model.predict(believable(one))
        if backwards and abs(t - 0.05) < 1e-6:
            found.append(out[1, 0])
    # half a second after the throttle in reverse, foretold 50 ms after it went down
    assert len(found) > 2
    assert (np.array(found[1:]) < -1.2).all()
