"""A crowd at a real socket: strangers are named while it is calm, kept out while it is not."""

import contextlib
import select
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from motion_protocol import Cue, Mode, Motion, encode_cue

from motionserver.planner import crowd, inputs
from motionserver.planner.crowd import CALM_NS, MANY
from motionserver.planner.inputs import Inputs, open_input
from motionserver.planner.options import InputOptions
from motionserver.sources import udp

MOTION = Motion((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
KEY = bytes(range(32))


class Scene:
    """One signed input, its client, a stranger, and a clock the test turns."""

    def __init__(self, client: socket.socket, stranger: socket.socket) -> None:
        self.client, self.stranger = client, stranger
        options = InputOptions("native", "127.0.0.1", 0, KEY, "", ())
        self.input = open_input(options)
        self.inputs = Inputs([self.input], lambda: True)
        self.there = self.input.transport.address  # type: ignore[attr-defined]
        self.sequence = 0
        self.ahead = 0

    def now(self) -> int:
        return time.monotonic_ns() + self.ahead

    def say(self, mode: Mode = Mode.DRIVE) -> None:
        self.sequence += 1
        self.client.sendto(
            encode_cue(Cue(7, self.sequence, 0, self.now(), MOTION, mode), KEY), self.there
        )

    def flood(self, count: int = 300, data: bytes = b"x" * 99) -> None:
        for _ in range(count):
            self.stranger.sendto(data, self.there)

    def poll(self) -> int:
        """Wait for something to read, and read: a busy kernel delivers later, even on loopback."""
        select.select([self.input.transport.socket], [], [], 10.0)  # type: ignore[attr-defined]
        return len(self.inputs.poll()[0])

    def crowd_in(self, data: bytes = b"x" * 99) -> None:
        """Flood until it is seen."""
        for _ in range(100):
            if self.filter != "open":
                return
            self.flood(data=data)
            self.poll()

    @property
    def filter(self) -> str:
        return self.inputs.filters[self.input.name]


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    with contextlib.ExitStack() as stack:
        links = [
            stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2)
        ]
        links[0].bind(("127.0.0.1", 0))
        made = Scene(*links)
        monkeypatch.setattr(inputs, "now_ns", made.now)
        monkeypatch.setattr(udp, "time", SimpleNamespace(monotonic_ns=made.now))
        yield made
        made.inputs.close()


def test_a_few_strangers_are_refused_by_name(scene: Scene) -> None:
    scene.say()
    assert scene.poll() == 1
    scene.flood(MANY - 1)
    while scene.inputs.counters["refused_magic"] < MANY - 1:
        scene.poll()
    assert scene.filter == "open"
    assert scene.inputs.counters["dropped_by_kernel"] == 0


def test_in_a_flood_the_owner_loses_nothing_once_it_is_seen(scene: Scene) -> None:
    scene.say()
    assert scene.poll() == 1
    scene.crowd_in()
    host, port = scene.client.getsockname()
    assert scene.filter == f"crowd: {host}:{port} let in"
    scene.inputs.poll()
    before = scene.inputs.counters["packets"]
    believed = 0
    for _ in range(50):
        scene.flood(100)
        scene.say()
        scene.flood(100)
        believed += scene.poll()
    # a kernel that is out of breath loses one before it reaches any socket
    assert believed >= 48
    assert scene.inputs.counters["packets"] - before <= 50
    assert scene.inputs.counters["dropped_by_kernel"] > 40 * 200


def test_what_the_kernel_drops_keeps_the_door_shut(scene: Scene) -> None:
    scene.say()
    assert scene.poll() == 1
    scene.crowd_in()
    shut = scene.filter
    for _ in range(12):
        scene.ahead += CALM_NS // 4
        scene.flood()
        scene.say()
        scene.poll()
        assert scene.filter == shut


def test_without_an_owner_impossible_lengths_are_kept_out(scene: Scene) -> None:
    scene.crowd_in(b"short")
    assert scene.filter == "crowd: all let in"
    scene.inputs.poll()
    scene.flood(data=b"short")
    scene.flood(data=bytes(1201))
    scene.say()
    assert scene.poll() == 1


@pytest.mark.parametrize("leaves_by", ["bye", "silence"])
def test_the_door_opens_when_the_owner_leaves(scene: Scene, leaves_by: str) -> None:
    scene.say()
    assert scene.poll() == 1
    scene.crowd_in()
    if leaves_by == "bye":
        scene.say(Mode.BYE)
        assert scene.poll() == 1
    else:
        for _ in range(5):
            scene.ahead += CALM_NS // 4
            scene.flood()
            scene.inputs.poll()
    scene.inputs.poll()
    assert scene.filter in ("crowd: all let in", "open")
    # the next client comes from another port
    scene.client, scene.stranger = scene.stranger, scene.client
    scene.say()
    while scene.poll() == 0:
        pass
    assert scene.inputs.vehicle.owner is not None
    assert scene.inputs.vehicle.owner.address.endswith(f":{scene.client.getsockname()[1]}")


def test_after_two_calm_seconds_everybody_is_heard_again(scene: Scene) -> None:
    scene.crowd_in()
    scene.ahead += CALM_NS // 2
    scene.inputs.poll()
    assert scene.filter != "open"
    scene.ahead += 2 * CALM_NS
    scene.inputs.poll()
    scene.inputs.poll()
    assert scene.filter == "open"
    scene.flood(3, b"?")
    while scene.inputs.counters["refused_size"] < 3:
        scene.poll()


def test_where_the_kernel_refuses_it_is_told(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crowd, "sieve", lambda *_: "no filters here")
    scene.crowd_in()
    assert scene.filter == "none: no filters here"
    scene.ahead += 2 * CALM_NS
    scene.inputs.poll()
    scene.inputs.poll()
    assert scene.filter == "none: no filters here"
