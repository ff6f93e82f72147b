"""Boundaries of the tests, from a file: none are shipped.

The file is TOML, one table per test, every list as long as ``omega``, all but ``omega`` optional:

    source = "where the numbers come from"
    [[boundary]]
    test = 6
    omega = [0.1, 1.0, 10.0]          # rad/s, increasing
    gain_low = [0.5, 0.5, 0.4]        # felt over wanted
    gain_high = [1.1, 1.1, 1.2]
    phase_low_deg = [-60, -90, -180]
    phase_high_deg = [60, 60, 30]
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.core.axes import Array, frozen
from motionserver.errors import ConfigError
from motionserver.evaluate.omct.run import Point

_LISTS: Final[tuple[str, ...]] = ("gain_low", "gain_high", "phase_low_deg", "phase_high_deg")


@dataclass(frozen=True, slots=True)
class Boundary:
    """What one test must keep.

    Attributes:
        test: Its number.
        omega: Corners, (K,) [rad/s].
        lists: (K,) each, of those given; linear over the logarithm of the frequency.
    """

    test: int
    omega: Array
    lists: dict[str, Array]

    def at(self, name: str, omega: float) -> float | None:
        """One boundary at a frequency; None where there is none."""
        values = self.lists.get(name)
        if values is None or not self.omega[0] <= omega * 1.001 or omega > self.omega[-1] * 1.001:
            return None
        return float(np.interp(np.log(omega), np.log(self.omega), values))

    def keeps(self, point: Point) -> bool:
        """Whether a point lies inside, where there is a boundary."""
        for value, low, high in (
            (point.gain, "gain_low", "gain_high"),
            (point.phase, "phase_low_deg", "phase_high_deg"),
        ):
            least, most = self.at(low, point.omega), self.at(high, point.omega)
            if (least is not None and value < least) or (most is not None and value > most):
                return False
        return True


@dataclass(frozen=True, slots=True)
class Boundaries:
    """A file of them.

    Attributes:
        source: Where they come from, as the file says.
        tests: By number.
    """

    source: str
    tests: dict[int, Boundary]


def read_boundaries(path: Path) -> Boundaries:
    """Read a file of the form above.

    Raises:
        ConfigError: It is not of that form.
    """
    where = f"--boundaries {path}"
    try:
        data = tomllib.loads(read_bounded_text(path, SETTINGS_BYTES))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(where, f"cannot be read ({error})", "Mend the file.") from error
    rows = data.get("boundary")
    if not isinstance(rows, list) or not rows:
        raise ConfigError(where, "has no [[boundary]]", "Write one table for each test.")
    tests: dict[int, Boundary] = {}
    for row in rows:
        found = _boundary(where, row)
        if found.test in tests:
            raise ConfigError(
                where, f"test {found.test} has two tables", "Write one table for each test."
            )
        tests[found.test] = found
    return Boundaries(str(data.get("source", path.name)), tests)


def _boundary(where: str, row: Any) -> Boundary:  # noqa: ANN401  (whatever the file holds)
    if not isinstance(row, dict):
        raise ConfigError(where, f"boundary holds {row!r}", "Write [[boundary]] tables.")
    number = row.get("test")
    if type(number) is not int or not 1 <= number <= 10:
        raise ConfigError(where, f"test = {number!r}", "Give a whole number from 1 to 10.")
    unknown = sorted(set(row) - {"test", "omega", *_LISTS})
    if unknown:
        raise ConfigError(
            where, f"test {number}: unknown {unknown[0]!r}", f"Allowed: omega, {', '.join(_LISTS)}."
        )
    try:
        omega = frozen(np.array(row["omega"], dtype=np.float64))
        lists = {name: frozen(np.array(row[name], np.float64)) for name in _LISTS if name in row}
        shapes = {table.shape for table in (omega, *lists.values())}
        good = len(shapes) == 1 and omega.ndim == 1 and len(omega) > 0
        good = good and bool(omega[0] > 0.0 and (np.diff(omega) > 0.0).all())
        good = good and all(bool(np.isfinite(table).all()) for table in (omega, *lists.values()))
    except (KeyError, ValueError, TypeError):
        good = False
    if not good:
        raise ConfigError(
            where,
            f"test {number}: lists of numbers of one length with an increasing omega are needed",
            "Correct them.",
        )
    return Boundary(number, omega, lists)
