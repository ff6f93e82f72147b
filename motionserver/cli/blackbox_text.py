"""What the dumps of the black box say, in words."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from motionserver.settings.config import load_config, run_dir_of, state_dir_of
from motionserver.telemetry.blackbox.dump import dumps
from motionserver.telemetry.blackbox.reader import DumpError, read_dump, summary, write_csv
from motionserver.telemetry.mapped import MappedFile


def list_text(path: Path | None) -> str:
    """All dumps of a configuration's server, one a line."""
    config = load_config(path)
    folder = state_dir_of(config) / "blackbox"
    lines = []
    for dump in dumps(folder):
        try:
            reasons = "; ".join(one["text"] for one in read_dump(dump)["reasons"])
        except DumpError as error:
            reasons = str(error)
        lines.append(f"{dump.name}  {dump.stat().st_size / 1e6:.1f} MB  {reasons}")
    told = box_status(run_dir_of(config))
    if told is not None and told["failed"]:
        lines.append(f"{told['failed']} dumps could not be written: {told['error']}")
    return "\n".join(lines) or f"{folder}: no dumps"


def show_text(which: str, path: Path | None, csv_out: Path | None) -> str:
    """One dump for people.

    Args:
        which: Path, name in the folder, or "latest".
        path: Configuration; None for the defaults.
        csv_out: New file for the samples, if wanted.

    Raises:
        DumpError: There is none, or it cannot be read, or the samples cannot be written.
    """
    folder = state_dir_of(load_config(path)) / "blackbox"
    if which == "latest":
        found = dumps(folder)
        if not found:
            raise DumpError(f"{folder}: no dumps")
        dump = found[-1]
    else:
        dump = Path(which) if Path(which).exists() else folder / which
    data = read_dump(dump)
    text = f"{dump}\n{summary(data)}"
    if csv_out is not None:
        text += f"\n\n{write_csv(data, csv_out)} samples in {csv_out}"
    return text


def box_status(run_dir: Path) -> dict[str, Any] | None:
    """What a running server's black box says of itself; None without one."""
    try:
        message = MappedFile(run_dir / "blackbox.map").read()
        return None if message is None else json.loads(message[1])
    except (OSError, ValueError):
        return None
