"""What the demo prints."""

from __future__ import annotations

from typing import Any


def line(guard: dict[str, Any], planner: dict[str, Any] | None) -> str:
    """One line of the running server."""
    limits = guard["limits"]
    stroke = limits["leg_max"] - limits["leg_min"]
    used = [(leg - limits["leg_min"]) / stroke * 100 for leg in guard["legs"]]
    text = f"{guard['state']}  legs {min(used):3.0f}-{max(used):3.0f} %"
    text += f"  packets {guard['rates_hz']['send']:.2f} Hz"
    text += f"  tick late p99 {guard['tick']['late_p99_ms']:.2f} ms"
    if planner is not None:
        wanted, felt = planner["wanted_force"], planner["felt_force"]
        text += f"  wanted x {wanted[0]:+.2f} felt {felt[0]:+.2f} m/s2"
        text += f"  plan p50 {planner['solver']['time_p50_ms']:.1f} ms"
    return text


def verdict_text(summary: dict[str, Any]) -> str:
    """The base's verdict in words."""
    kinds = ", ".join(f"{k} {v}" for k, v in summary["violations_by_kind"].items() if v) or "none"
    return "\n".join(
        [
            f"the base received {summary['packets']} packets at {summary['mean_rate_hz']:.3f} Hz, "
            f"longest gap {summary['gap_ms']['max']:.1f} ms",
            f"violations: {summary['violations']} ({kinds}); largest leg speed "
            f"{summary['speed_max']:.3f} m/s, acceleration {summary['acceleration_max']:.2f} m/s2",
            f"it ended {summary['state']}, {'safe' if summary['ended_safe'] else 'NOT SAFE'}; "
            f"states {' '.join(summary['states_visited'])}",
        ]
    )
