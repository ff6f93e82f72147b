"""evaluate: one recording, driven or only foretold."""

from __future__ import annotations

import sys
from pathlib import Path

from motionserver.evaluate.command import evaluate
from motionserver.evaluate.options import EvaluateOptions
from motionserver.evaluate.report import to_text


def run_evaluate(recording: Path, options: EvaluateOptions) -> int:
    """Evaluate and print; 1 if any limit was broken."""
    machine, tuning = options.machine(), options.tuning()
    result = evaluate(
        recording,
        options.algorithms(),
        machine,
        rate=options.rate,
        setpoints=options.setpoints,
        json_out=options.json_out,
        html_out=options.html_out,
        tuning=tuning,
        planner_hz=options.planner_hz,
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
    from motionserver.evaluate.recording import read_recording

    tuning = options.tuning()
    # a recording holds no pedals: the model that needs them would be another one's double
    models = [name for name in MODELS if name != "vehicle"]
    found = predictions(
        read_recording(recording), models, predictor=tuning.predictor, scale=tuning.scale
    )
    sys.stdout.write(to_text(found))
    return 0
