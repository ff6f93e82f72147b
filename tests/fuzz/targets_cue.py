"""Decoders of our own cue: cues, statuses, and their way through the server's intake.

Each target takes bytes, says whether they were taken, and raises when an invariant is broken.
"""

import math
from types import SimpleNamespace

import zenoh
from demand import KEY, NOW, close, gravity_of, is_number, must, same, words
from motion_protocol import ProtocolError, decode_cue, decode_status, encode_cue, encode_status
from oracle_cue import read_cue, read_status

from motionserver.planner.inputs import Input, Inputs
from motionserver.planner.options import InputOptions
from motionserver.sources.base import SourceError
from motionserver.sources.native import NativeSource
from motionserver.sources.zenoh_input import _told


def refused(error, read):
    """The reason is one that the oracle allows; a named field is indeed wrong."""
    assert read.wrongs, f"refused without need: {error.reason}: {error}"
    assert error.reason in read.wrongs, f"{error.reason} told, {read.wrongs} found: {error}"
    words(error)
    if error.reason == "not_finite":
        words(error, error.field)
        assert not math.isfinite(read.floats[error.field]), f"{error.field} is finite"


def _cue(data, key):
    read = read_cue(data, key)
    try:
        cue = decode_cue(data, key)
    except ProtocolError as error:
        refused(error, read)
        return False
    assert not read.wrongs, f"taken in spite of {read.wrongs}"
    fields = read.fields
    for name in ("session", "sequence", "sim_time_ns", "sender_time_ns", "mode", "flags"):
        same(getattr(cue, name), fields[name], name)
    assert (cue.motion is None) == ("rates" not in fields)
    assert (cue.preview is None) == ("samples" not in fields)
    assert (cue.driver is None) == ("gear" not in fields)
    for part, names in (
        (cue.motion, ("acceleration", "rates", "attitude", "yaw", "speed", "reference")),
        (cue.preview, ("times", "samples") if "times" in fields else ("dt", "start", "samples")),
        (cue.driver, ("throttle", "brake", "clutch", "steering", "gear")),
    ):
        for name in names if part is not None else ():
            same(getattr(part, name), fields[name], name)
    again = encode_cue(cue, key)
    assert not read_cue(again, key).wrongs
    if read.plain:
        same(again, data, "written again")
    return True


def cue(data):
    return _cue(data, None)


def cue_signed(data):
    return _cue(data, KEY)


def _status(data, key):
    read = read_status(data, key)
    try:
        status = decode_status(data, key)
    except ProtocolError as error:
        refused(error, read)
        return False
    assert not read.wrongs, f"taken in spite of {read.wrongs}"
    for name, value in read.fields.items():
        own = "send_time_ns" if name == "sender_time_ns" else name
        same(getattr(status, own), value, own)
    if len(status.notice_text.encode()) > 240:
        # what was no UTF-8 has grown
        return True
    again = encode_status(status, key)
    assert not read_status(again, key).wrongs
    if read.plain:
        same(again, data, "written again")
    return True


def status(data):
    return _status(data, None)


def status_signed(data):
    return _status(data, KEY)


def native(data):
    """The server's reading of a cue: specific force, rates, preview."""
    read = read_cue(data, None)
    try:
        motion = NativeSource().decode(data, NOW)
    except SourceError as error:
        must(error.reason in read.wrongs, f"{error.reason} told, {read.wrongs} found")
        words(error)
        return False
    assert not read.wrongs, f"taken in spite of {read.wrongs}"
    is_number(motion.force, motion.rates, motion.speed)
    fields = read.fields
    same((motion.session, motion.sequence), (fields["session"], fields["sequence"]), "numbers")
    same(motion.at_platform, bool(fields["flags"] & 2), "flag measured")
    gravity = (0.0, 0.0, 9.81)
    if "rates" in fields:
        if fields["flags"] & 1:
            gravity = (0.0, 0.0, 0.0)
        elif fields["attitude"]:
            gravity = gravity_of(*fields["attitude"])
        close(motion.force, fields["acceleration"], gravity)
        same(tuple(motion.rates), fields["rates"], "rates")
    if "samples" in fields:
        preview = motion.preview
        is_number(preview.times, preview.force, preview.rates)
        assert len(preview.times) == len(fields["samples"])
        if "times" in fields:
            same(tuple(preview.times), fields["times"], "times")
        for told, sample in zip(preview.force, fields["samples"], strict=True):
            close(told, sample[:3], gravity)
    return True


class _Once:
    """A transport on which one datagram waits."""

    def __init__(self, data):
        self._waiting = [data]

    def drain(self):
        out, self._waiting = self._waiting, []
        return out


def _intake(kind, datagram):
    """A whole input of the planner with one datagram: nothing of it may end a period."""
    options = InputOptions(kind, "127.0.0.1", 4600, None, "motion/0/in/cue", ())
    inputs = Inputs([Input(options, _Once(datagram))], lambda: True)
    vehicle, sensor = inputs.poll()
    counted = inputs.counters
    assert counted["refused_decoder_failed"] == 0, inputs.last_error
    assert len(vehicle) + len(sensor) + counted["refused"] == counted["packets"] == 1
    for motion in (*vehicle, *sensor):
        is_number(motion.force, motion.rates, motion.speed)
        assert max(abs(motion.force)) <= 98.1 + 1e-9, "ten g are believed"
        assert max(abs(motion.rates)) <= math.radians(4000.0) + 1e-9
        preview = motion.preview
        if preview is not None:
            assert preview.times[0] >= 0.0
            assert all(preview.times[1:] > preview.times[:-1])
            assert abs(preview.force).max() <= 98.1 + 1e-9
    return vehicle, sensor


def zenoh_sample(data):
    """A sample of Zenoh on its way through intake."""
    sample = SimpleNamespace(payload=zenoh.ZBytes(data), key_expr="motion/0/in/cue")
    told = _told(sample)
    same(told[0], data, "payload")
    vehicle, sensor = _intake("zenoh", told)
    assert not (vehicle or sensor) or not read_cue(data, None).wrongs
    return bool(vehicle or sensor)


def imu(data):
    """An inertial sensor on the platform: only what is flagged as measured there."""
    vehicle, sensor = _intake("imu", (data, "127.0.0.1:5000", NOW))
    assert not vehicle, "the sensor's input drives"
    assert not sensor or read_cue(data, None).fields["flags"] & 2
    return bool(sensor)
