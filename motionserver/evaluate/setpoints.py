"""Executed samples as a CSV file of set-points."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from motionserver.core.axes import AXIS_NAMES
from motionserver.evaluate.drive import Drive

HEADER: Final = ("t", *AXIS_NAMES, *(f"leg{i}" for i in range(1, 7)))
"""Columns: time [s], pose [m, rad], legs pin to pin [m]."""


def write_setpoints(drive: Drive, path: str | Path) -> None:
    """Write time, pose and legs of every executed sample, SI, 12 significant digits."""
    table = np.column_stack((drive.times, drive.pose, drive.legs))
    with Path(path).open("w", encoding="ascii", newline="\n") as stream:
        stream.write(",".join(HEADER) + "\n")
        stream.writelines(",".join(f"{value:.12g}" for value in row) + "\n" for row in table)
