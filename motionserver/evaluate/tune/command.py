"""The command ``tune``: recordings in; a preset, and the reasons for it, out."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.evaluate.files import make_folder
from motionserver.evaluate.ranges import PLANNER_RATES_HZ, check_algorithms, check_made
from motionserver.evaluate.recording import Recording, read_all
from motionserver.evaluate.tune.cache import ResultCache
from motionserver.evaluate.tune.criterion import SICKNESS_WEIGHT, Criterion
from motionserver.evaluate.tune.driving import Progress
from motionserver.evaluate.tune.page import to_html
from motionserver.evaluate.tune.preset import preset_name, preset_text, to_json
from motionserver.evaluate.tune.report import to_text
from motionserver.evaluate.tune.result import Settings, TuneResult
from motionserver.evaluate.tune.search import Search
from motionserver.evaluate.tune.space import space_of
from motionserver.evaluate.tune.stretches import stretches_of
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import apply_changes, default_for

EXCERPT = 20.0
"""Length of the judged stretch unless told otherwise [s]."""
PLANNER_HZ = 50.0
"""Planner rate unless told otherwise: half of what is usual, for half the time [Hz]."""


def tune(
    recordings: Sequence[str | Path | Recording],
    *,
    out: str | Path,
    algorithm: str = "mpc",
    criterion: str = "rmse",
    trials: int = 30,
    seed: int = 0,
    refine: int = 0,
    platform: str | Machine = "t2-compact",
    head: tuple[float, float, float] | None = None,
    excerpt: float = EXCERPT,
    planner_hz: float = PLANNER_HZ,
    scale: float = 0.6,
    search_scale: bool = False,
    tilt_rate_deg_s: float = 3.0,
    sickness_weight: float = SICKNESS_WEIGHT,
    jobs: int = 0,
    progress: Progress | None = None,
) -> TuneResult:
    """Search tunables of one algorithm on recordings and write down what was found and why.

    Into ``out``: the preset ``<algorithm>-<criterion>.toml``, ``report.txt``, ``report.html``,
    ``result.json`` with the values of every fold, and ``drives.jsonl``, from which a search that
    was stopped goes on when it is started again.

    Args:
        recordings: Files, or drives already read; two or more.
        out: Folder, made if missing.
        algorithm: What is tuned.
        criterion: One of `criterion.CRITERIA`.
        trials: Sets of values, the defaults among them.
        seed: Of the sets; the same seed gives the same files.
        refine: Further sets near the best of each fold.
        platform: Preset, file or machine.
        head: Driver's head in the platform frame [m]; the machine's if None.
        excerpt: Length of the stretch judged in each recording; 0 for all of it [s].
        planner_hz: Planner rate [Hz].
        scale: Share of the vehicle's motion that is wanted.
        search_scale: Whether the scale the algorithm is asked for is searched too.
        tilt_rate_deg_s: Perception threshold of tilt coordination [deg/s].
        sickness_weight: Of the criterion "sickness" [s2/m].
        jobs: Processes that drive at the same time, 0 for this one; the result does not depend on
            it.
        progress: Called after every drive.

    Returns:
        Everything, with the tuning for each recording that was chosen without it.

    Raises:
        ConfigError: An argument is wrong, or no trial kept the limits.
        RecordingError: A recording cannot be read.
    """
    machine = load_machine(platform) if isinstance(platform, str) else platform
    machine = machine if head is None else machine.with_head(np.array(head))
    _check(algorithm, trials, refine, seed, excerpt, planner_hz, scale, jobs)
    folder = make_folder("--out", out)
    drives = read_all(recordings)
    stretches = stretches_of(drives, excerpt)
    base = apply_changes(
        default_for(machine),
        {"algorithm": algorithm, "scale": scale, "tilt_rate_deg_s": tilt_rate_deg_s},
    )
    check_made(machine, base.to_tuning(), [algorithm], planner_hz)
    settings = Settings(
        algorithm,
        Criterion(criterion, sickness_weight),
        trials,
        refine,
        seed,
        excerpt,
        planner_hz,
        base,
        space_of(algorithm, search_scale),
    )
    command = _command(settings, recordings, platform, head, out, search_scale)
    with ResultCache(folder / "drives.jsonl") as cache:
        result = Search(machine, stretches, settings, cache, jobs, progress).run(command)
    write(result, folder)
    return result


def write(result: TuneResult, folder: Path) -> None:
    """Write preset and reports."""
    (folder / f"{preset_name(result)}.toml").write_text(preset_text(result), encoding="utf-8")
    (folder / "report.txt").write_text(to_text(result), encoding="utf-8")
    (folder / "report.html").write_text(to_html(result), encoding="utf-8")
    (folder / "result.json").write_text(to_json(result), encoding="utf-8")


def _command(
    settings: Settings,
    recordings: Sequence[str | Path | Recording],
    platform: str | Machine,
    head: tuple[float, float, float] | None,
    out: str | Path,
    search_scale: bool,
) -> str:
    """The command line that does it again, every choice written out."""
    words = ["motionserver", "tune"]
    words += [f"{r.name}.csv" if isinstance(r, Recording) else str(r) for r in recordings]
    options: dict[str, object] = {
        "algorithm": settings.algorithm,
        "criterion": settings.criterion.name,
        "trials": settings.trials,
        "refine": settings.refine,
        "seed": settings.seed,
        "platform": platform if isinstance(platform, str) else platform.name,
        "excerpt": f"{settings.excerpt:g}",
        "planner-rate": f"{settings.planner_hz:g}",
        "scale": f"{settings.base.scale:g}",
        "tilt-rate": f"{settings.base.tilt_rate_deg_s:g}",
        "out": out,
    }
    if head is not None:
        options["head"] = ",".join(f"{x:g}" for x in head)
    if settings.criterion.name == "sickness":
        options["sickness-weight"] = f"{settings.criterion.sickness_weight:g}"
    for name, value in options.items():
        words += [f"--{name}", str(value)]
    return shlex.join(words + (["--search-scale"] if search_scale else []))


def _check(
    algorithm: str,
    trials: int,
    refine: int,
    seed: int,
    excerpt: float,
    planner_hz: float,
    scale: float,
    jobs: int,
) -> None:
    check_algorithms([algorithm])
    for option, value, low, high, unit in (
        ("--trials", trials, 2, 2000, ""),
        ("--refine", refine, 0, 500, ""),
        ("--seed", seed, 0, 2**31 - 1, ""),
        ("--jobs", jobs, 0, 256, ""),
        ("--planner-rate", planner_hz, *PLANNER_RATES_HZ, " Hz"),
        ("--scale", scale, 0.05, 1, ""),
        ("--excerpt", excerpt, 0, 1e5, " s"),
    ):
        if not low <= value <= high:
            raise ConfigError(
                option, f"{value:g}{unit} is out of range", f"Give {low:g} to {high:g}{unit}."
            )
    if 0.0 < excerpt < 1.0:
        raise ConfigError("--excerpt", f"{excerpt:g} s says nothing", "Give 1 s or more, or 0.")
