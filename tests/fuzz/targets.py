"""All targets: a decoder with its oracle, the shape of its format, its share of a campaign."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import oracle_cue
import targets_cue
import targets_devices
import targets_encode
import targets_files
import targets_maps
import targets_will
from demand import KEY
from mutate import Shape

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
CORPUS = HERE / "corpus"
VECTORS = ROOT / "protocol" / "vectors"


@dataclass(frozen=True)
class Target:
    """One decoder.

    Attributes:
        name: Also the name of its corpus.
        check: Takes a packet; whether it was taken; raises when an invariant is broken.
        shape: What the format looks like.
        share: Of the packets of a campaign; the dear ones get few.
        seeds: Corpora it begins with, beside its own.
        vectors: Beginning of the names of the protocol's vectors it begins with; "" for none.
        files: Further files to begin with.
    """

    name: str
    check: Callable[[bytes], bool]
    shape: Shape
    share: float
    seeds: tuple[str, ...] = ()
    vectors: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    def corpus(self):
        """Name and content of everything it begins with, in a fixed order."""
        paths = [*(CORPUS / self.name).glob("*")]
        for other in self.seeds:
            paths += (CORPUS / other).glob("*")
        for start in self.vectors:
            paths += VECTORS.glob(f"{start}*.bin")
        return [(path.name, path.read_bytes()) for path in (*sorted(paths), *self.files)]


def _signed(text, key):
    """Make length, checksum and signature right again; now and then leave one of them wrong."""

    def mend(data, rng):
        if len(data) < 44:
            return data
        dice = rng.random()
        if dice < 0.9:
            data[:4] = text[:4]
            data[4] = 1
        wants = key is not None and dice < 0.95
        data[6] = data[6] & ~1 | wants if dice < 0.97 else data[6]
        payload = data[44:] if len(data) < 1184 or dice > 0.8 else data[44:1184]
        data[8:10] = (len(payload) & 0xFFFF).to_bytes(2, "little")
        if dice < 0.6:
            _mend_blocks(payload)
        crc = zlib.crc32(payload, zlib.crc32(data[:40], zlib.crc32(text)))
        data = data[:40] + crc.to_bytes(4, "little") + payload
        return data + oracle_cue.signature(data, key) if data[6] & 1 and wants else data

    return mend


def _mend_blocks(payload):
    """The lengths of known blocks as they must be, as far as there are bytes."""
    at = 0
    while at + 4 <= len(payload):
        kind = int.from_bytes(payload[at : at + 2], "little")
        size = {1: 44, 3: 20, 64: 44}.get(kind)
        if kind == 2:
            size = 12 + 24 * int.from_bytes(payload[at + 4 : at + 6], "little")
        if size is None or at + 4 + size > len(payload):
            return
        payload[at + 2 : at + 4] = size.to_bytes(2, "little")
        at += 4 + size


def _fields(layout, start=0):
    """Offsets and codes of a `struct` layout."""
    order, at, out = layout[0], start, []
    for code in layout[1:]:
        if code != "x":
            out.append((at, order + code))
        at += struct.calcsize(order + code)
    return out


_FRAME = _fields("<IBBBBHHBxxxIIQQI")
_CUE = _FRAME + _fields("<HHffffffffffBBxx", 44) * 2 + _fields("<HHHxxff", 92)
_STATUS = _FRAME + _fields("<HHQQIIIIIfBxxx", 44) * 2


def cue_shape(key=None):
    mend = _signed(oracle_cue.CUE_TEXT, key)
    return Shape(_CUE, mend, repeat=(108, 4, "<f"))


def _mend_plan(data, rng):
    if len(data) >= 32:
        del data[32 + (len(data) - 32) // 152 * 152 :]
        data[24:28] = ((len(data) - 32) // 152).to_bytes(4, "little")
    return data


def _mend_mapped(data, rng):
    """Two slots of one size, their checksums right."""
    if len(data) < 40:
        return data
    capacity = (len(data) - 40) // 2
    data = bytearray(b"FMSM") + capacity.to_bytes(4, "little") + data[8 : 40 + 2 * capacity]
    for at in (8, 24 + capacity):
        length = min(int.from_bytes(data[at + 8 : at + 12], "little"), capacity)
        data[at + 8 : at + 12] = length.to_bytes(4, "little")
        body = bytes(data[at + 16 : at + 16 + length])
        crc = zlib.crc32(body, zlib.crc32(bytes(data[at : at + 8])))
        if rng.random() < 0.9:
            data[at + 12 : at + 16] = crc.to_bytes(4, "little")
    return data


def _mend_will(data, rng):
    """The length in front of the head as it must be, plans kept."""
    start, end = data.find(b"{"), data.rfind(b"}") + 1
    if start < 0 or end <= start:
        return data
    return bytearray((end - start).to_bytes(4, "little")) + data[start:end] + data[end:]


VALUES = (
    b"nan", b"inf", b"-inf", b"0", b"-0.0", b"1", b"-1", b"1e308", b"5e-324", b"true", b'"x"',
    b"[]", b"{}", b"[1, 2]", b'""', b'"\\u0000"', b'"~nobody-here/x"', b"9" * 25, b"9" * 4400,
    b"1979-05-27", b"_x",
    b'"auto"', b"[" * 90 + b"]" * 90, b"[" * 1100, b"\xff", b"\x00", b'"' + b"a" * 300 + b'"',
    b"NaN", b"Infinity", b"null", b'"\\ud800"', b"60.0", b"0.5", b"2", b"=", b"[", b"]", b".",
)  # fmt: skip


def _told(names):
    return tuple(name.encode() for name in names.split()) + VALUES


_SETTINGS = _told(
    "server platform sources [[sources]] [server] [platform] [cueing] [cueing.tuning] [operator] "
    "[web] [planner] run_dir state_dir log_level realtime preset mode host port rate_hz key_file "
    "leg_order listen kind native beamng zenoh imu topic connect allow_unsigned algorithm scale "
    "tuning side_engines engage enabled tls_cert _env_file __pydantic_self__ _cli_parse_args "
    '"0.0.0.0:4600" "[::1]:1" "localhost:0" "/dev/null" "t2-compact" budget_ms zenoh_config '
    "preview_topic head_m tokens_file allowed_hosts blackbox_kept length_offset_m"
)
_MACHINE = _told(
    "name neutral_height base_joints platform_joints head legs min max speed acceleration jerk "
    "workspace joint_angle_deg conditioning passenger_acceleration parked heave table2 surge sway "
    "roll_deg pace 1e4 20.0 -20.0 1e-6 1e-300 79.9 90.0"
)
_PRESET = _told("about values [values] algorithm scale legs box_surge_m horizon_s backend osqp")
_REQUEST = _told('"op" "engage" "park" "reset" "tune" "undo" "tuning" "by" "if_version" "changes" '
                 '"scale" "legs" "algorithm" "http" { } : ,')  # fmt: skip
_WILL = _told('"has_before" "feedback" "state" "clock" "counters" "plans" "legs" "pose" "phase" '
              '"faults" "RUN" "FAULT" "up" "estop" false { } : , "x":')  # fmt: skip
_PRESETS = ROOT / "motionserver" / "presets"

TARGETS = {
    target.name: target
    for target in (
        Target("cue", targets_cue.cue, cue_shape(), 0.22, vectors=("cue", "bad")),
        Target("cue-signed", targets_cue.cue_signed, cue_shape(KEY), 0.15,
               ("cue",), ("cue", "bad")),
        Target("status", targets_cue.status, Shape(_STATUS, _signed(oracle_cue.STATUS_TEXT, None)),
               0.08, vectors=("status", "bad_status")),
        Target("status-signed", targets_cue.status_signed,
               Shape(_STATUS, _signed(oracle_cue.STATUS_TEXT, KEY)), 0.05,
               ("status",), ("status",)),
        Target("encode", targets_encode.encode, Shape(_fields("<B" + 16 * "d")), 0.03),
        Target("native", targets_cue.native, cue_shape(), 0.06, ("cue",), ("cue",)),
        Target("zenoh", targets_cue.zenoh_sample, cue_shape(), 0.04, ("cue",), ("cue",)),
        Target("imu", targets_cue.imu, cue_shape(), 0.02, ("cue",), ("cue",)),
        Target("beamng", targets_devices.beamng, Shape(_fields("<I" + 21 * "f")), 0.07),
        Target("moog-reply", targets_devices.moog_reply, Shape(_fields(">IIIffffffI")), 0.10),
        Target("command", targets_devices.command, Shape(_fields(">IffffffBBBB")), 0.04),
        Target("plan", targets_maps.plan,
               Shape(_fields("<QQdII"), _mend_plan, repeat=(32, 8, "<d")), 0.06),
        Target("will", targets_will.will, Shape([], _mend_will, _WILL), 0.01),
        Target("link", targets_maps.link, Shape(_fields("<QQBQQ") + _fields("<BQdQQQ")), 0.04),
        Target("request", targets_maps.request, Shape(tokens=_REQUEST), 0.01),
        Target("mapped", targets_maps.mapped,
               Shape(_fields("<II") + _fields("<QII", 8), _mend_mapped), 0.015),
        Target("config", targets_files.config, Shape(tokens=_SETTINGS), 0.002,
               files=(ROOT / "deploy" / "motionserver.toml",)),
        Target("machine", targets_files.machine, Shape(tokens=_MACHINE), 0.001,
               files=(_PRESETS / "platforms" / "t2-compact.toml",)),
        Target("preset", targets_files.preset, Shape(tokens=_PRESET), 0.002,
               files=tuple(sorted((_PRESETS / "tunings").glob("*.toml")))),
    )
}  # fmt: skip
