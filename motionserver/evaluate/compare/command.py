"""The command ``evaluate --compare``: a folder of recordings in, table, JSON and page out."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import Any, Final

from motionserver import __version__
from motionserver.core.limits import Machine
from motionserver.cueing.registry import algorithms as known_algorithms
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.compare.contenders import Contender, Task, contenders
from motionserver.evaluate.compare.page import to_html
from motionserver.evaluate.compare.run import Result, run_tasks
from motionserver.evaluate.compare.table import COLUMNS, Block, blocks, to_text
from motionserver.evaluate.hindsight import HINDSIGHT_RULE
from motionserver.evaluate.options import EvaluateOptions
from motionserver.evaluate.ranges import check_made
from motionserver.evaluate.recording import read_recording
from motionserver.evaluate.tune.preset import read_fold_tunings
from motionserver.evaluate.yardstick import RULE

SCHEMA: Final = "motionserver-comparison-1"
UPPER_BOUND: Final = 2.0
"""How far the upper bound is told ahead unless told otherwise [s]."""


def compare(folder: Path, out: Path, options: EvaluateOptions) -> int:
    """Drive everything, write ``compare.txt``, ``compare.json`` and ``compare.html``.

    Results are kept one by one in ``out/drives``; a run that was broken off goes on, and what a
    change does not touch is not driven again.

    Args:
        folder: Its ``*.csv`` files are the recordings.
        out: Folder to write to; made if need be.
        options: What was written at the prompt; preview 0 means `UPPER_BOUND`.

    Returns:
        0, or 1 if a limit was broken or a drive failed.

    Raises:
        ConfigError: An argument is wrong.
        RecordingError: A recording cannot be read.
    """
    recordings = sorted(folder.glob("*.csv"))
    if not recordings:
        raise ConfigError("--compare", f"no *.csv in {folder}", "Name a folder of recordings.")
    names = options.algorithms()
    for name in names:
        if name not in known_algorithms():
            raise ConfigError(
                "--algorithm", f"unknown {name!r}", f"Allowed: {', '.join(known_algorithms())}."
            )
    machine, tuning = options.machine(), options.tuning()
    check_made(machine, tuning, names, options.planner_hz)
    preview = options.preview or UPPER_BOUND
    folds = _folds(options.held_out, [recording.stem for recording in recordings], tuning)
    trouble = options.disturbance()
    tasks = [
        Task(recording, contender, machine, options.rate, options.planner_hz)
        for recording in recordings
        for contender in contenders(names, tuning, preview, trouble, folds.get(recording.stem))
    ]
    entered = [task.contender for task in tasks if task.recording == recordings[0]]

    def tell(text: str) -> None:
        print(f"compare: {text}", file=sys.stderr, flush=True)  # noqa: T201

    durations = {}
    for path in recordings:
        drive = read_recording(path)
        durations[path] = drive.duration
        for warning in drive.warnings:
            tell(f"{path.stem}: warning: {warning}")
    results = run_tasks(tasks, out / "drives", options.jobs, tell, durations)
    known = [result for result in results if result is not None]
    failed = [
        f"{task.recording.stem}: {task.contender.label}"
        for task, result in zip(tasks, results, strict=True)
        if result is None
    ]
    if not known:
        raise ConfigError("--compare", "every drive failed", "Read the lines above.")
    found = blocks(known)
    facts = _facts(machine, tuning, options)
    footer = _footer(entered, known, failed, options.held_out)
    text = to_text(found, [facts, "", *_columns(), "", *footer])
    (out / "compare.txt").write_text(text, encoding="utf-8")
    mapping = _mapping(machine, tuning, options, entered, known, failed, found)
    (out / "compare.json").write_text(
        json.dumps(mapping, indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    (out / "compare.html").write_text(to_html(found, known, facts, footer), encoding="utf-8")
    sys.stdout.write(text)
    tell(f"written: {out / 'compare.txt'}, .json, .html")
    broken = sum(result["figures"]["workspace"]["violations"] for result in known)
    return 0 if broken == 0 and not failed else 1


def _facts(machine: Machine, tuning: Tuning, options: EvaluateOptions) -> str:
    head = ", ".join(f"{value:g}" for value in machine.head)
    return (
        f"Scale {tuning.scale:g}, driver's head at ({head}) m, tilt rate "
        f"{degrees(tuning.tilt_rate):g} deg/s, machine {machine.name} ({machine.digest}), planner "
        f"{options.planner_hz:g} Hz, judged on executed samples at {options.rate:g} Hz."
    )


def _columns() -> list[str]:
    return [f"{column.head}: {column.meaning}" for column in COLUMNS]


def _folds(path: Path | None, names: list[str], tuning: Tuning) -> dict[str, Tuning]:
    """For each recording the tunables chosen without it, for the limits of this comparison."""
    if path is None:
        return {}
    folds = read_fold_tunings(path)
    missing = [name for name in names if name not in folds]
    if missing:
        raise ConfigError(
            f"--held-out {path}",
            f"holds no tunables chosen without {', '.join(missing)}",
            "Tune on these recordings as well.",
        )
    return {
        name: replace(fold, scale=tuning.scale, tilt_rate=tuning.tilt_rate, box=tuning.box)
        for name, fold in folds.items()
    }


def _footer(
    entered: list[Contender], known: list[Result], failed: list[str], held_out: Path | None
) -> list[str]:
    out = [f"yardstick: {RULE}.", f"hindsight: {HINDSIGHT_RULE}."]
    if held_out is not None:
        out.append(
            "tuned on the others: on each recording the tunables that 'motionserver tune' chose "
            f"without it, from {held_out.name}; also where it is told ahead."
        )
    told = next((c.preview for c in entered if c.way == "preview"), None)
    if told is not None:
        out.append(
            f"told {told:g} s ahead: the recording itself as preview, as closely as one packet "
            "carries it, an upper bound that a simulator without preview does not reach."
        )
    trouble = next((c.disturbance for c in entered if c.disturbance is not None), None)
    if trouble is not None:
        out.append(
            f"Algorithms were troubled (seed {trouble.seed}): {100 * trouble.stalled:g} % of plans "
            f"stalled for {1e3 * trouble.stall:g} ms, {100 * trouble.failed:g} % failed, "
            f"{100 * trouble.nan:g} % were not numbers; rivals were not."
        )
    out += [
        f"{result['recording']}: {result['contender']}: {result['note']}."
        for result in known
        if result["note"]
    ]
    return [*out, *(f"FAILED: {name}." for name in failed)]


def _mapping(
    machine: Machine,
    tuning: Tuning,
    options: EvaluateOptions,
    entered: list[Contender],
    known: list[Result],
    failed: list[str],
    found: list[Block],
) -> dict[str, Any]:
    heads = [column.head for column in COLUMNS]
    return {
        "schema": SCHEMA,
        "version": __version__,
        "machine": {"name": machine.name, "digest": machine.digest},
        "head_m": machine.head.tolist(),
        "scale": tuning.scale,
        "tilt_rate_rad_s": tuning.tilt_rate,
        "reference": tuning.reference,
        "rate_hz": options.rate,
        "planner_hz": options.planner_hz,
        "contenders": [contender.label for contender in entered],
        "rules": {"yardstick": RULE, "hindsight": HINDSIGHT_RULE},
        "failed": failed,
        "table": {
            block.title: {
                line.label: dict(zip(heads, line.values, strict=True)) for line in block.lines
            }
            for block in found
        },
        "results": [
            {key: value for key, value in result.items() if key != "curves"} for result in known
        ],
    }
