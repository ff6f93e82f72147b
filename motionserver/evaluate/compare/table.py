"""The columns, the rows of each recording, the means, as text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any, Final

from motionserver.evaluate.compare.run import Result

NOTHING: Final = "-"


@dataclass(frozen=True, slots=True)
class Column:
    """One figure.

    Attributes:
        head: Short title.
        meaning: What it is, for the footer.
        take: From the figures of a drive.
        form: Format of the number.
        better: "less", "more" or empty.
        summed: True if all recordings are summed up, False if the mean is taken.
    """

    head: str
    meaning: str
    take: Callable[[dict[str, Any]], float | None]
    form: str = "{:.3f}"
    better: str = "less"
    summed: bool = False


def _planning(name: str) -> Callable[[dict[str, Any]], float | None]:
    def take(figures: dict[str, Any]) -> float | None:
        planning = figures["planning"]
        return None if planning is None else 100.0 * float(planning[name])

    return take


def _vertical(figures: dict[str, Any]) -> float | None:
    value = next(axis for axis in figures["axes"] if axis["axis"] == "f_z")["nrmse"]
    return None if value is None else float(value)


RATIO: Final = "/ hindsight"
COLUMNS: Final = (
    Column("nRMSE xy", "error of f_x and f_y over what is wanted; 1 is standing still",
           lambda f: f["nrmse_xy"]),
    Column(RATIO, "RMSE over that of the washout chosen in hindsight", lambda f: None),
    Column("corr", "correlation of felt and wanted f_x, f_y at no lag",
           lambda f: f["xy"]["correlation"], better="more"),
    Column("onset", "nRMSE of f_x and f_y above 0.5 Hz", lambda f: f["xy"]["onset"]),
    Column("f_z", "nRMSE of f_z", _vertical),
    Column("perceived", "nRMSE of f_x and f_y after the otoliths",
           lambda f: f["xy"]["perceived"]),
    Column("peak MIR", "largest motion-incongruence rating [m/s2]",
           lambda f: f["comfort"]["rating_peak"], "{:.2f}"),
    Column("tilt p99", "99th percentile of the tilt rate nobody asked for [deg/s]",
           lambda f: degrees(f["comfort"]["tilt_rate_p99"]), "{:.2f}", ""),
    Column("tilt > 3", "time with more than 3 deg/s of it [%]",
           lambda f: 100.0 * f["comfort"]["tilt_share"], "{:.1f}", ""),
    Column("broken", "executed samples beyond any limit, must be 0",
           lambda f: f["workspace"]["violations"], "{:.0f}", "", summed=True),
    Column("halved", "candidates the governor halved [%]", _planning("halved"), "{:.2f}", ""),
    Column("refused", "candidates it refused [%]", _planning("refused"), "{:.2f}", ""),
    Column("no plan", "periods without a candidate [%]", _planning("without"), "{:.2f}", ""),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Line:
    """One contender on one recording, or on average.

    Attributes:
        label: Who.
        values: One per column; None where there is none.
    """

    label: str
    values: tuple[float | None, ...]

    def cells(self) -> list[str]:
        """As text."""
        return [
            NOTHING if value is None else column.form.format(value)
            for column, value in zip(COLUMNS, self.values, strict=True)
        ]


@dataclass(frozen=True, slots=True)
class Block:
    """One recording, or the means.

    Attributes:
        title: Its name.
        lines: One per contender.
    """

    title: str
    lines: tuple[Line, ...]

    def best(self, column: int) -> set[int]:
        """Lines that do best in a column, as far as one can see from the printed number."""
        better = COLUMNS[column].better
        values = [line.values[column] for line in self.lines]
        known = [value for value in values if value is not None]
        if not better or len(known) < 2:
            return set()
        top = COLUMNS[column].form.format(min(known) if better == "less" else max(known))
        cells = [line.cells()[column] for line in self.lines]
        found = {index for index, cell in enumerate(cells) if cell == top}
        return found if len(found) < len(cells) else set()


def blocks(results: Sequence[Result]) -> list[Block]:
    """The means over all recordings first, then each recording."""
    names = list(dict.fromkeys(result["recording"] for result in results))
    labels = list(dict.fromkeys(result["contender"] for result in results))
    known = {(r["recording"], r["contender"]): r["figures"] for r in results}
    single = [
        Block(
            name,
            tuple(
                _line(label, known[name, label], known.get((name, "hindsight")))
                for label in labels
                if (name, label) in known
            ),
        )
        for name in names
    ]
    return [_means(single, labels), *single]


def _line(label: str, figures: dict[str, Any], hindsight: dict[str, Any] | None) -> Line:
    values = [column.take(figures) for column in COLUMNS]
    best = 0.0 if hindsight is None else float(hindsight["rmse_xy"])
    place = next(i for i, column in enumerate(COLUMNS) if column.head == RATIO)
    values[place] = figures["rmse_xy"] / best if best > 0.0 else None
    return Line(label, tuple(None if value is None else float(value) for value in values))


def _means(single: list[Block], labels: list[str]) -> Block:
    lines = []
    for label in labels:
        rows = [line.values for block in single for line in block.lines if line.label == label]
        means = []
        for index, column in enumerate(COLUMNS):
            known = [value for row in rows if (value := row[index]) is not None]
            total = sum(known) if column.summed else sum(known) / max(len(known), 1)
            means.append(total if known else None)
        lines.append(Line(label, tuple(means)))
    return Block(f"mean of {len(single)} recordings", tuple(lines))


def to_text(found: list[Block], footer: Sequence[str]) -> str:
    """Aligned text; the best of each block is marked with an asterisk."""
    label = 2 + max(len(line.label) for block in found for line in block.lines)
    widths = [max(len(column.head), 6) + 3 for column in COLUMNS]
    head = "".join(c.head.rjust(w) for c, w in zip(COLUMNS, widths, strict=True))
    out = []
    for block in found:
        marks = [block.best(index) for index in range(len(COLUMNS))]
        out += [block.title, " " * (label + 2) + head]
        for row, line in enumerate(block.lines):
            cells = "".join(
                (cell + ("*" if row in marks[i] else " ")).rjust(widths[i] + (1 if i == 0 else 0))
                for i, cell in enumerate(line.cells())
            )
            out.append("  " + line.label.ljust(label) + cells)
        out.append("")
    return "\n".join([*out, *footer]) + "\n"
