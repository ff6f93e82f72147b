"""The workspace part of the command ``check``: survey, warnings, files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.core.kinematics.reach import Ending
from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.evaluate.workspace.advice import Advice, advice
from motionserver.evaluate.workspace.draw import planes_file
from motionserver.evaluate.workspace.page import to_html
from motionserver.evaluate.workspace.result import Corner, Range, Survey
from motionserver.evaluate.workspace.survey import survey
from motionserver.evaluate.workspace.table import to_text
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning import BOX_FIELDS, TuningModel, apply_changes
from motionserver.settings.tuning_presets import PresetShelf


def workspace_text(
    machine: Machine,
    model: TuningModel,
    shelf: PresetShelf | None = None,
    *,
    html_out: Path | None = None,
    svg_out: Path | None = None,
    json_out: Path | None = None,
) -> str:
    """Survey a machine and say what was found.

    Args:
        machine: Geometry and limits, the configured head included.
        model: The tuning it starts with.
        shelf: Presets whose boxes are judged as well.
        html_out: File for the page.
        svg_out: File for the planes as one picture.
        json_out: File for all figures.

    Returns:
        The table and the warnings for a terminal of 80 columns.

    Raises:
        ConfigError: A file cannot be written, or neutral is beyond the machine's limits.
    """
    tuning = model.to_tuning()
    # the classical washout knows the box only; thondel2014 knows legs unless told otherwise
    leg_rows = tuning.algorithm != "classical" and (tuning.legs or tuning.algorithm == "mpc")
    presets, unreadable = _boxes(model, shelf)
    found = survey(machine, tuning.box)
    warnings = (*advice(found, leg_rows=leg_rows, presets=presets), *unreadable)
    if html_out is not None:
        _write("--html", html_out, to_html(found, warnings))
    if svg_out is not None:
        _write("--svg", svg_out, planes_file(found))
    if json_out is not None:
        figures = json.dumps(to_mapping(found, warnings), indent=1)
        _write("--json", json_out, figures + "\n")
    return to_text(found, warnings)


def _boxes(
    model: TuningModel, shelf: PresetShelf | None
) -> tuple[dict[str, Array], tuple[Advice, ...]]:
    """Boxes of the presets that set one; and those presets that are none."""
    boxes: dict[str, Array] = {}
    unreadable = []
    for name in shelf.names() if shelf is not None else ():
        try:
            assert shelf is not None
            values = shelf.read(name).values
            if any(field in values for field in BOX_FIELDS):
                boxes[name] = apply_changes(model, values).to_tuning().box
        except (TuningError, KeyError) as error:
            unreadable.append(
                Advice(f"preset {name} cannot be used: {error}", "Correct or delete its file.")
            )
    return boxes, tuple(unreadable)


def to_mapping(found: Survey, warnings: Sequence[Advice]) -> dict[str, Any]:
    """All figures as plain values, SI throughout (metres and radians)."""
    return {
        "machine": found.machine.name,
        "digest": found.machine.digest,
        "box": found.box.tolist(),
        "ranges": {one.name: _range(one) for one in found.ranges},
        "about_head": {one.name: _range(one) for one in found.about_head},
        "planes": {
            plane.name: {
                "axes": [AXIS_NAMES[plane.first], AXIS_NAMES[plane.second]],
                "edge": plane.edge.tolist(),
                "ended_by": [_ending(one) for one in plane.endings],
                "share_of_box": plane.share,
                "worst_corner": _corner(plane.worst),
            }
            for plane in found.planes
        },
        "corners": [_corner(one) for one in found.corners],
        "machine_corners": [_corner(one) for one in found.machine_corners],
        "random_poses": [
            {
                "size": one.factor,
                "reachable": one.reachable,
                "no_way_home": one.stranded,
                "ways_tried": one.tried,
            }
            for one in found.shares
        ],
        "least_conditioning": {
            "share_of_neutral": found.conditioning.value,
            "limit": found.conditioning.limit,
            "pose": list(found.conditioning.pose),
        },
        "largest_joint_angle": {
            "angle": found.swing.value,
            "limit": found.swing.limit,
            "leg": found.swing.leg,
            "pose": list(found.swing.pose),
        },
        "warnings": [{"what": one.what, "do": one.do} for one in warnings],
    }


def _range(one: Range) -> dict[str, Any]:
    return {
        "low": one.low,
        "high": one.high,
        "low_ended_by": _ending(one.low_end),
        "high_ended_by": _ending(one.high_end),
    }


def _corner(one: Corner) -> dict[str, Any]:
    return {"signs": list(one.signs), "scale": one.scale, "ended_by": _ending(one.ending)}


def _ending(one: Ending) -> dict[str, Any]:
    return {"limit": str(one.limit), "legs": list(one.legs)}


def _write(option: str, path: Path, text: str) -> None:
    try:
        path.write_text(text, "utf-8")
    except OSError as error:
        raise ConfigError(
            f"{option} {path}",
            f"cannot be written ({error.strerror})",
            "Give a file in a folder that exists.",
        ) from error
