"""The host's side of the Moog format against packets worked out by hand."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.core.device import Order, Phase
from motionserver.core.safety.setpoint import Setpoint
from motionserver.core.state import PlatformState
from motionserver.errors import ConfigError, PluginError
from motionserver.platforms import registry
from motionserver.platforms.base import PlatformOptions, PlatformPacketError
from motionserver.platforms.moog import Moog6Dof2000E

# x, y, z, roll, pitch, yaw in ISO 8855 of packet A4
POSE = np.array([0.05, 0.03, -0.02, *np.radians([2.0, 3.0, -5.0])])
A1 = "000000aa 00000000 00000000 be6a161e 00000000 00000000 00000000 00000000"
A2 = "000000b4 00000000 00000000 be6a161e 00000000 00000000 00000000 00000000"
A3 = "000000af 00000000 00000000 be6a161e 00000000 00000000 00000000 00000000"
A4 = "00000082 3d0efa35 bd567750 be559b3d 3d4ccccd 3db2b8c2 bcf5c28f 00000000"
A5A = "000000ac 3e19999a 3e23d70a 3e2e147b 3e3851ec 3e428f5c 3e4ccccd 00000000"
A5B = "00000082 3e19999a 3e23d70a 3e2e147b 3e3851ec 3e428f5c 3e4ccccd 00000000"
A6 = "000000d2 00000000 00000000 be6a161e 00000000 00000000 00000000 00000000"
A7 = "00000000 00000060 000000a3 3d0efa35 bd567750 be559b3d 3d4ccccd 3db2b8c2 bcf5c28f 00000000"
A8 = "00000008 00000001 000000a9" + " 00000000" * 7
A9 = "00000000 00000001 000000a1" + " 00000000" * 7
RESET = "000000a0 00000000 00000000 be6a161e 00000000 00000000 00000000 00000000"


def dof(**more):
    return Moog6Dof2000E(PlatformOptions(mode="dof", **more))


def length(**more):
    return Moog6Dof2000E(PlatformOptions(mode="length", length_offset=0.9022, **more))


def setpoint(order, pose=None, legs=None):
    state = PlatformState.at_rest(np.zeros(6) if pose is None else pose)
    return Setpoint(order, state, np.full(6, 1.0) if legs is None else legs)


def words(text):
    return bytes.fromhex(text)


@pytest.mark.parametrize(
    ("order", "golden"),
    [(Order.WAIT, A1), (Order.RAISE, A2), (Order.PARK, A6), (Order.RESET, RESET)],
)
def test_neutral_in_dof_mode(order, golden):
    assert dof().encode(setpoint(order)) == words(golden)


def same_words(found, golden):
    """Equal, but that minus zero and the last bit of a float word may differ."""
    one, two = struct.unpack(">I6fI", found), struct.unpack(">I6fI", words(golden))
    assert one == pytest.approx(two, rel=1.2e-7, abs=0.0)


def test_start_instead_of_engage():
    assert dof(engage_word=175).encode(setpoint(Order.RAISE)) == words(A3)
    with pytest.raises(ValueError, match="178"):
        dof(engage_word=178)


def test_a_pose_with_every_sign():
    same_words(dof().encode(setpoint(Order.FOLLOW, POSE)), A4)


@pytest.mark.parametrize(("order", "golden"), [(Order.WAIT, A5A), (Order.FOLLOW, A5B)])
def test_lengths(order, golden):
    legs = 0.9022 + np.array([0.15, 0.16, 0.17, 0.18, 0.19, 0.20])
    same_words(length().encode(setpoint(order, None, legs)), golden)


def test_legs_in_another_order():
    legs = 0.9022 + np.array([0.16, 0.15, 0.20, 0.19, 0.18, 0.17])
    other = length(leg_order=(1, 0, 5, 4, 3, 2))
    same_words(other.encode(setpoint(Order.FOLLOW, None, legs)), A5B)
    reply = struct.pack(">III6fI", 0, 0x60, 0x03, 0.15, 0.16, 0.17, 0.18, 0.19, 0.20, 0)
    assert other.decode(reply, 5).legs == pytest.approx(legs, abs=1e-7)


def test_a_reply_in_dof_mode():
    found = dof().decode(words(A7), 77)
    assert (found.arrival_ns, found.phase, found.state) == (77, Phase.UP, "ENGAGED")
    assert found.pose == pytest.approx(POSE, abs=1e-8)
    assert (found.legs, found.faults, found.estop) == (None, (), False)


def test_a_reply_with_a_fault():
    found = dof().decode(words(A8), 1)
    assert (found.phase, found.state) == (Phase.FAULTED, "FAULT2")
    assert found.faults == ("communication",)


def test_a_reply_at_home():
    found = dof().decode(words(A9), 1)
    assert (found.phase, found.state, found.faults) == (Phase.DOWN, "IDLE", ())
    assert found.pose == pytest.approx([0, 0, -0.2286, 0, 0, 0], abs=1e-8)
    away = bytearray(words(A9))
    away[7] = 0
    assert dof().decode(bytes(away), 1).phase is Phase.LOWERING


@pytest.mark.parametrize(
    ("nibble", "phase"),
    [
        (0x0, Phase.STARTING),
        (0x2, Phase.RAISING),
        (0x3, Phase.UP),
        (0x7, Phase.LOWERING),
        (0x8, Phase.FAULTED),
        (0x9, Phase.FAULTED),
        (0xA, Phase.FAULTED),
        (0xB, Phase.DISABLED),
        (0xC, Phase.DISABLED),
    ],
)
def test_states_of_the_base(nibble, phase):
    for above in (0x00, 0x60, 0xFFFFFF00):
        reply = struct.pack(">III6fI", 0, 1, nibble | above, *[0.0] * 6, 0)
        assert dof().decode(reply, 1).phase is phase


@pytest.mark.parametrize("nibble", [4, 5, 6, 0xD, 0xE, 0xF])
def test_states_that_do_not_exist(nibble):
    with pytest.raises(PlatformPacketError) as caught:
        dof().decode(struct.pack(">III6fI", 0, 1, nibble, *[0.0] * 6, 0), 1)
    assert caught.value.reason == "feedback_state"


def test_all_faults_and_the_emergency_stop():
    reply = struct.pack(">III6fI", 0xFFFF, 0x80, 0x09, *[0.0] * 6, 0)
    found = dof().decode(reply, 1)
    assert len(found.faults) == 16
    assert found.faults[0] == "E-stop"
    assert found.estop
    assert dof().decode(struct.pack(">III6fI", 0xFFFF0000, 0, 3, *[0.0] * 6, 0), 1).faults == ()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_values_that_are_no_numbers(value, place):
    values = [0.0] * 6
    values[place] = value
    with pytest.raises(PlatformPacketError) as caught:
        length().decode(struct.pack(">III6fI", 0, 1, 3, *values, 0), 1)
    assert caught.value.reason == "feedback_not_finite"


@given(st.binary(max_size=80) | st.binary(min_size=40, max_size=40))
def test_garbage_is_an_answer_or_an_error(data):
    for device in (dof(), length()):
        try:
            found = device.decode(data, 9)
        except PlatformPacketError:
            continue
        assert len(data) == 40
        measured = found.legs if found.pose is None else found.pose
        assert np.isfinite(measured).all()


@given(st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6).map(np.array))
def test_a_pose_comes_back(pose):
    sent = dof().encode(setpoint(Order.FOLLOW, pose))
    reply = struct.pack(">III", 0, 0x60, 0xA3) + sent[4:28] + bytes(4)
    assert dof().decode(reply, 1).pose == pytest.approx(pose, abs=1e-7)


def test_formats_by_name():
    assert "moog-6dof2000e" in registry.platform_names()
    assert registry.make_platform("moog-6dof2000e", PlatformOptions()).name == "moog-6dof2000e"
    with pytest.raises(ConfigError, match=r"Allowed: .*moog-6dof2000e"):
        registry.make_platform("moog", PlatformOptions())


class Point:
    name, value = "other", "other_maker:Format"

    def __init__(self, made):
        self._made = made

    def load(self):
        if isinstance(self._made, Exception):
            raise self._made
        return self._made


def test_a_third_partys_format(monkeypatch):
    monkeypatch.setattr(registry, "entry_points", lambda group: [Point(Moog6Dof2000E)])
    assert registry.make_platform("other", PlatformOptions()).name == "moog-6dof2000e"
    monkeypatch.setattr(registry, "entry_points", lambda group: [Point(ImportError("no such"))])
    with pytest.raises(PluginError, match=r"other_maker:Format.*no such"):
        registry.make_platform("other", PlatformOptions())
