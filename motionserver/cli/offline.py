"""evaluate: one recording, driven or only foretold."""

from __future__ import annotations

import sys
from pathlib import Path

from motionserver.evaluate.command import evaluate
from motionserver.evaluate.options import EvaluateOptions
from motionserver.evaluate.recording import read_recording
from motionserver.evaluate.report import to_text


def run_evaluate(recording: Path, options: EvaluateOptions) -> int:
    """Evaluate and print; 1 if any limit was broken."""
    drive = read_recording(recording)
    names, machine, tuning, planner_hz = options.for_drive(drive.live)
    result = evaluate(
        drive,
        names,
        machine,
        rate=options.rate,
        setpoints=options.setpoints,
        json_out=options.json_out,
        html_out=options.html_out,
        tuning=tuning,
        planner_hz=planner_hz,
        preview=options.preview,
        disturbance=options.disturbance(),
        jobs=options.jobs,
    )
    sys.stdout.write(to_text(result) + "\n")
    return 0 if result.violations == 0 else 1


def run_predictions(recording: Path, options: EvaluateOptions) -> int:
    """Print how well each reference model foretells a recording."""
    from motionserver.cueing.reference import MODELS
    from motionserver.evaluate.predictions import predictions, to_text
    from motionserver.evaluate.progress import Progress

    drive = read_recording(recording)
    tuning = options.for_drive(drive.live)[2]
    # without pedals or a file the model that needs them would be another one's double
    missing = {"vehicle": drive.drivers is None, "learned": not tuning.predictor}
    models = [name for name in MODELS if not missing.get(name)]
    progress = Progress(drive.name, 1.0)
    for warning in drive.warnings:
        progress.line(f"warning: {warning}")
    found = predictions(
        drive,
        models,
        predictor=tuning.predictor,
        scale=tuning.scale,
        drivers=drive.drivers,
        progress=lambda model, share: progress.at(share, model),
    )
    progress.close()
    sys.stdout.write(to_text(found))
    return 0
