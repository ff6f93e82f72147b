"""A car of its own for tests: dynamic single-track model, fourth-order Runge-Kutta, and a driver.

Nothing of the server's code is used. Pedals act 50 ms later through a lag of 0.22 s, engine power
is limited, the road goes gently up and down, the axles have stiffness and the body has inertia.
"""

import numpy as np

DT = 0.01
MASS, INERTIA, FRONT, REAR = 1600.0, 2600.0, 1.2, 1.5
STIFF_FRONT, STIFF_REAR = 9.0e4, 1.05e5
RATIO = 15.5
WHEELBASE = FRONT + REAR
UNDERSTEER = MASS / WHEELBASE * (REAR / STIFF_FRONT - FRONT / STIFF_REAR)
PEDAL_LAG, WHEEL_LAG, DEAD = 0.22, 0.05, 5


def _rate(x, throttle, brake, wheel, grade):
    speed, side, yaw, push, angle = x
    v = max(speed, 0.0)
    wanted = min(4.5, 45.0 / max(v, 1.0)) * throttle
    wanted -= 9.0 * brake * np.tanh(v / 0.1) + 0.1 * (v > 0) + 0.0004 * v * v
    pushing, turning = (wanted - push) / PEDAL_LAG, (wheel / RATIO - angle) / WHEEL_LAG
    if v < 1.5:
        goes = push if v > 0 or push > 0 else 0.0
        return np.array([goes, -5 * side, 10 * (v * angle / WHEELBASE - yaw), pushing, turning])
    front = STIFF_FRONT * (angle - (side + FRONT * yaw) / v)
    rear = -STIFF_REAR * (side - REAR * yaw) / v
    return np.array(
        [
            push - grade,
            (front + rear) / MASS - v * yaw,
            (FRONT * front - REAR * rear) / INERTIA,
            pushing,
            turning,
        ]
    )


def _script(count, rng):
    """Pedals and wheel a driver in traffic might use: (count, 3), given the speed live."""
    goal, until, wheel, turns = (0.4, 0.0), 0.0, 0.0, 0.0
    held = np.zeros(3)
    speed = 10.0
    for k in range(count):
        t = k * DT
        if t >= until:
            until = t + rng.uniform(1.5, 5.0)
            choices = [
                (rng.uniform(0.2, 1.0), 0.0),
                (rng.uniform(0.0, 0.3), 0.0),
                (0.0, rng.uniform(0.15, 0.6)),
                (0.0, 0.0),
            ]
            goal = choices[2 if speed > 24 else 0 if speed < 4 else rng.integers(0, 4)]
        if t >= turns:
            turns = t + rng.uniform(1.0, 4.0)
            size = min(1.6, 60.0 / max(speed, 4.0) ** 1.3)
            wheel = rng.choice([0, 0, 1, -1]) * rng.uniform(0.3, 1.0) * size
        step = np.array([goal[0], goal[1], wheel]) - held
        held = held + np.clip(step, [-4 * DT, -4 * DT, -2.5 * DT], [3 * DT, 4 * DT, 2.5 * DT])
        speed = yield held


def drive(seconds=90.0, seed=3, noise=0.05):
    """Drive.

    Returns:
        Specific force minus gravity (N, 3), rates (N, 3), speed (N,), controls (N, 3): throttle,
        brake, wheel angle.
    """
    rng = np.random.default_rng(seed)
    count = int(seconds / DT)
    force, rates = np.zeros((count, 3)), np.zeros((count, 3))
    speeds, controls = np.zeros(count), np.zeros((count, 3))
    x = np.array([10.0, 0.0, 0.0, 0.0, 0.0])
    script = _script(count, rng)
    for k in range(count):
        controls[k] = next(script) if k == 0 else script.send(x[0])
        acts = (*controls[max(0, k - DEAD)], 0.3 * np.sin(k * DT / 15.0))
        for _ in range(2):
            h = DT / 2
            k1 = _rate(x, *acts)
            k2 = _rate(x + h / 2 * k1, *acts)
            k3 = _rate(x + h / 2 * k2, *acts)
            k4 = _rate(x + h * k3, *acts)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            if x[0] < 0:
                x[:2] = 0.0
        moves = x[0] > 0 or x[3] > 0
        force[k] = [x[3] if moves else 0.0, _rate(x, *acts)[1] + x[0] * x[2], 0.0]
        rates[k, 2], speeds[k] = x[2], x[0]
    force += noise * rng.normal(size=force.shape)
    rates[:, 2] += 0.003 * rng.normal(size=count)
    return force, rates, speeds, controls
