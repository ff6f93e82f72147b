"""What the dumps of the black box say, in words."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from motionserver.cli.running import find_folders
from motionserver.telemetry.blackbox.dump import dumps
from motionserver.telemetry.blackbox.reader import DumpError, read_dump, summary, write_csv
from motionserver.telemetry.mapped import MappedFile


def list_text(path: Path | None, run_dir: Path | None = None) -> str:
    """All dumps of a server, one a line."""
    server = find_folders("blackbox list", path, run_dir)
    folder = server.state_dir / "blackbox"
    lines = []
    for dump in dumps(folder):
        try:
            reasons = "; ".join(one["text"] for one in read_dump(dump)["reasons"])
        except DumpError as error:
            reasons = str(error)
        lines.append(f"{dump.name}  {dump.stat().st_size / 1e6:.1f} MB  {reasons}")
    told = box_status(server.run_dir)
    if told is not None and told["failed"]:
        lines.append(f"{told['failed']} dumps could not be written: {told['error']}")
    return "\n".join(lines) or f"{folder}: no dumps"


def show_text(
    which: str, path: Path | None, csv_out: Path | None, run_dir: Path | None = None
) -> str:
    """One dump for people.

    Args:
        which: Path, name in the folder, or "latest".
        path: Configuration; None for the server that runs, or else the default folder.
        csv_out: New file for the samples, if wanted.
        run_dir: Run directory of the server, if several run.

    Raises:
        DumpError: There is none, or it cannot be read, or the samples cannot be written.
    """
    folder = find_folders("blackbox show", path, run_dir).state_dir / "blackbox"
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
