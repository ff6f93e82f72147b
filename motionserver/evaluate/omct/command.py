"""The command ``omct``: ten tests, twelve frequencies, some algorithms."""

from __future__ import annotations

import json
import sys
from math import degrees
from pathlib import Path

from motionserver.errors import ConfigError
from motionserver.evaluate.files import make_folder
from motionserver.evaluate.omct.boundaries import read_boundaries
from motionserver.evaluate.omct.page import to_html
from motionserver.evaluate.omct.report import conditions, to_mapping, to_text
from motionserver.evaluate.omct.run import RATE_HZ, SLOW, run_omct
from motionserver.evaluate.omct.sines import FREQUENCIES
from motionserver.evaluate.options import EvaluateOptions
from motionserver.evaluate.ranges import check_algorithms, check_made


def omct(
    out: Path,
    options: EvaluateOptions,
    amplitude: float,
    boundaries_file: Path | None,
    frequencies: tuple[float, ...] = FREQUENCIES,
) -> int:
    """Measure, print, write ``omct.txt``, ``omct.json`` and ``omct.html``.

    Args:
        out: Folder to write to; made if need be.
        options: What was written at the prompt.
        amplitude: Of force inputs, before the scale [m/s2].
        boundaries_file: See `motionserver.evaluate.omct.boundaries`; none if None.
        frequencies: Increasing [rad/s].

    Returns:
        0, or 1 if a limit was broken.

    Raises:
        ConfigError: An argument is wrong.
    """
    names = options.algorithms()
    check_algorithms(names)
    if not 0.05 <= amplitude <= 10.0:
        raise ConfigError("--amplitude", f"{amplitude:g} m/s2", "Give 0.05 to 10 m/s2.")
    boundaries = None if boundaries_file is None else read_boundaries(boundaries_file)
    make_folder("--out", out)
    machine, tuning = options.machine(), options.tuning()
    check_made(machine, tuning, names, options.planner_hz)

    def tell(text: str) -> None:
        print(f"omct: {text}", file=sys.stderr, flush=True)  # noqa: T201

    found = run_omct(
        machine,
        tuning,
        names,
        force=amplitude,
        planner_hz=options.planner_hz,
        frequencies=frequencies,
        jobs=options.jobs,
        tell=tell,
    )
    head = ", ".join(f"{value:g}" for value in machine.head)
    facts = (
        f"Scale {tuning.scale:g}, reference {tuning.reference}, tilt rate "
        f"{degrees(tuning.tilt_rate):g} deg/s, head at ({head}) m, machine {machine.name} "
        f"({machine.digest}), planner {options.planner_hz:g} Hz (half below {SLOW:g} rad/s), "
        f"judged on executed samples at {RATE_HZ:g} Hz; {found.violations} beyond a limit."
    )
    notes = conditions(amplitude, tuning.scale)
    if boundaries is not None:
        notes.append(f"dashed: boundaries of {boundaries.source}")
    text = "\n".join([to_text(found, boundaries), facts, *notes]) + "\n"
    mapping = to_mapping(
        found,
        boundaries,
        {
            "algorithms": names,
            "machine": {"name": machine.name, "digest": machine.digest},
            "head_m": machine.head.tolist(),
            "scale": tuning.scale,
            "reference": tuning.reference,
            "planner_hz": options.planner_hz,
            "force_m_s2": amplitude,
            "notes": notes,
        },
    )
    (out / "omct.txt").write_text(text, encoding="utf-8")
    (out / "omct.json").write_text(
        json.dumps(mapping, indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    (out / "omct.html").write_text(to_html(found, boundaries, facts, notes), encoding="utf-8")
    sys.stdout.write(text)
    tell(f"written: {out / 'omct.txt'}, .json, .html")
    return 0 if found.violations == 0 else 1
