"""The command ``tune --predictor``: fit the reference model "learned", with what it is worth."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver import __version__
from motionserver.cueing.predictor import Predictor, save
from motionserver.errors import ConfigError
from motionserver.evaluate.files import make_folder
from motionserver.evaluate.fit_predictor import fit
from motionserver.evaluate.html import document
from motionserver.evaluate.recording import Recording, read_all
from motionserver.evaluate.tune.driving import Progress
from motionserver.evaluate.tune.page import table_html
from motionserver.evaluate.tune.report import aligned
from motionserver.evaluate.tune.tables import Table

NAME: Final = re.compile(r"[a-z0-9-]{1,40}")
_AXES: Final = ("surge", "sway")


def tune_predictor(
    recordings: Sequence[str | Path | Recording],
    name: str,
    out: str | Path,
    *,
    progress: Progress | None = None,
) -> Predictor:
    """Fit a predictor to recordings and write down how it does on drives it has not seen.

    Into ``out``: ``<name>.json`` for the reference "learned", and ``<name>-report.txt`` and
    ``.html`` with the errors on each recording left out, beside those of "ar" alone.

    Args:
        recordings: Files, or drives already read, of one kind of vehicle.
        name: Of the predictor: lower-case letters, digits, hyphens.
        out: Folder, made if missing.
        progress: Called with what is being done, recordings condensed, recordings in all.

    Returns:
        The predictor.

    Raises:
        ConfigError: The name is none, or the recordings do not do.
        RecordingError: A recording cannot be read.
    """
    if not NAME.fullmatch(name):
        raise ConfigError(
            "--predictor", f"{name!r} is no name", "Give lower-case letters, digits, hyphens."
        )
    folder = make_folder("--out", out)
    drives = read_all(recordings)
    words = ["motionserver", "tune", "--predictor", name]
    words += [f"{r.name}.csv" if isinstance(r, Recording) else str(r) for r in recordings]
    command = shlex.join([*words, "--out", str(out)])
    try:
        predictor = fit(drives, name, f"made by: {command}", progress)
    except ValueError as error:
        raise ConfigError("RECORDINGS", str(error), "Give longer or other drives.") from error
    save(predictor, folder / f"{name}.json")
    text, page = _reports(predictor, command)
    (folder / f"{name}-report.txt").write_text(text, encoding="utf-8")
    (folder / f"{name}-report.html").write_text(page, encoding="utf-8")
    return predictor


def worth(predictor: Predictor) -> list[str]:
    """In sentences: what the predictor brings on drives left out."""
    lines = []
    for axis in _AXES:
        plain, learned = (_errors(predictor, axis, model) for model in ("ar", "learned"))
        before, after = float(plain.mean()), float(learned.mean())
        better = int(np.sum(learned.mean(axis=1) < plain.mean(axis=1) - 1e-9))
        if not np.any(learned != plain):
            lines.append(f"{axis}: no correction holds on drives left out, so there is none")
        else:
            lines.append(
                f"{axis}: relative error on drives left out {after:.3f}, without the correction "
                f"{before:.3f} ({100.0 * (1.0 - after / before):+.1f} % saved), better on {better} "
                f"of {len(plain)}"
            )
    return lines


def _errors(predictor: Predictor, axis: str, model: str) -> np.ndarray:
    """Relative errors on what was left out, (parts, M)."""
    left_out: dict[str, Any] = predictor.provenance["left_out"]
    return np.array([part[axis][model] for part in left_out.values()], dtype=np.float64)


def _tables(predictor: Predictor) -> list[Table]:
    names = list(predictor.provenance["left_out"])
    head = ("left out", "model", *(f"{h:g} s" for h in predictor.horizons.tolist()), "mean")
    found = []
    for axis in _AXES:
        rows = []
        both = {model: _errors(predictor, axis, model) for model in ("ar", "learned")}
        for k, name in enumerate([*names, "mean"]):
            for model, errors in both.items():
                row = errors.mean(axis=0) if name == "mean" else errors[k]
                cells = (*(f"{value:.3f}" for value in row), f"{row.mean():.3f}")
                rows.append((name if model == "ar" else "", model, *cells))
        found.append(Table(f"{axis}: error by how far ahead", head, tuple(rows), _NOTE))
    return found


_NOTE: Final = (
    "Error over the rms of the force itself, on each drive left out; ridge and weights were chosen "
    "on the others alone. 1 is as good as expecting nothing."
)


def _reports(predictor: Predictor, command: str) -> tuple[str, str]:
    title = f"motionserver {__version__}: predictor {predictor.name}"
    drives = ", ".join(
        f"{name} ({about['seconds']:g} s)"
        for name, about in predictor.provenance["recordings"].items()
    )
    facts = [f"fitted on {drives}", str(predictor.provenance["method"])]
    lines = [title, *facts, "", *worth(predictor), ""]
    for table in _tables(predictor):
        lines += [table.title, *aligned(table), table.note, ""]
    text = "\n".join([*lines, "again:", f"  {command}"]) + "\n"
    page = document(
        title,
        "pre{overflow-x:auto}",
        "".join(f'<p class="soft">{escape(fact)}.</p>' for fact in facts)
        + "".join(f"<p>{escape(line)}.</p>" for line in worth(predictor))
        + "".join(table_html(table) for table in _tables(predictor))
        + f'<h2>Again</h2><div class="frame"><pre>{escape(command)}</pre></div>',
    )
    return text, page
