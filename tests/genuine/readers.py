"""One reader per source format: files of the source in, `Strapped` or `Planar` out."""

from __future__ import annotations

import csv
import json
import zipfile
from pathlib import Path
from typing import Final

import numpy as np

from .drive import Planar, Strapped
from .signals import Array, derivative, lowpass

_EARTH: Final = 6378137.0


def ferrari(folder: Path) -> Planar:
    """One text file per signal, a number a line, 100 Hz, already forward/left/counter-clockwise."""
    signals = {
        name: np.loadtxt(folder / f"{name}.txt")
        for name in ("t", "axCG", "ayCG", "vx", "vy", "yawRate")
    }
    return Planar(
        signals["t"] - signals["t"][0],
        signals["axCG"],
        signals["ayCG"],
        signals["yawRate"],
        signals["vx"],
        signals["vy"],
    )


def seoul(folder: Path, first: int, last: int) -> Planar:
    """One JSON file per tenth of a second, numbered; theta is clockwise from north."""
    frames = range(first, last + 1)
    rows = [json.loads((folder / f"{frame:06d}.json").read_text("utf-8")) for frame in frames]
    names = ("theta", "v", "ax", "ay", "omega")
    theta, v, ax, ay, omega = (np.array([row[k] for row in rows], float) for k in names)
    return Planar(np.arange(len(rows)) / 10.0, ax, ay, omega, v, heading=-np.unwrap(theta))


def dresden(file: Path) -> Strapped:
    """CSV, 50 Hz: m/s^2, deg/s, km/h and clockwise course of a GPS receiver.

    As in a phone the accelerometers read minus specific force (z -9.8 at rest, z up by the gyro).
    Speed and course are held between fixes: only rows where they change are kept.
    """
    with file.open(encoding="ascii", newline="") as handle:
        rows = list(csv.DictReader(handle))
    column = {
        k: np.array([float(row[k]) for row in rows])
        for k in ("millis", "ax", "ay", "az", "rollrate", "pitchrate", "yawrate", "speed", "course")
    }
    t = (column["millis"] - column["millis"][0]) / 1e3
    changed = (np.diff(column["speed"]) != 0.0) | (np.diff(column["course"]) != 0.0)
    fixes = np.flatnonzero(np.concatenate([[True], changed]))
    rates = np.radians(np.column_stack([column[f"{k}rate"] for k in ("roll", "pitch", "yaw")]))
    force = -np.column_stack([column[k] for k in ("ax", "ay", "az")])
    course = -np.unwrap(np.radians(column["course"][fixes]))
    speed = column["speed"][fixes] / 3.6
    return Strapped(t, force, rates, t[fixes], speed, course, delayed_speed=True)


def comma(folder: Path) -> Strapped:
    """NumPy arrays with times of their own: forward, right, down [m/s^2], [rad/s]; CAN speed.

    Course is that of the velocity of `global_pose` (GNSS and camera), earth-centred [m/s].
    """

    def load(name: str) -> Array:
        with (folder / name).open("rb") as handle:
            return np.asarray(np.load(handle, allow_pickle=False), dtype=np.float64)

    t, gyro_t = load("processed_log/IMU/accelerometer/t"), load("processed_log/IMU/gyro/t")
    gyro = load("processed_log/IMU/gyro/value")
    rates = np.column_stack([np.interp(t, gyro_t, axis) for axis in gyro.T])
    speed_t, kept = np.unique(load("processed_log/CAN/speed/t"), return_index=True)
    speed = load("processed_log/CAN/speed/value").ravel()[kept]
    up = load("global_pose/frame_positions")
    up /= np.linalg.norm(up, axis=1)[:, None]
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east, axis=1)[:, None]
    velocity = load("global_pose/frame_velocities")
    northward = (velocity * np.cross(up, east)).sum(axis=1)
    course = np.unwrap(np.arctan2(northward, (velocity * east).sum(axis=1)))
    course = np.interp(speed_t, load("global_pose/frame_times"), course)
    return Strapped(t, load("processed_log/IMU/accelerometer/value"), rates, speed_t, speed, course)


def taupo(file: Path) -> Strapped:
    """RaceChrono session: a zip of arrays, little-endian, each with times of its own [ms].

    Whole numbers are thousandths of m/s^2, deg/s, deg. Inertial unit of the telephone (channels
    100 and 101), speed of the CAN bus (200), clockwise bearing of the GPS receiver (300).
    """
    with zipfile.ZipFile(file) as session:

        def load(name: str, kind: str) -> Array:
            return np.frombuffer(session.read(name), kind).astype(np.float64)

        def times(device: str) -> Array:
            return load(f"channel_{device}_1_1", "<u8") / 1e3

        def axes(device: str, *channels: int) -> Array:
            columns = [load(f"channel_{device}_{k}_0", "<i4") for k in channels]
            return np.column_stack(columns) / 1e3

        t, gyro_t = times("2_100_0"), times("3_101_0")
        speed_t, bearing_t = times("12_200_4"), times("1_300_0")
        rates = np.radians(axes("3_101_0", 12, 13, 14))
        bearing = np.unwrap(np.radians(axes("1_300_0", 6)[:, 0]))
        speed = load("channel2_12_200_4_4_3", "<f8")
        return Strapped(
            t - t[0],
            axes("2_100_0", 9, 10, 11),
            np.column_stack([np.interp(t, gyro_t, rate) for rate in rates.T]),
            speed_t - t[0],
            speed,
            -np.interp(speed_t, bearing_t, bearing),
        )


def skoda(file: Path) -> Strapped:
    """CSV, 100 Hz (its first column counts tenths of a second for hundredths): g, deg/s, degrees.

    Positions come five times a second in steps of a centimetre; speed is their derivative below
    0.8 Hz.
    """
    table = np.genfromtxt(file, delimiter=",", skip_header=1)
    t = np.arange(len(table)) / 100.0
    north = np.radians(table[:, 1] - table[0, 1]) * _EARTH
    east = np.radians(table[:, 2] - table[0, 2]) * _EARTH * np.cos(np.radians(table[0, 1]))
    new = np.concatenate([[True], (np.diff(north) != 0.0) | (np.diff(east) != 0.0)])
    known = t[: np.flatnonzero(new)[-1] + 1]
    eastward, northward = (
        lowpass(derivative(np.interp(known, t[new], x[new])), 0.8) for x in (east, north)
    )
    speed, course = np.hypot(eastward, northward), np.unwrap(np.arctan2(northward, eastward))
    return Strapped(t, table[:, 4:7] * 9.81, np.radians(table[:, 7:10]), known, speed, course)
