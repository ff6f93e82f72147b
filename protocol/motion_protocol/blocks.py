"""What the blocks of a cue mean: motion, preview, driver inputs."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import Final, TypeAlias

from .errors import BlockLengthError, FieldError, UnknownValueError
from .layout import Layout, not_finite

Vector3: TypeAlias = tuple[float, float, float]
Sample: TypeAlias = tuple[float, float, float, float, float, float]

MOTION: Final = 1
PREVIEW: Final = 2
DRIVER: Final = 3
PREVIEW_MAX: Final = 40
"""Most preview samples in a packet: with all other blocks and a signature they just fit."""

_HAS_ATTITUDE: Final = 0x01
_HAS_YAW: Final = 0x02
_HAS_SPEED: Final = 0x04

MOTION_LAYOUT: Final = Layout(
    "motion",
    (
        ("acceleration.x", "f"),
        ("acceleration.y", "f"),
        ("acceleration.z", "f"),
        ("rates.p", "f"),
        ("rates.q", "f"),
        ("rates.r", "f"),
        ("roll", "f"),
        ("pitch", "f"),
        ("yaw", "f"),
        ("speed", "f"),
        ("reference", "B"),
        ("valid", "B"),
        ("", "2x"),
    ),
)
PREVIEW_LAYOUT: Final = Layout("preview", (("count", "H"), ("", "2x"), ("dt", "f"), ("start", "f")))
DRIVER_LAYOUT: Final = Layout(
    "driver",
    (
        ("throttle", "f"),
        ("brake", "f"),
        ("clutch", "f"),
        ("steering", "f"),
        ("gear", "b"),
        ("", "3x"),
    ),
)
SAMPLE: Final = struct.Struct("<6f")
_SAMPLE_FIELDS: Final = ("ax", "ay", "az", "p", "q", "r")


class Reference(IntEnum):
    """The point of the vehicle the accelerations belong to."""

    UNSPECIFIED = 0
    CENTRE_OF_GRAVITY = 1
    SEAT = 2
    CAB = 3
    HEAD = 4
    PLATFORM = 5


@dataclass(frozen=True, slots=True)
class Motion:
    """How the vehicle moves at one instant, ISO 8855 body axes.

    Attributes:
        acceleration: x forward, y left, z up [m/s^2]. Kinematic acceleration, zero at rest,
            unless the cue is flagged `GRAVITY_INCLUDED`: then specific force, +9.81 in z at rest.
        rates: Body rates p, q, r about x, y, z [rad/s].
        attitude: Roll (positive left side up) and pitch (positive nose down) [rad]; None if
            the sender does not know them.
        yaw: Heading, positive to the left [rad]; None if not known.
        speed: Forward speed, negative in reverse [m/s]; None if not known.
        reference: The point the accelerations belong to.
    """

    acceleration: Vector3
    rates: Vector3
    attitude: tuple[float, float] | None = None
    yaw: float | None = None
    speed: float | None = None
    reference: Reference = Reference.UNSPECIFIED


@dataclass(frozen=True, slots=True)
class Preview:
    """What the sender expects the vehicle to do next.

    Attributes:
        dt: Spacing of the samples [s].
        start: Time of the first sample after the cue's own simulation time [s].
        samples: 1 to 40 tuples (ax, ay, az [m/s^2], p, q, r [rad/s]), with or without
            gravity as the cue's flag says.
    """

    dt: float
    start: float
    samples: tuple[Sample, ...]


@dataclass(frozen=True, slots=True)
class DriverInputs:
    """What the driver does at the controls.

    Attributes:
        throttle: 0 released to 1 floored.
        brake: 0 released to 1 full.
        clutch: 0 released to 1 pressed.
        steering: Steering wheel angle, positive to the left [rad].
        gear: -1 reverse, 0 neutral, 1 first and so on.
    """

    throttle: float
    brake: float
    clutch: float
    steering: float
    gear: int


def pack_motion(motion: Motion) -> bytes:
    """Write the body of the motion block."""
    attitude, yaw, speed = motion.attitude, motion.yaw, motion.speed
    roll, pitch = (0.0, 0.0) if attitude is None else attitude
    return MOTION_LAYOUT.pack(
        *motion.acceleration,
        *motion.rates,
        roll,
        pitch,
        0.0 if yaw is None else yaw,
        0.0 if speed is None else speed,
        motion.reference,
        (0 if attitude is None else _HAS_ATTITUDE)
        | (0 if yaw is None else _HAS_YAW)
        | (0 if speed is None else _HAS_SPEED),
    )


def unpack_motion(data: bytes, offset: int, length: int) -> Motion:
    """Read the body of the motion block."""
    check_length(MOTION_LAYOUT, offset, length, MOTION_LAYOUT.size)
    ax, ay, az, p, q, r, roll, pitch, yaw, speed, reference, valid = MOTION_LAYOUT.unpack(
        data, offset
    )
    if reference >= len(_REFERENCES):
        raise UnknownValueError(
            f"motion.reference is {reference}; known are 0 to {len(_REFERENCES) - 1}; "
            f"send 0 (unspecified) for any other point",
            field="motion.reference",
        )
    return Motion(
        (ax, ay, az),
        (p, q, r),
        (roll, pitch) if valid & _HAS_ATTITUDE else None,
        yaw if valid & _HAS_YAW else None,
        speed if valid & _HAS_SPEED else None,
        _REFERENCES[reference],
    )


def pack_preview(preview: Preview) -> bytes:
    """Write the body of the preview block."""
    body = pack_samples(preview.samples, "preview")
    return PREVIEW_LAYOUT.pack(len(preview.samples), preview.dt, preview.start) + body


def pack_samples(samples: tuple[Sample, ...], block: str) -> bytes:
    """Write 1 to 40 samples of a preview block.

    Raises:
        FieldError: They are too many or none, or a value does not fit a 32-bit float.
        NotFiniteError: A value is NaN or infinite.
    """
    if not 1 <= len(samples) <= PREVIEW_MAX:
        raise FieldError(
            f"{block}.samples has {len(samples)} entries, 1 to {PREVIEW_MAX} are allowed; "
            f"space them wider or leave the preview out",
            field=f"{block}.samples",
        )
    try:
        body = b"".join(SAMPLE.pack(*sample) for sample in samples)
    except (struct.error, OverflowError) as error:
        raise FieldError(
            f"{block}.samples cannot be written ({error}); "
            f"each is six numbers (ax, ay, az, p, q, r) within the range of a 32-bit float",
            field=f"{block}.samples",
        ) from None
    check_samples(samples, block)
    return body


def unpack_preview(data: bytes, offset: int, length: int) -> Preview:
    """Read the body of the preview block."""
    if length < PREVIEW_LAYOUT.size:
        check_length(PREVIEW_LAYOUT, offset, length, PREVIEW_LAYOUT.size)
    count, dt, start = PREVIEW_LAYOUT.unpack(data, offset)
    if not 1 <= count <= PREVIEW_MAX:
        raise BlockLengthError(
            f"preview.count at byte {offset} is {count}; allowed are 1 to {PREVIEW_MAX}; "
            f"leave the block out where nothing is known",
            field="preview.count",
        )
    first = offset + PREVIEW_LAYOUT.size
    check_length(PREVIEW_LAYOUT, offset, length, PREVIEW_LAYOUT.size + count * SAMPLE.size)
    samples = tuple(SAMPLE.iter_unpack(data[first : offset + length]))
    check_samples(samples, "preview")
    return Preview(dt, start, samples)


def pack_driver(driver: DriverInputs) -> bytes:
    """Write the body of the driver inputs block."""
    return DRIVER_LAYOUT.pack(
        driver.throttle, driver.brake, driver.clutch, driver.steering, driver.gear
    )


def unpack_driver(data: bytes, offset: int, length: int) -> DriverInputs:
    """Read the body of the driver inputs block."""
    check_length(DRIVER_LAYOUT, offset, length, DRIVER_LAYOUT.size)
    return DriverInputs(*DRIVER_LAYOUT.unpack(data, offset))


def check_length(layout: Layout, offset: int, length: int, expected: int) -> None:
    """Refuse a block whose body has another length than its layout and count say."""
    if length != expected:
        raise BlockLengthError(
            f"the {layout.name} block at byte {offset} has {length} bytes, expected {expected}; "
            f"a changed layout needs a new block type",
            field=layout.name,
        )


def check_samples(samples: tuple[Sample, ...], block: str) -> None:
    """Refuse samples of a block that are not all finite."""
    if isfinite(sum(map(sum, samples))):
        return
    field, value = next(
        (f"{block}[{index}].{name}", value)
        for index, sample in enumerate(samples)
        for name, value in zip(_SAMPLE_FIELDS, sample, strict=True)
        if not isfinite(value)
    )
    raise not_finite(field, value)


_REFERENCES: Final = tuple(Reference)
