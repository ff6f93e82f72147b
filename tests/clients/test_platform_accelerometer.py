from math import cos, hypot, pi, sin

import pytest
from moog_host import VirtualHost
from motion_clients.moog_config import MoogConfig
from motion_clients.moog_device import MoogDevice
from motion_clients.platform_accelerometer import GRAVITY, PlatformAccelerometer

HOME = (0.0, 0.0, -0.17, 0.0, 0.0, 0.0)


def instrumented(**noise):
    readings = []
    sensor = PlatformAccelerometer(
        MoogConfig().geometry, lambda *reading: readings.append(reading), pose=HOME, **noise
    )
    return VirtualHost(MoogDevice(on_step=sensor.on_step)), readings


def test_standing_platform_feels_gravity_a_hundred_times_a_second():
    host, readings = instrumented(force_noise=0.0, rate_noise=0.0)
    host.be_silent(0.0)
    host.be_silent(2.0)
    assert len(readings) == 199
    for _, force, rates in readings:
        assert force == pytest.approx((0, 0, GRAVITY), abs=1e-6)
        assert rates == pytest.approx((0, 0, 0), abs=1e-6)
    assert readings[1][0] - readings[0][0] == pytest.approx(0.01)


def test_tilted_platform_feels_gravity_backwards():
    host, readings = instrumented(force_noise=0.0, rate_noise=0.0)
    host.engage()
    # Device pitch is nose up: minus 0.1 rad on the wire is nose down.
    host.play(2.0, lambda t: (0, -0.1 * min(1.0, t), -0.2286, 0, 0, 0))
    force = readings[-1][1]
    assert force == pytest.approx((-GRAVITY * sin(0.1), 0, 9.758), abs=0.02)
    assert max(rates[1] for _, _, rates in readings) == pytest.approx(0.1, rel=0.3)


def test_shaken_platform_feels_the_commanded_acceleration():
    host, readings = instrumented(force_noise=0.0, rate_noise=0.0)
    host.engage()
    omega, amplitude = 2 * pi * 0.5, 0.05
    host.play(6.0, lambda t: (0, 0, -0.2286, amplitude * sin(omega * t), 0, 0))
    late = [(now, force[0]) for now, force, _ in readings if now > host.now - 4.0]
    in_phase = 2 / len(late) * sum(f * sin(omega * now) for now, f in late)
    across = 2 / len(late) * sum(f * cos(omega * now) for now, f in late)
    assert hypot(in_phase, across) == pytest.approx(amplitude * omega**2, rel=0.03)


def test_noise_is_white_and_seeded():
    runs = []
    for _ in range(2):
        host, readings = instrumented(force_noise=0.05, rate_noise=0.002, seed=7)
        host.be_silent(0.0)
        host.be_silent(5.0)
        runs.append(readings)
    assert runs[0] == runs[1]
    values = [force[0] for _, force, _ in runs[0]]
    assert (sum(v * v for v in values) / len(values)) ** 0.5 == pytest.approx(0.05, rel=0.2)
