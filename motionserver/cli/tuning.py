"""tune."""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType
from typing import Any

from motionserver.core.limits import Machine
from motionserver.evaluate.options import head_point
from motionserver.evaluate.progress import Progress
from motionserver.evaluate.recording import Recording, read_all
from motionserver.evaluate.tune.command import tune
from motionserver.evaluate.tune.predictor import tune_predictor, worth
from motionserver.evaluate.tune.tables import verdict


class PartsProgress:
    """Tells of each part of the work how many drives are done, and the time that is left."""

    def __init__(self) -> None:
        self._label = ""
        self._shown: Progress | None = None

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show that ``done`` of ``total`` drives of this part are done."""
        if label != self._label or self._shown is None:
            self.close()
            self._label = label
            self._shown = Progress(f"tune: {label}", total)
        self._shown.at(done, f"{done} of {total} drives")

    def close(self) -> None:
        """End the line."""
        if self._shown is not None:
            self._shown.close()
            self._shown = None

    def __enter__(self) -> PartsProgress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _warn(recordings: list[Path]) -> list[Recording]:
    """Say what looks wrong in recordings before minutes are spent on them; the recordings."""
    drives = read_all(recordings)
    for drive in drives:
        for warning in drive.warnings:
            sys.stderr.write(f"{drive.name}: warning: {warning}\n")
        if drive.live is not None:
            sys.stderr.write(f"{drive.name}: {drive.live.described()}\n")
    return drives


def _live_machine(drives: list[Recording]) -> Machine | None:
    """The platform of drives that were all recorded live on the same one."""
    machines = [None if drive.live is None else drive.live.machine for drive in drives]
    first = machines[0] if machines else None
    digests = {None if one is None else one.digest for one in machines}
    return first if len(digests) == 1 else None


def run_tune(recordings: list[Path], out: Path, head: str, **options: Any) -> int:  # noqa: ANN401
    """Search, write, and say what was found; 1 if a choice broke a limit on a held-out drive."""
    drives = _warn(recordings)
    if "platform" not in options and (machine := _live_machine(drives)) is not None:
        options["platform"] = machine
    with PartsProgress() as progress:
        result = tune(recordings, out=out, head=head_point(head), progress=progress, **options)
    sys.stdout.write("\n".join([*verdict(result), f"written to {out}"]) + "\n")
    return 0 if result.held_out_violations == 0 else 1


def run_predictor(recordings: list[Path], name: str, out: Path) -> int:
    """Fit the reference model "learned" and say what it brings."""
    _warn(recordings)
    with PartsProgress() as progress:
        predictor = tune_predictor(recordings, name, out, progress=progress)
    sys.stdout.write("\n".join([*worth(predictor), f"written to {out}"]) + "\n")
    return 0
