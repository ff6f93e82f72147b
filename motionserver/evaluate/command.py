"""The command ``evaluate``: one recording, some algorithms, and always the same rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Final

from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.disturbance import Disturbance
from motionserver.evaluate.drive import RATE_HZ, Drive, no_motion
from motionserver.evaluate.files import check_file
from motionserver.evaluate.hindsight import find_hindsight
from motionserver.evaluate.lockstep import PLANNER_HZ, drive
from motionserver.evaluate.metrics.figures import figures_of
from motionserver.evaluate.page import to_html
from motionserver.evaluate.progress import WEIGHTS, Progress
from motionserver.evaluate.ranges import check_algorithms, check_made, check_scale, check_times
from motionserver.evaluate.recording import Recording, read_all
from motionserver.evaluate.result import EvaluateResult, to_json
from motionserver.evaluate.setpoints import write_setpoints
from motionserver.evaluate.yardstick import find_yardstick
from motionserver.settings.machine import load_machine

YARDSTICK: Final = 5.0
"""How long the yardstick's search takes beside one classical drive, in two processes."""
HINDSIGHT: Final = 4.0
"""The same of the search in hindsight."""


def evaluate(
    input_csv: str | Path | Recording,
    algorithms: Sequence[str] = ("mpc", "thondel2014", "classical"),
    machine: Machine | None = None,
    scale: float | None = None,
    rate: float = RATE_HZ,
    setpoints: str | Path | None = None,
    json_out: str | Path | None = None,
    html_out: str | Path | None = None,
    *,
    tuning: Tuning | None = None,
    planner_hz: float = PLANNER_HZ,
    preview: float = 0.0,
    disturbance: Disturbance | None = None,
    jobs: int = 2,
    quiet: bool = False,
) -> EvaluateResult:
    """Drive a recording with every algorithm and with the rivals, and judge them all.

    Progress goes to standard error. `motionserver.evaluate.report.to_text` gives the table.

    Args:
        input_csv: The recording, or its file.
        algorithms: Names, in the order of the table.
        machine: Platform; the preset t2-compact if None.
        scale: Share of the motion that is wanted, above 0 and at most 1; the tuning's if None.
        rate: Rate of the executed samples [Hz].
        setpoints: File for the set-points; takes exactly one algorithm.
        json_out: File for all figures as JSON.
        html_out: File for the page.
        tuning: Other tunables; the defaults if None.
        planner_hz: Planner rate [Hz].
        preview: How far the algorithms (not the rivals) are told the recording ahead [s]; 0 as in
            life without a simulator that knows. The upper bound of what prediction can bring.
        disturbance: Trouble for the algorithms (not the rivals); none if None.
        jobs: Processes for the yardstick's search; the result does not depend on it.
        quiet: True for no progress.

    Returns:
        Drives and figures: the algorithms as asked for, "yardstick", "hindsight", "no motion".

    Raises:
        ConfigError: An argument is wrong.
        RecordingError: The recording cannot be read.
    """
    machine = load_machine("t2-compact") if machine is None else machine
    base = tuning or Tuning()
    base = base if scale is None else replace(base, scale=scale)
    check_algorithms(algorithms)
    check_scale(base.scale)
    check_times(rate, planner_hz, preview)
    check_made(machine, base, algorithms, planner_hz)
    if setpoints is not None and len(algorithms) != 1:
        raise ConfigError(
            "--setpoints",
            f"one algorithm moves one platform; {len(algorithms)} are given",
            "Give exactly one name to --algorithm.",
        )
    for option, path in (("--setpoints", setpoints), ("--json", json_out), ("--html", html_out)):
        check_file(option, path)
    recording = read_all([input_csv])[0]

    sizes = [WEIGHTS.get(name, 1.0) for name in algorithms]
    progress = Progress(recording.name, sum(sizes) + YARDSTICK + HINDSIGHT, quiet=quiet)
    for warning in recording.warnings:
        progress.line(f"warning: {warning}")
    if recording.live is not None:
        progress.line(recording.live.described())
    begin = 0.0

    def driven(name: str, size: float) -> Drive:
        nonlocal begin
        begun = perf_counter()
        out = drive(
            machine,
            recording,
            replace(base, algorithm=name),
            rate=rate,
            planner_hz=planner_hz,
            preview=preview,
            disturbance=disturbance,
            progress=progress.part(begin, size, name),
        )
        begin += size
        progress.line(
            f"{name}: {recording.duration:.1f} s driven in {perf_counter() - begun:.1f} s"
        )
        return out

    drives = [driven(name, size) for name, size in zip(algorithms, sizes, strict=True)]
    if setpoints is not None:
        write_setpoints(drives[0], setpoints)
    yardstick = find_yardstick(
        machine,
        recording,
        base,
        rate=rate,
        planner_hz=planner_hz,
        jobs=jobs,
        tell=progress.line,
        progress=progress.part(begin, YARDSTICK, "yardstick"),
    )
    hindsight = find_hindsight(
        machine,
        recording,
        base,
        rate=rate,
        planner_hz=planner_hz,
        yardstick=yardstick,
        tell=progress.line,
        progress=progress.part(begin + YARDSTICK, HINDSIGHT, "hindsight"),
    )
    progress.close()
    still = no_motion(machine, recording, base.scale, rate)
    drives += [yardstick.drive, hindsight.drive, still]
    result = EvaluateResult(
        recording,
        machine,
        base,
        rate,
        planner_hz,
        preview,
        tuple(drives),
        tuple(figures_of(each) for each in drives),
        yardstick,
        hindsight,
        disturbance,
    )
    if json_out is not None:
        Path(json_out).write_text(to_json(result), encoding="utf-8")
    if html_out is not None:
        Path(html_out).write_text(to_html(result), encoding="utf-8")
    return result
