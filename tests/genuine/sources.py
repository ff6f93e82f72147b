"""Where the drives come from: repository, commit, files, checksum, stretch, licence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from . import planar, readers, strapped
from .drive import Drive, Planar, Strapped


@dataclass(frozen=True)
class Source:
    """One stretch of one public recording."""

    name: str
    """Of the CSV file that is written."""
    repository: str
    commit: str
    files: tuple[str, ...]
    sha256: str
    """Of all files one after the other, in this order."""
    read: Callable[[Path], Planar | Strapped]
    """Reads the file, or the folder, `place`."""
    place: str
    vehicle: str
    sensor: str
    licence: str
    start: float = 0.0
    end: float = np.inf
    many: bool = False
    """Too many files for one request each: read from the repository's archive."""

    @property
    def folder(self) -> str:
        """Name of the folder in which this repository's files are kept."""
        return self.repository.replace("/", "+")

    def convert(self, root: Path) -> Drive:
        """Read, prove, convert.

        Raises:
            RefusedError: The recording does not obey physics well enough.
        """
        raw = self.read(root / self.folder / self.place)
        raw = replace(raw, start=self.start, end=self.end)
        return strapped.convert(raw) if isinstance(raw, Strapped) else planar.convert(raw)


_FERRARI: Final = "datasets/20140222_01_01_03_250lm"
_COMMA: Final = "Example_1/b0c9d2329ad1606b|2018-08-02--08-34-47/40"
_COMMA_FILES: Final = (
    "processed_log/IMU/accelerometer/t",
    "processed_log/IMU/accelerometer/value",
    "processed_log/IMU/gyro/t",
    "processed_log/IMU/gyro/value",
    "processed_log/CAN/speed/t",
    "processed_log/CAN/speed/value",
    "global_pose/frame_times",
    "global_pose/frame_velocities",
    "global_pose/frame_positions",
)


def _seoul(name: str, scenario: int, seconds: tuple[int, int], sha256: str) -> Source:
    place = f"dataset/expert/scenario_{scenario:03d}/data"
    first, last = 10 * seconds[0] + 1, 10 * seconds[1]
    return Source(
        name,
        "rllab-snu/R3-Driving-Dataset",
        "345bca37dec04903bf751602ef4dcc1c211ffbbe",
        tuple(f"{place}/{frame:06d}.json" for frame in range(first, last + 1)),
        sha256,
        partial(readers.seoul, first=first, last=last),
        place,
        "car of Seoul National University, model not named",
        "vehicle state at 10 Hz: ax, ay, yaw rate, speed, compass",
        "none named; summary files say copyright RLLAB@SNU",
        many=True,
    )


def _skoda(name: str, trial: int, start: float, sha256: str) -> Source:
    place = f"Datasets/trial{trial:02d}/GNSS.csv"
    return Source(
        name,
        "ansfl/WID",
        "9f15b32a26393c5870e83fc31948280eb41e5710",
        (place,),
        sha256,
        readers.skoda,
        place,
        "Skoda Roomster",
        "MRU-P inertial unit at 100 Hz, GNSS-RTK position at 5 Hz",
        "none named",
        start,
    )


SOURCES: Final = (
    Source(
        "ferrari250lm_track",
        "MBDS/sideslip-angle-vehicle-estimation",
        "0446c7659152c4064ea6f520369d3c5b56d222df",
        tuple(f"{_FERRARI}/{k}.txt" for k in ("t", "axCG", "ayCG", "vx", "vy", "yawRate")),
        "f8a0540dc091cd34173cf0c01949b87495b410177adf7811fd8ea953c08f5e4b",
        readers.ferrari,
        _FERRARI,
        "Ferrari 250 LM, racing",
        "INS/GPS at 100 Hz, centre of gravity, horizontal plane",
        "repository: MIT",
        100.0,
        300.0,
    ),
    Source(
        "car_dresden",
        "balzer82/Kalman",
        "61b1ec4e4a5aaf18e1caa8f3bcd99113daa3d2ca",
        ("2014-03-26-000-Data.csv",),
        "1f45029da9a2ff7e12ea0edd258bf32baae0b3f362d5f1e8b4bc11dd3cfaa976",
        readers.dresden,
        "2014-03-26-000-Data.csv",
        "car, model not named",
        "six-axis inertial unit at 50 Hz, GPS speed at 10 Hz",
        "README: CC BY-SA 2.0",
        60.0,
    ),
    Source(
        "rav4_california",
        "commaai/comma2k19",
        "4c7f1a6e1957745beadc1def0e7225f559b09a2a",
        tuple(f"{_COMMA}/{name}" for name in _COMMA_FILES),
        "f2a30b3333a37fe5e021ef0f250be73e9526c0233d0068ea80934076605dc245",
        readers.comma,
        _COMMA,
        "Toyota RAV4",
        "telephone's inertial unit at 104 Hz, CAN speed at 83 Hz",
        "MIT",
    ),
    Source(
        "racecar_taupo",
        "jLynx/RaceChrono-to-CSV",
        "42aab24de857d68e75f28771b292ce52cb4c7ddd",
        ("Test/session_20260103_141321_race_1_lap4.rcz",),
        "0a3bce5a1e53fcc09acc763cc85afb68be8ea48028a2d90d994c9cb6d8864321",
        readers.taupo,
        "Test/session_20260103_141321_race_1_lap4.rcz",
        "racing car on a lap, model not named (an earlier session is titled BMW)",
        "telephone's inertial unit at 50 Hz, CAN speed at 15 Hz, GPS bearing at 25 Hz",
        "none named",
    ),
    _skoda(
        "skoda_haifa_1", 0, 20.0, "e73a4ae66f77d35521aee07d8414666a2f2aa2339c30289b744c0c3b27d8c1b3"
    ),
    _skoda(
        "skoda_haifa_2", 11, 0.0, "5f95f33c8ec104a2d20a112b2dc0959af622a7c007f47a719c575d1b4aed5179"
    ),
    _seoul(
        "car_korea_town_1",
        9,
        (0, 120),
        "f6b11bce24c675b6d41edc2c1b928a5fd82665a832ad5142eb7702ae478cf503",
    ),
    _seoul(
        "car_korea_town_2",
        7,
        (160, 300),
        "ea750051149183f8f745750ec59994b7796c753d1436578c8959b3902eaf06a7",
    ),
    _seoul(
        "car_korea_highway",
        6,
        (75, 300),
        "106cdb4ebc2aa1fbad6637f166f4c2a18addc8633a2ae5b029fb1c3bce5c5bba",
    ),
    _seoul(
        "car_korea_testtrack",
        13,
        (590, 790),
        "a5cc1ca564173c51c7a8f2ed726b6650a5c3302b587c0111cde5a49b43b523af",
    ),
)
