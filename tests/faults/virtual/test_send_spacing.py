"""Packets to the platform keep apart in wall time, whatever stalls, dies or is refused."""

import errno
from collections.abc import Iterator
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from fittings import SECOND, fitted
from motion_clients.moog_wire import Mcw, decode_command
from world import SEND_HZ, World

from motionserver.core.safety.states import State
from motionserver.telemetry.link import GuardClock

PERIOD_NS = SECOND / SEND_HZ
LEG_SPEED = 0.6
"""What the emulated base's judge allows a leg [m/s]."""


@pytest.fixture
def world() -> Iterator[World]:
    made = World(3)
    with fitted(made):
        made.start()
        made.engage()
        made.run(0.5)
        yield made


def packets(world: World) -> list[tuple[int, bytes]]:
    return list(world.account.log.records)


def spacings(world: World) -> list[float]:
    """Times between neighbouring packets, in send periods."""
    return [(b - a) / PERIOD_NS for (a, _), (b, _) in pairwise(packets(world))]


def wall_speeds(world: World) -> list[float]:
    """Largest leg speed between neighbouring setpoints, by the instants they went out [m/s]."""
    speeds = []
    for (a, before), (b, after) in pairwise(packets(world)):
        old, new = decode_command(before), decode_command(after)
        if old.mcw == new.mcw == Mcw.NEW_POSITION:
            step = max(abs(y - x) for x, y in zip(old.words, new.words, strict=True))
            speeds.append(step / ((b - a) * 1e-9))
    return speeds


def assert_apart(world: World) -> None:
    assert min(spacings(world)) >= 0.8
    assert max(wall_speeds(world)) <= 1.25 * LEG_SPEED
    assert not world.account.problems()


def nominal_again(world: World) -> None:
    """The mean rate is the platform's, once nothing stalls."""
    world.run(0.2)
    before = len(packets(world))
    world.run(1.0)
    assert len(packets(world)) - before == pytest.approx(1.0 * SEND_HZ, abs=1)


def test_stalls_of_the_guard_do_not_bring_packets_closer(world: World) -> None:
    random = Random(150)
    for _ in range(60):
        world.run(random.uniform(0.02, 0.05))
        world.sleep(random.uniform(0.004, 0.03), planner=False)
    assert_apart(world)
    nominal_again(world)
    assert world.state is State.RUN


def test_work_between_clock_and_send_does_not_bring_packets_closer(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A whole check, or a processor given to others, lies between the clock and the packet."""
    random, send = Random(7), world.sendto

    def late(data: bytes, peer: Any) -> None:
        if random.random() < 0.3:
            world.now += int(random.uniform(0.0, 0.9) * PERIOD_NS)
        send(data, peer)
        if random.random() < 0.1:
            # stopped behind the packet, before it could be written down
            world.now += int(random.uniform(0.0, 0.9) * PERIOD_NS)

    monkeypatch.setattr(world, "sendto", late)
    world.run(2.0)
    assert_apart(world)
    monkeypatch.setattr(world, "sendto", send)
    nominal_again(world)


def test_a_successor_keeps_apart_from_the_packet_before(world: World) -> None:
    random = Random(23)
    for delay in (0.0005, 0.002, 0.006, 0.011, 0.0165, 0.02, 0.05):
        # a guard that has just taken over does not pass its state on
        world.run(random.uniform(1.05, 1.1))
        world.kill_guard()
        world.after(delay, world.start_guard)
        world.run(2.0 * delay)
    assert_apart(world)
    nominal_again(world)


@pytest.mark.parametrize("is_out", [True, False])
def test_a_successor_of_a_guard_that_died_about_its_packet_keeps_apart(
    world: World, monkeypatch: pytest.MonkeyPatch, is_out: bool
) -> None:
    """It died in the call that sends, after a stall in it: nobody has written down when."""

    class Death(BaseException):
        pass

    send = world.sendto

    def die(data: bytes, peer: Any) -> None:
        monkeypatch.setattr(world, "sendto", send)
        world.now += int(0.7 * PERIOD_NS)
        if is_out:
            send(data, peer)
        world.kill_guard()
        world.after(0.002, world.start_guard)
        raise Death

    for _ in range(3):
        world.run(1.1)
        monkeypatch.setattr(world, "sendto", die)
        with pytest.raises(Death):
            world.run(0.1)
        world.run(0.1)
    assert_apart(world)
    assert world.state is State.RUN


def test_packets_that_were_refused_are_sent_again_apart(world: World) -> None:
    random = Random(31)
    for _ in range(15):
        world.run(random.uniform(0.03, 0.1))
        world.refuses_to_send = OSError(errno.ENETUNREACH, "network is unreachable")
        world.run(random.uniform(0.005, 0.05))
        world.refuses_to_send = None
        world.sleep(random.uniform(0.0, 0.02), planner=False)
    assert_apart(world)
    nominal_again(world)


def test_the_planner_is_told_the_instant_the_next_packet_is_due(world: World) -> None:
    told: list[tuple[int, int]] = []

    def look() -> None:
        clock = GuardClock.unpack(world.files.clock.read()[1])
        told.append((world.now, clock.due_ns))

    world.watchers.append(look)
    random = Random(5)
    for _ in range(40):
        world.run(random.uniform(0.05, 0.1))
        world.sleep(random.uniform(0.004, 0.03), planner=False)
    world.run(0.1)
    instants = [at for at, _ in packets(world)]
    dues = [due for _, due in told]
    for now, due in told[200:-40]:
        following = next((at for at in instants if at > now), None)
        assert following is not None
        # a stall may come between; nothing is sent before the instant that was told
        assert following >= due
    assert len(set(dues)) > 40
