"""Previews that come by a key of their own, beside the packets that drive."""

import numpy as np
import pytest
from motion_protocol import Cue, Motion, encode_cue
from motion_protocol import Preview as WirePreview

from motionserver.core.state import Preview, VehicleMotion
from motionserver.planner.inputs import Input, Inputs
from motionserver.planner.options import InputOptions
from motionserver.planner.preview import PreviewInlet

MS = 1_000_000
MOTION = Motion((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), speed=10.0)
SAMPLES = tuple((float(k), 0.0, 0.0, 0.0, 0.0, 0.0) for k in range(10))


def cue(sequence: int, with_preview: bool = False, start: float = 0.1, session: int = 7) -> bytes:
    preview = WirePreview(0.1, start, SAMPLES) if with_preview else None
    return encode_cue(Cue(session, sequence, 0, sequence * 10 * MS, MOTION, preview=preview))


class Wire:
    """A transport whose datagrams the test lays down."""

    def __init__(self) -> None:
        self.waiting: list[tuple[bytes, str, int]] = []
        self.previews: list[tuple[bytes, str, int]] = []

    def drain(self) -> list[tuple[bytes, str, int]]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def drain_previews(self) -> list[tuple[bytes, str, int]]:
        waiting, self.previews = self.previews, []
        return waiting

    def reply(self, name: str, data: bytes) -> None: ...

    def close(self) -> None: ...


def rooms() -> tuple[Inputs, Wire, Wire]:
    """A native source that drives, and a Zenoh source with a preview key."""
    udp, zenoh = Wire(), Wire()
    native = InputOptions("native", "127.0.0.1", 1, None, "", ())
    other = InputOptions("zenoh", "127.0.0.1", 2, None, "in/cue", (), "in/preview")
    inputs = [Input(native, udp), Input(other, zenoh, drain_previews=zenoh.drain_previews)]
    return Inputs(inputs, lambda: True), udp, zenoh


def drive(inputs: Inputs, udp: Wire, k: int, with_preview: bool = False) -> VehicleMotion:
    udp.waiting = [(cue(k, with_preview), "a:1", k * 10 * MS)]
    vehicle, _ = inputs.poll()
    assert len(vehicle) == 1
    return vehicle[0]


def test_it_joins_the_packets_of_another_source_and_keeps_its_age() -> None:
    inputs, udp, zenoh = rooms()
    assert drive(inputs, udp, 1).preview is None
    zenoh.previews = [(cue(1, True), "zenoh:p", 15 * MS)]
    first, second = drive(inputs, udp, 2).preview, drive(inputs, udp, 3).preview
    assert first is not None
    assert second is not None
    # told 5 ms before the packet it first came along with
    assert first.times[:2] == pytest.approx([0.095, 0.195])
    assert first.force[3, 0] == pytest.approx(3.0)
    # the same table: what follows knows that it is no newer
    assert second.times is first.times
    zenoh.previews = [(cue(2, True), "zenoh:p", 35 * MS)]
    third = drive(inputs, udp, 4).preview
    assert third is not None
    assert third.times is not first.times
    assert inputs.counters["accepted_preview"] == 2
    assert inputs.vehicle.owner is not None
    assert inputs.vehicle.owner.address == "a:1"


def test_a_packets_own_preview_is_newer() -> None:
    inputs, udp, zenoh = rooms()
    zenoh.previews = [(cue(1, True, start=0.5), "zenoh:p", 5 * MS)]
    own = drive(inputs, udp, 1, with_preview=True).preview
    assert own is not None
    assert own.times[0] == pytest.approx(0.1)
    assert drive(inputs, udp, 2).preview is None


def test_it_is_not_handed_on_for_ever() -> None:
    inputs, udp, zenoh = rooms()
    zenoh.previews = [(cue(1, True), "zenoh:p", 5 * MS)]
    assert drive(inputs, udp, 1).preview is not None
    assert drive(inputs, udp, 250).preview is None


def test_what_is_refused_there_and_never_moves_the_platform() -> None:
    inputs, udp, zenoh = rooms()
    zenoh.previews = [
        (b"?", "zenoh:p", 1 * MS),
        (cue(1, False), "zenoh:p", 2 * MS),
        (cue(5, True), "zenoh:p", 3 * MS),
        (cue(5, True), "zenoh:p", 4 * MS),
        (cue(4, True), "zenoh:p", 5 * MS),
        (cue(6, True, session=8), "zenoh:p", 6 * MS),
        (cue(6, True, start=100.0), "zenoh:p", 7 * MS),
    ]
    vehicle, sensor = inputs.poll()
    assert (vehicle, sensor) == ([], [])
    assert inputs.vehicle.owner is None
    counters = inputs.counters
    assert counters["accepted_preview"] == 1
    for reason in ("size", "no_preview", "replayed", "reordered", "second_client", "out_of_range"):
        assert counters[f"refused_{reason}"] == 1, counters
    assert drive(inputs, udp, 1).preview is not None


def test_a_preview_newer_than_the_packet() -> None:
    inlet = PreviewInlet()
    still = np.array([0.0, 0.0, 9.81])
    told = Preview(np.array([0.1]), still[None], np.zeros((1, 3)))
    sender = VehicleMotion(30 * MS, 1, 1, None, still, np.zeros(3), preview=told)
    assert inlet.offer("z", "p", sender) is None
    motion = inlet.attach(VehicleMotion(10 * MS, 1, 1, None, still, np.zeros(3)))
    assert motion.preview is not None
    assert motion.preview.times == pytest.approx([0.12])
