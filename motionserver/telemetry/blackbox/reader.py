"""Reads a dump and says what happened, in plain words; and writes its samples as a table."""

from __future__ import annotations

import csv
import gzip
import io
import json
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from motionserver.bounded_files import MIB, read_bounded
from motionserver.errors import MotionServerError
from motionserver.telemetry.blackbox.dump import FORMAT

WORDS: Final = {
    "OFFLINE": "the device was not heard",
    "PARKED": "down, waiting for an operator",
    "RAISING": "the platform was lifted",
    "READY": "up, waiting for a drive",
    "RUN": "the drive was played",
    "HOLD": "faded to stillness, waiting for the drive to go on",
    "PARKING": "the platform was brought down",
    "FAULT": "played to rest, then stood, until a reset",
    "SAFE": "followed the emergency stop or interlock, until a reset",
}
_LAST_PLANS: Final = 3
_LAST_PACKETS: Final = 5
_SELDOM_NS: Final = 1_000_000_000
_NEAR: Final = 10.0
"""Rates and lateness are told of so much time before the fault [s]."""


LARGEST_DUMP: Final = 64 * MIB
"""Largest dump that is read; one of a minute has about 1 MB."""
_LARGEST_UNPACKED: Final = 1024 * MIB


class DumpError(MotionServerError):
    """A dump cannot be read or its samples not be written; the text says why."""


def read_dump(path: Path) -> dict[str, Any]:
    """Read a dump.

    Raises:
        DumpError: It cannot be read, or is no dump of this version.
    """
    try:
        data = json.loads(_unpacked(read_bounded(path, LARGEST_DUMP)))
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']!r}, not {FORMAT!r}")
    except (OSError, EOFError, ValueError, LookupError, TypeError) as error:
        raise DumpError(f"{path}: no dump of the black box ({error})") from error
    out: dict[str, Any] = data
    return out


def _unpacked(packed: bytes) -> bytes:
    with gzip.open(io.BytesIO(packed)) as stream:
        data = stream.read(_LARGEST_UNPACKED + 1)
    if len(data) > _LARGEST_UNPACKED:
        raise ValueError(f"it unpacks to more than {_LARGEST_UNPACKED // MIB} MiB")
    return data


def summary(data: dict[str, Any]) -> str:
    """What happened, for people; times are seconds from the first reason."""
    at = data["reasons"][0]["t_ns"]
    utc = datetime.fromisoformat(data["made_utc"])
    when = utc - timedelta(microseconds=(data["made_ns"] - at) // 1000)
    limits = (data["guard"] or {}).get("limits") or {}
    lines = [
        f"{when:%Y-%m-%d %H:%M:%S.%f}"[:-3] + " UTC is time 0 below",
        f"machine   {limits.get('machine', '?')}, limits {limits.get('digest', '?')}, "
        f"motionserver {data['version']}",
    ]
    lines += [f"cause     {_time(one['t_ns'], at)}  {one['text']}" for one in data["reasons"]]
    for title, part in (
        ("what happened", list(_timeline(data, at))),
        ("last plans before it", list(_plans(data, at))),
        ("last packets of the simulator before it", list(_packets(data, at))),
        (f"the last {_NEAR:g} s before it", list(_rates(data, at))),
        ("counters that moved", list(_moved(data))),
    ):
        lines += ["", f"{title}:", *(f"  {line}" for line in part or ["nothing"])]
    return "\n".join(lines)


def _time(t_ns: int, at: int) -> str:
    return f"{(t_ns - at) * 1e-9:+9.3f} s"


def _timeline(data: dict[str, Any], at: int) -> Iterator[str]:
    happened = [(one["t_ns"], _said(one)) for one in data["guard_events"]]
    troubled, told_ns = "", 0
    for period in data["periods"]:
        # one that comes and goes is told once a second
        if period["trouble"] != troubled and period["t_ns"] - told_ns > _SELDOM_NS:
            troubled, told_ns = period["trouble"], period["t_ns"]
            happened.append((period["t_ns"], f"planner: {troubled or 'plans again'}"))
    happened += [(one["t_ns"], one["text"]) for one in data["reasons"] if one["text"][:4] == "the "]
    for t_ns, text in sorted(happened):
        if text:
            yield f"{_time(t_ns, at)}  {text}"


def _said(event: dict[str, Any]) -> str:
    what = event["what"]
    if what == "state":
        state, reason = event["state"], event["reason"]
        return f"{event['before']} -> {state} ({WORDS.get(state, '?')}): {reason}"
    if what == "note":
        return str(event["text"])
    if what == "request":
        answer = f"refused: {event['refusal']}" if event["refusal"] else "granted"
        return f"operator: {event['op']} by {event['by']}, {answer}"
    if what == "device":
        more = ", ".join(event["faults"]) or "no faults"
        return f"device: {event['state']}, {more}" + (", E-stop open" if event["estop"] else "")
    if what == "guard":
        return f"a guard took over, process {event['pid']}"
    return ""


def table(data: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Rows of "guard_rows" or "packets" as mappings."""
    columns, rows = data[name]["columns"], data[name]["rows"]
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _plans(data: dict[str, Any], at: int) -> Iterator[str]:
    judged = [row for row in table(data, "guard_rows") if row["verdict"] and row["t_ns"] <= at]
    shapes = {plan["plan_id"]: plan for plan in (*data["proposed"], *data["accepted"])}
    good = [row for row in judged if row["verdict"] == "accepted"]
    bad = [row for row in judged if row["verdict"] != "accepted"]
    for row in sorted((*good[-_LAST_PLANS:], *bad[-_LAST_PLANS:]), key=lambda row: row["t_ns"]):
        text = f"{_time(row['t_ns'], at)}  plan {row['proposal_id']}: {row['verdict']}"
        if row["verdict_leg"] >= 0:
            text += f", leg {row['verdict_leg'] + 1}"
        if row["verdict_value"] is not None and row["verdict_allowed"] is not None:
            text += f", found {row['verdict_value']:.6g}, allowed {row['verdict_allowed']:.6g}"
        plan = shapes.get(row["proposal_id"])
        if plan is not None:
            rest = plan["pose"][-1]
            text += f"; {plan['times'][-1]:.2f} s to rest at " + _pose(rest)
        yield text
    yield f"{len(good)} accepted, {len(bad)} rejected in the time kept"


def _pose(pose: Sequence[float]) -> str:
    metres = " ".join(f"{value * 1e3:.1f}" for value in pose[:3])
    angles = " ".join(f"{value * 57.29577951308232:.2f}" for value in pose[3:])
    return f"({metres}) mm ({angles}) deg"


def _packets(data: dict[str, Any], at: int) -> Iterator[str]:
    heard = [row for row in table(data, "packets") if row["arrival_ns"] <= at]
    for row in heard[-_LAST_PACKETS:]:
        force = " ".join(f"{row[f'force_{axis}_m_s2']:.3f}" for axis in "xyz")
        rates = " ".join(f"{row[f'rates_{axis}_rad_s']:.3f}" for axis in "xyz")
        yield (
            f"{_time(row['arrival_ns'], at)}  number {row['sequence']}, {row['mode']}, "
            f"force ({force}) m/s2, rates ({rates}) rad/s, {row['speed_m_s']:.1f} m/s"
        )
    events = data["planner_events"]
    if events and events[-1]["last_error"]:
        yield f"last refused: {events[-1]['last_error']}"


def _rates(data: dict[str, Any], at: int) -> Iterator[str]:
    begin = at - int(_NEAR * 1e9)
    rows = [row for row in table(data, "guard_rows") if begin <= row["t_ns"] <= at]
    sent = [row["t_ns"] for row in rows if row["is_sent"]]
    heard = [r["arrival_ns"] for r in table(data, "packets") if begin <= r["arrival_ns"] <= at]
    periods = [one for one in data["periods"] if begin <= one["t_ns"] <= at]
    planned = [one["t_ns"] for one in periods]
    for name, instants in (("to the platform", sent), ("from the simulator", heard),
                           ("planner periods", planned)):  # fmt: skip
        if len(instants) > 1 and instants[-1] > instants[0]:
            rate = (len(instants) - 1) / (instants[-1] - instants[0]) * 1e9
            gap = max(b - a for a, b in pairwise(instants)) * 1e-6
            yield f"{name:18s} {rate:7.2f} Hz, longest gap {gap:.1f} ms"
    if rows:
        worst = max(rows, key=lambda row: row["late_max_ns"])
        late, when = worst["late_max_ns"] * 1e-6, _time(worst["t_ns"], at).strip()
        yield f"guard's tick       at most {late:.3f} ms late, at {when}"
        old = max((row["t_ns"] - row["feedback_ns"]) * 1e-6 for row in rows if row["feedback_ns"])
        yield f"feedback           at most {old:.1f} ms old"
        astray = max(row["tracking_error_m"] or 0.0 for row in rows) * 1e3
        yield f"tracking error     at most {astray:.2f} mm"
    if periods:
        late, took = (max(one[key] for one in periods) * 1e3 for key in ("late", "took"))
        yield f"planner            at most {late:.3f} ms late, at most {took:.2f} ms for a plan"


def _moved(data: dict[str, Any]) -> Iterator[str]:
    for name, events in (("guard", data["guard_events"]), ("planner", data["planner_events"])):
        counts = [one["counters"] for one in events if one["what"] == "counters"]
        if not counts:
            continue
        for key in sorted(counts[-1]):
            # a process that was replaced counts from zero again
            steps = [(one.get(key, 0)) for one in counts]
            moved = sum(max(0, b - a) for a, b in pairwise(steps))
            if moved:
                yield f"{name:8s} {key:28s} {moved:+d}"


def write_csv(data: dict[str, Any], out: Path) -> int:
    """Write the samples: every row of the guard, with the newest packet and period of its instant.

    Returns:
        How many rows were written.

    Raises:
        DumpError: The file cannot be written, or is there already.
    """
    at = data["reasons"][0]["t_ns"]
    packets = table(data, "packets")
    arrived = [row["arrival_ns"] for row in packets]
    periods = data["periods"]
    began = [one["t_ns"] for one in periods]
    packet_names = [f"packet_{name}" for name in data["packets"]["columns"]]
    forces = [f"{of}_{axis}_m_s2" for of in ("wanted", "felt") for axis in "xyz"]
    columns = data["guard_rows"]["columns"]
    try:
        with out.open("x", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(["time_s", *columns, *packet_names, "algorithm", "kappa", *forces])
            for row in data["guard_rows"]["rows"]:
                t_ns = row[0]
                heard, thought = bisect_right(arrived, t_ns), bisect_right(began, t_ns)
                packet = data["packets"]["rows"][heard - 1] if heard else [None] * len(packet_names)
                period: list[Any] = [None] * (2 + len(forces))
                if thought:
                    one = periods[thought - 1]
                    period = [one["algorithm"], one["kappa"], *one["wanted"], *one["felt"]]
                writer.writerow([f"{(t_ns - at) * 1e-9:.6f}", *row, *packet, *period])
    except FileExistsError as error:
        raise DumpError(f"--csv {out}: there already. Give the name of a new file.") from error
    except OSError as error:
        raise DumpError(f"--csv {out}: {error.strerror or error}") from error
    return len(data["guard_rows"]["rows"])
