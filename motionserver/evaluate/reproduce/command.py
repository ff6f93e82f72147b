"""The command ``reproduce``: a published result, its figures and its claims."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

from motionserver import __version__
from motionserver.errors import ConfigError
from motionserver.evaluate.files import make_folder
from motionserver.evaluate.reproduce.draw import figure3, figure4, page
from motionserver.evaluate.reproduce.thondel2014 import Claim, Reproduction, claims, run_all
from motionserver.evaluate.svg import figure
from motionserver.settings.machine import load_machine

PAPERS: Final = ("thondel2014",)
"""What can be reproduced."""


def reproduce(paper: str = "thondel2014", out: str | Path = "out/thondel2014") -> int:
    """Run it, write ``numbers.json, fig3.svg, fig4.svg, index.html``, print every claim.

    Args:
        paper: One of `PAPERS`.
        out: Folder, made if it does not exist.

    Returns:
        0 if every claim holds, else 1: for the shell.

    Raises:
        ConfigError: There is no such paper, or the folder cannot be written.
    """
    if paper not in PAPERS:
        raise ConfigError("reproduce", f"unknown paper {paper!r}", f"Allowed: {', '.join(PAPERS)}.")
    folder = make_folder("--out", out)
    found = run_all(load_machine("t2-compact"), _tell)
    tried = claims(found)
    write(found, tried, folder)
    for claim in tried:
        print(f"{'PASS' if claim.holds else 'FAIL'}  {claim.text}: {claim.found}")  # noqa: T201
    lost = sum(not claim.holds for claim in tried)
    print(f"{len(tried) - lost} of {len(tried)} claims hold; see {folder / 'index.html'}")  # noqa: T201
    return 1 if lost else 0


def write(found: Reproduction, tried: list[Claim], folder: Path) -> None:
    """Write numbers, figures and page into ``folder``."""
    for name, panels in (("fig3", figure3(found)), ("fig4", figure4(found))):
        drawn = figure(panels, standalone=True)
        (folder / f"{name}.svg").write_text(drawn + "\n", encoding="utf-8")
    (folder / "index.html").write_text(page(found, tried), encoding="utf-8")
    (folder / "numbers.json").write_text(
        json.dumps(numbers(found, tried), indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )


def numbers(found: Reproduction, tried: list[Claim]) -> dict[str, object]:
    """All numbers, SI."""
    return {
        "version": __version__,
        "machine": {"name": found.machine.name, "digest": found.machine.digest},
        "worst_case_scale": found.scale,
        "claims": [asdict(claim) for claim in tried],
        "runs": [
            {
                "signal": signal,
                "variant": variant,
                "rmse": run.rmse,
                "correlation": run.correlation,
                "x_max": float(np.max(np.abs(run.x))),
                "tilt_max": float(np.max(np.abs(run.tilt))),
                "tilt_rate_max": float(np.max(np.abs(run.tilt_rate))),
                "outside_box": int(run.outside(found.machine.box).sum()),
                "legs_outside": run.legs_outside,
            }
            for (signal, variant), run in found.runs.items()
        ],
        "verified": [
            {"signal": signal, "variant": variant, **asdict(check)}
            for (signal, variant), check in found.verified.items()
        ],
    }


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)  # noqa: T201
