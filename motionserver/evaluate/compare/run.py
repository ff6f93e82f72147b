"""Drive all tasks in parallel; what is known already is read from the folder."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from motionserver.bounded_files import MIB, read_bounded_text
from motionserver.core.axes import Array
from motionserver.evaluate.compare.contenders import Task
from motionserver.evaluate.compare.worker_share import forget_share, share_of, tell_share
from motionserver.evaluate.drive import Drive, no_motion
from motionserver.evaluate.hindsight import find_hindsight
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.figures import figures_of
from motionserver.evaluate.progress import WEIGHTS, Progress
from motionserver.evaluate.recording import read_recording
from motionserver.evaluate.worker_pool import worker_pool
from motionserver.evaluate.yardstick import find_yardstick, yardstick_of

LARGEST_RESULT: Final = 64 * MIB
CURVE_HZ: Final = 20.0
"""Rate of the curves that are kept for the page [Hz]."""
_LOOK: Final = 2.0
"""Between two looks at other processes [s]."""
Result = dict[str, Any]
"""Figures of one task as plain numbers, see `drive_task`."""
Told = Callable[[str], None]


def run_tasks(
    tasks: list[Task],
    folder: Path,
    jobs: int,
    tell: Told,
    durations: dict[Path, float] | None = None,
) -> list[Result | None]:
    """Results in the order of the tasks.

    Args:
        tasks: What to drive.
        folder: Keeps every result by the hash of what it depends on; begun runs go on.
        jobs: Processes at the same time.
        tell: Called with a line for every drive.
        durations: Of the recordings [s], to tell the time that is left; alike if not known.

    Returns:
        One result per task; None where it raised, which is told.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{task.key()}.json" for task in tasks]
    results: list[Result | None] = [_kept(file) for file in files]
    missing = [index for index, result in enumerate(results) if result is None]
    tell(f"{len(tasks)} drives, {len(tasks) - len(missing)} of them known already")
    sizes = [_size(task) * (durations or {}).get(task.recording, 60.0) for task in tasks]
    progress = Progress("compare", sum(sizes[index] for index in missing))
    done, finished = 0, 0.0

    def take(index: int, result: Result | None, error: str) -> None:
        nonlocal done, finished
        done += 1
        finished += sizes[index]
        task = tasks[index]
        name = f"{task.recording.stem}: {task.contender.label}"
        results[index] = result
        progress.close()
        if result is None:
            tell(f"{done}/{len(missing)} {name}: FAILED: {error}")
        else:
            nrmse = result["figures"]["nrmse_xy"]
            shown = "-" if nrmse is None else f"{nrmse:.3f}"
            tell(f"{done}/{len(missing)} {name}: nRMSE {shown} in {result['seconds']:.0f} s")
        progress.at(finished)

    # the searches take longest: first, so that no core waits for them in the end
    order = sorted(missing, key=lambda index: tasks[index].contender.way != "")
    gains = _Gains(tasks, results)
    if jobs <= 1 or len(missing) < 2:
        while order:
            index = gains.next_of(order)
            share = progress.part(finished, sizes[index], tasks[index].name)
            task = replace(tasks[index], gain=gains.of(index), share=share)
            take(index, *_guarded(task, files[index]))
        progress.close()
        return results
    count = min(jobs, len(missing))
    with worker_pool(count) as pool:
        running: dict[Future[tuple[Result | None, str]], int] = {}
        while order or running:
            while order and len(running) < count:
                index = gains.next_of(order)
                task = replace(tasks[index], gain=gains.of(index))
                future = pool.submit(_guarded, task, files[index])
                running[future] = index
            under_way = sum(sizes[index] * share_of(files[index]) for index in running.values())
            names = ", ".join(tasks[index].name for index in running.values())
            progress.at(finished + under_way, names)
            for future in wait(running, _LOOK, return_when=FIRST_COMPLETED).done:
                take(running.pop(future), *future.result())
    progress.close()
    return results


def _size(task: Task) -> float:
    """How long a second of a drive takes, beside the others, about."""
    if not task.contender.way:
        return {"no motion": 0.02, "yardstick": 10.0, "hindsight": 5.0}[task.contender.name]
    return WEIGHTS.get(task.contender.name, 1.0)


class _Gains:
    """The yardstick's gains as they become known: hindsight drives it again, not its search."""

    def __init__(self, tasks: list[Task], results: list[Result | None]) -> None:
        self._tasks, self._results = tasks, results
        self._yardsticks = {
            task.recording: index
            for index, task in enumerate(tasks)
            if task.contender.name == "yardstick"
        }

    def of(self, index: int) -> float | None:
        """The gain for a hindsight task; None for others, and while it is not known."""
        task = self._tasks[index]
        yardstick = self._yardsticks.get(task.recording)
        if task.contender.name != "hindsight" or yardstick is None:
            return None
        result = self._results[yardstick]
        return None if result is None else float(result["gain"])

    def next_of(self, waiting: list[int]) -> int:
        """Take out the first that lacks no gain, the first of all if each lacks one."""
        for place, index in enumerate(waiting):
            if self._tasks[index].contender.name != "hindsight" or self.of(index) is not None:
                return waiting.pop(place)
        return waiting.pop(0)


def drive_task(task: Task) -> Result:
    """Drive and judge one task.

    Returns:
        ``figures`` (as of `figures_of`), ``note`` (how a rival was found), ``gain`` of the
        yardstick (else None), ``seconds`` it took, ``curves``: t [s], wanted and felt f_x, f_y
        [m/s2] at `CURVE_HZ`.
    """
    begun = perf_counter()
    recording, machine, contender = read_recording(task.recording), task.machine, task.contender
    rate, planner_hz, tuning = task.rate, task.planner_hz, contender.tuning
    gain, share = task.gain, task.share
    note = ""
    if contender.name == "no motion":
        driven = no_motion(machine, recording, tuning.scale, rate)
    elif contender.name == "yardstick":
        found = find_yardstick(
            machine, recording, tuning, rate=rate, planner_hz=planner_hz, progress=share
        )
        driven, note, gain = found.drive, f"gain {found.gain:g}", found.gain
    elif contender.name == "hindsight":
        known = None
        if gain is not None:
            known = yardstick_of(machine, recording, tuning, gain, rate=rate, planner_hz=planner_hz)
        best = find_hindsight(
            machine,
            recording,
            tuning,
            rate=rate,
            planner_hz=planner_hz,
            yardstick=known,
            progress=share,
        )
        driven, note = best.drive, best.described()
    else:
        driven = drive(
            machine,
            recording,
            tuning,
            rate=rate,
            planner_hz=planner_hz,
            preview=contender.preview,
            disturbance=contender.disturbance,
            progress=share,
        )
    return {
        "recording": recording.name,
        "duration": recording.duration,
        "contender": contender.label,
        "note": note,
        "gain": gain if contender.name == "yardstick" else None,
        "figures": asdict(figures_of(driven)),
        "curves": _curves(driven),
        "seconds": perf_counter() - begun,
    }


def _guarded(task: Task, file: Path) -> tuple[Result | None, str]:
    try:
        if task.share is None:
            task = replace(task, share=partial(tell_share, file))
        result = drive_task(task)
    except Exception as error:
        # one drive that fails must not take hours of others with it
        return None, f"{type(error).__name__}: {error}"
    finally:
        forget_share(file)
    scratch = file.with_suffix(f".{os.getpid()}.tmp")
    scratch.write_text(json.dumps(result, allow_nan=False), encoding="utf-8")
    scratch.replace(file)
    return result, ""


def _kept(file: Path) -> Result | None:
    try:
        result = json.loads(read_bounded_text(file, LARGEST_RESULT))
    except (OSError, ValueError):
        return None
    return result if isinstance(result, dict) else None


def _curves(driven: Drive) -> dict[str, list[float]]:
    stride = max(1, round(driven.rate / CURVE_HZ))
    force, _ = driven.felt()

    def thin(values: Array) -> list[float]:
        return [float(value) for value in np.round(values[::stride], 3)]

    return {
        "t": thin(driven.times),
        "wanted_x": thin(driven.wanted_force[:, 0]),
        "wanted_y": thin(driven.wanted_force[:, 1]),
        "felt_x": thin(force[:, 0]),
        "felt_y": thin(force[:, 1]),
    }
