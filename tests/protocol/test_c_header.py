"""The C header, compiled: offsets as in the byte tables, packets as in the golden vectors."""

import hashlib
import hmac
import shutil
import socket
import subprocess
from pathlib import Path

import pytest
from motion_protocol import Mode, decode_cue

ROOT = Path(__file__).parents[2]
VECTORS = ROOT / "protocol" / "vectors"
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc, clang) found")
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1", f"-I{ROOT / 'protocol'}"]
KEY = bytes(range(32))

OFFSETS = {
    "header": (
        "magic 0 version_major 4 version_minor 5 incompat 6 compat 7 payload_length 8 flags 10 "
        "mode 12 reserved 13 session 16 sequence 20 sim_time_ns 24 sender_time_ns 32 crc 40",
        44,
    ),
    "block": ("type 0 length 2", 4),
    "motion": (
        "acceleration 0 rates 12 roll 24 pitch 28 yaw 32 speed 36 reference 40 valid 41",
        44,
    ),
    "preview": ("count 0 dt 4 start 8", 12),
    "timed_preview": ("count 0 reserved 2", 4),
    "driver": ("throttle 0 brake 4 clutch 8 steering 12 gear 16", 20),
    "status": (
        "echo_sender_time_ns 0 receive_time_ns 8 echo_sequence 16 accepted_sequence 20 "
        "lost 24 reordered 28 rejected 32 scale 36 state 40",
        44,
    ),
    "notice": ("kinds 0 reserved 2", 4),
}

PROGRAM = """
#include <stdio.h>
#include "motion_hmac.h"
static void show(const char *name, const uint8_t *data, size_t size) {
  printf("%s ", name);
  for (size_t i = 0; i < size; ++i) printf("%02x", data[i]);
  printf("\\n");
}
int main(void) {
  uint8_t packet[MOTION_MAX_DATAGRAM], key[100], digest[32];
  for (int i = 0; i < 100; ++i) key[i] = (uint8_t)i;
  motion_cue cue = {0};
  cue.session = 0x11223344; cue.sequence = 1;
  cue.sim_time_ns = 1000000000u; cue.sender_time_ns = 2000000000u;
  cue.acceleration[0] = 1.0f; cue.acceleration[1] = -2.0f; cue.acceleration[2] = 0.5f;
  cue.rates[2] = 0.25f;
  size_t size = motion_encode_cue(packet, sizeof packet, &cue);
  show("cue_minimal", packet, size);
  show("cue_signed", packet, motion_sign_packet(packet, size, sizeof packet, key, 32));
  printf("full %zu\\n", motion_encode_cue(packet, 91, &cue));
  printf("unsigned %zu\\n", motion_sign_packet(packet, size, 107, key, 32));
  cue.sequence = 0xffffffffu; cue.mode = MOTION_TELEPORT;
  show("cue_teleport", packet, motion_encode_cue(packet, sizeof packet, &cue));
  cue.sequence = 3; cue.mode = MOTION_BYE;
  show("cue_bye", packet, motion_encode_cue(packet, sizeof packet, &cue));
  motion_cue imu = {0};
  imu.session = 0x11223344; imu.sequence = 1;
  imu.sim_time_ns = 1000000000u; imu.sender_time_ns = 2000000000u;
  imu.flags = MOTION_GRAVITY_INCLUDED | MOTION_MEASURED_AT_PLATFORM;
  imu.reference = MOTION_PLATFORM; imu.acceleration[2] = 9.81f;
  show("cue_imu", packet, motion_encode_cue(packet, sizeof packet, &imu));
  for (size_t n = 0; n <= 100; n += 20) {
    motion_hmac(key, n, key, n, digest);
    show("hmac", digest, 32);
  }
"""


def build(folder, source):
    program = folder / "program"
    done = subprocess.run(
        [COMPILER, *FLAGS, str(source), "-o", str(program), "-lm"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return program


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    folder = tmp_path_factory.mktemp("c")
    prints = [
        f'  printf("{record}.{field} %zu\\n", offsetof(motion_wire_{record}, {field}));\n'
        for record, (fields, _) in OFFSETS.items()
        for field in fields.split()[::2]
    ]
    prints += [f'  printf("{name} %zu\\n", sizeof(motion_wire_{name}));\n' for name in OFFSETS]
    source = folder / "program.c"
    source.write_text(PROGRAM + "".join(prints) + "  return 0;\n}\n")
    return [line.split() for line in run(str(build(folder, source))).splitlines()]


def test_offsets_and_sizes_are_those_of_the_byte_tables(output):
    printed = {words[0]: words[1] for words in output if len(words) == 2}
    for record, (fields, size) in OFFSETS.items():
        words = fields.split()
        assert printed[record] == str(size)
        for field, offset in zip(words[::2], words[1::2], strict=True):
            assert printed[f"{record}.{field}"] == offset


@pytest.mark.parametrize(
    "name", ["cue_minimal", "cue_signed", "cue_teleport", "cue_bye", "cue_imu"]
)
def test_packets_equal_the_golden_vectors(output, name):
    printed = dict(words for words in output if len(words) == 2)
    assert bytes.fromhex(printed[name]) == (VECTORS / f"{name}.bin").read_bytes()


def test_packet_that_does_not_fit_the_buffer_is_not_written(output):
    printed = dict(words for words in output if len(words) == 2)
    assert printed["full"] == printed["unsigned"] == "0"


def test_hmac_agrees_for_all_kinds_of_key_lengths(output):
    digests = [words[1] for words in output if words[0] == "hmac"]
    data = bytes(range(100))
    assert digests == [
        hmac.new(data[:n], data[:n], hashlib.sha256).hexdigest() for n in range(0, 101, 20)
    ]


@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "signed"])
def test_foreign_sender_is_understood(tmp_path, key):
    program = build(tmp_path, ROOT / "clients" / "c" / "send_cue.c")
    (tmp_path / "key").write_bytes(KEY)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(10.0)
        extra = [] if key is None else [str(tmp_path / "key")]
        run(str(program), "127.0.0.1", str(listener.getsockname()[1]), "3", *extra)
        cues = [decode_cue(listener.recv(2000), key) for _ in range(4)]
    assert [c.sequence for c in cues] == [0, 1, 2, 3]
    assert [c.mode for c in cues] == [Mode.DRIVE] * 3 + [Mode.BYE]
    assert cues[0].motion.acceleration == (2.0, 0.0, 0.0)
    assert cues[0].motion.speed == 10.0
