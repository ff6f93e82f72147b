import struct
from math import radians

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_clients.moog_wire import (
    Command,
    CommandMode,
    DiscreteIo,
    DofAxes,
    Fault,
    MachineState,
    Mcw,
    Status,
    decode_command,
    encode_status,
)

NEUTRAL = "00000000 00000000 be6a161e 00000000 00000000 00000000 00000000"
POSE = "3d0efa35 bd567750 be559b3d 3d4ccccd 3db2b8c2 bcf5c28f"
LENGTHS = "3e19999a 3e23d70a 3e2e147b 3e3851ec 3e428f5c 3e4ccccd 00000000"
POSE_WORDS = (radians(2), radians(-3), -0.2086, 0.05, radians(5), -0.03)
ZEROS = "00000000 " * 6

COMMANDS = {
    "A1": ("000000aa", NEUTRAL, Mcw.DOF_MODE, (0, 0, -0.2286, 0, 0, 0)),
    "A2": ("000000b4", NEUTRAL, Mcw.ENGAGE, (0, 0, -0.2286, 0, 0, 0)),
    "A3": ("000000af", NEUTRAL, Mcw.START, (0, 0, -0.2286, 0, 0, 0)),
    "A4": ("00000082", POSE + " 00000000", Mcw.NEW_POSITION, POSE_WORDS),
    "A5a": ("000000ac", LENGTHS, Mcw.LENGTH_MODE, (0.15, 0.16, 0.17, 0.18, 0.19, 0.20)),
    "A5b": ("00000082", LENGTHS, Mcw.NEW_POSITION, (0.15, 0.16, 0.17, 0.18, 0.19, 0.20)),
    "A6": ("000000d2", NEUTRAL, Mcw.PARK, (0, 0, -0.2286, 0, 0, 0)),
}
DOF = CommandMode.DOF
STATUSES = {
    "A7": (
        f"00000000 00000060 000000a3 {POSE} 00000000",
        Status(
            Fault(0),
            DiscreteIo.AMPLIFIER_ENABLE | DiscreteIo.DRIVE_BUS,
            MachineState.ENGAGED,
            DOF,
            POSE_WORDS,
        ),
    ),
    "A8": (
        f"00000008 00000001 000000a9 {ZEROS} 00000000",
        Status(Fault.COMM, DiscreteIo.BASE_AT_HOME, MachineState.FAULT2, DOF, (0.0,) * 6),
    ),
    "A9": (
        f"00000000 00000001 000000a1 {ZEROS} 00000000",
        Status(Fault(0), DiscreteIo.BASE_AT_HOME, MachineState.IDLE, DOF, (0.0,) * 6),
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_golden_command_is_decoded(name):
    head, tail, mcw, words = COMMANDS[name]
    command = decode_command(bytes.fromhex(head + tail))
    assert command.mcw == mcw
    assert command.words == pytest.approx(words, abs=1e-8)


@pytest.mark.parametrize("name", STATUSES)
def test_golden_status_is_encoded(name):
    golden, status = STATUSES[name]
    assert encode_status(status) == bytes.fromhex(golden)


def test_length_status_clears_both_mode_fields():
    status = Status(Fault(0), DiscreteIo(0), MachineState.PARKING, CommandMode.LENGTH, (0.0,) * 6)
    assert encode_status(status)[8:12].hex() == "00000007"


def test_only_the_low_byte_commands():
    datagram = struct.pack("!I6fI", 102 << 8 | 130, *(0.0,) * 6, 0xFFFFFFFF)
    assert decode_command(datagram) == Command(Mcw.NEW_POSITION, (0.0,) * 6)


def test_pose_of_the_worked_packet_is_iso():
    pose = DofAxes().to_pose(POSE_WORDS)
    want = (0.05, 0.03, -0.02, radians(2), radians(3), radians(-5))
    assert pose == pytest.approx(want, abs=1e-12)


def test_newer_revision_counts_heave_from_neutral():
    assert DofAxes(heave_neutral=0.0).to_pose((0, 0, -0.1, 0, 0, 0))[2] == pytest.approx(0.1)


@given(pose=st.tuples(*[st.floats(-1, 1)] * 6), signs=st.tuples(*[st.sampled_from((1, -1))] * 6))
def test_axes_go_there_and_back(pose, signs):
    axes = DofAxes(signs=signs)
    assert axes.to_pose(axes.to_words(pose)) == pytest.approx(pose, abs=1e-12)


@given(datagram=st.binary(min_size=32, max_size=32))
def test_any_32_bytes_decode(datagram):
    command = decode_command(datagram)
    assert 0 <= command.mcw <= 255
    assert len(command.words) == 6


@given(datagram=st.binary(max_size=100).filter(lambda data: len(data) != 32))
def test_any_other_length_is_refused(datagram):
    with pytest.raises(ValueError, match="exactly 32"):
        decode_command(datagram)
