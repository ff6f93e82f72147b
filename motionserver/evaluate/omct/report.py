"""Tables of gain and phase, as text and as numbers."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from motionserver import __version__
from motionserver.evaluate.omct.boundaries import Boundaries
from motionserver.evaluate.omct.run import Omct, Point, Response
from motionserver.evaluate.omct.sines import LARGEST_ANGLE, RATE, TESTS

SCHEMA: Final = "motionserver-omct-1"


def of_test(found: Omct, number: int) -> list[Response]:
    """Responses of one test, one per algorithm."""
    return [response for response in found.responses if response.test.number == number]


def outside(response: Response, boundaries: Boundaries | None) -> list[Point]:
    """Points beyond a boundary; none without boundaries."""
    boundary = None if boundaries is None else boundaries.tests.get(response.test.number)
    return [] if boundary is None else [p for p in response.points if not boundary.keeps(p)]


def conditions(force: float, scale: float) -> list[str]:
    """What was done, for people."""
    return [
        f"inputs before the scale of {scale:g}: forces {force:g} m/s2; rates {RATE:g} rad/s, below "
        f"1 rad/s such that the vehicle turns by {LARGEST_ANGLE:g} rad; at least three settled "
        "periods each, one Fourier bin",
        "gain and phase are felt over wanted (scaled): 1 at 0 deg is perfect; tests 2 and 4 "
        "compare the force felt with that of the turned vehicle, tests 7 and 9 the force that the "
        "platform's tilt shows with the force wanted",
        "an optimiser under limits is not linear: these answers hold for this amplitude",
    ]


def to_text(found: Omct, boundaries: Boundaries | None) -> str:
    """One block per test: frequencies down, algorithms across."""
    out = []
    for test in TESTS:
        responses = of_test(found, test.number)
        mark = {(r.algorithm, p.omega) for r in responses for p in outside(r, boundaries)}
        out.append(f"{test.number}. {test.title}")
        out.append("   rad/s" + "".join(f"{r.algorithm:>24}" for r in responses))
        for row, first in enumerate(responses[0].points):
            cells = ""
            for response in responses:
                point = response.points[row]
                star = "!" if (response.algorithm, point.omega) in mark else " "
                cells += f"{point.gain:13.3f}{point.phase:7.0f} deg{star}"[:24].rjust(24)
            out.append(f"  {first.omega:6.3f}" + cells)
        if test.direct:
            out.append("  late by" + "".join(f"{1e3 * r.delay:20.0f} ms " for r in responses))
        out.append("")
    if boundaries is not None:
        count = sum(len(outside(response, boundaries)) for response in found.responses)
        out.append(f"{count} points outside the boundaries of: {boundaries.source} (marked !)")
    return "\n".join(out)


def to_mapping(found: Omct, boundaries: Boundaries | None, facts: dict[str, Any]) -> dict[str, Any]:
    """Everything as plain numbers and text."""
    return {
        "schema": SCHEMA,
        "version": __version__,
        **facts,
        "violations": found.violations,
        "driven_s": found.seconds,
        "boundaries": None if boundaries is None else boundaries.source,
        "responses": [
            {
                "algorithm": response.algorithm,
                "test": response.test.number,
                "title": response.test.title,
                "late_s": float(response.delay) if response.test.direct else None,
                "points": [asdict(point) for point in response.points],
                "outside": [point.omega for point in outside(response, boundaries)],
            }
            for response in found.responses
        ],
    }
