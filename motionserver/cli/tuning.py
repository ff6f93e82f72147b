"""tune."""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType
from typing import Any

import typer

from motionserver.evaluate.options import head_point
from motionserver.evaluate.tune.command import tune
from motionserver.evaluate.tune.predictor import tune_predictor, worth
from motionserver.evaluate.tune.tables import verdict


class ProgressBar:
    """A bar on standard error for each part of the work, with the time that is left."""

    def __init__(self) -> None:
        self._label = ""
        self._at = 0
        self._bar: Any = None

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show that ``done`` of ``total`` drives of this part are done."""
        if label != self._label:
            self.close()
            self._label, self._at = label, 0
            bar: Any = typer.progressbar(length=total, label=label, file=sys.stderr)
            self._bar = bar.__enter__()
        self._bar.update(done - self._at)
        self._at = done

    def close(self) -> None:
        """End the line."""
        if self._bar is not None:
            self._bar.render_finish()
            self._bar = None

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def run_tune(recordings: list[Path], out: Path, head: str, **options: Any) -> int:  # noqa: ANN401
    """Search, write, and say what was found; 1 if a choice broke a limit on a held-out drive."""
    with ProgressBar() as progress:
        result = tune(recordings, out=out, head=head_point(head), progress=progress, **options)
    sys.stdout.write("\n".join([*verdict(result), f"written to {out}"]) + "\n")
    return 0 if result.held_out_violations == 0 else 1


def run_predictor(recordings: list[Path], name: str, out: Path) -> int:
    """Fit the reference model "learned" and say what it brings."""
    predictor = tune_predictor(recordings, name, out)
    sys.stdout.write("\n".join([*worth(predictor), f"written to {out}"]) + "\n")
    return 0
