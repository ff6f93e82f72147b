"""What a run needs: options, mapped files, histories and locks, in memory nobody can take away."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from motionserver.telemetry.blackbox.room import FOLDER, clear_room, make_room
from motionserver.telemetry.blackbox.watch import STATUS_BYTES
from motionserver.telemetry.link import SESSIONS_BYTES, Maps
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.run_files import RunFiles

GUARD_LOCK: Final = "guard.lock"
SPARE_LOCK: Final = "spare.lock"
LOCKS: Final = (GUARD_LOCK, SPARE_LOCK)
"""Held by the guard that moves the platform, and by the one that is next."""
LOCK_BYTES: Final = 8
"""Room for what its holder says of itself: exit status, process id."""
_PAGE_READS: Final = ("web.json", "guard.map", "planner.map", "service.map", "page.map")

log = logging.getLogger("motionserver.supervisor")


def make_contents(run_dir: Path, resolved: dict[str, Any]) -> RunFiles:
    """Make everything that the processes of a run read or map.

    Args:
        run_dir: Where the processes meet.
        resolved: What `settings.resolve` made of the configuration.

    Returns:
        The files; those of a black box only if there is room for it.

    Raises:
        OSError: There is no room for the rest.
    """
    files = RunFiles(run_dir)
    core = {key: value for key, value in resolved.items() if key != "web"}
    try:
        # made aside: nobody shall find a file by its name and map what is then replaced
        with TemporaryDirectory(prefix=".making-", dir=run_dir) as folder:
            aside = Path(folder)
            for name, content in (("config.json", core), ("web.json", resolved["web"])):
                # keys of signed sources are in it, and the folder is this user's alone
                (aside / name).write_text(json.dumps(content), "utf-8")
                files.take(name, aside / name, constant=True)
            for name in LOCKS:
                (aside / name).write_bytes(b" " * LOCK_BYTES)
                files.take(name, aside / name)
            Maps(aside, create=True).close()
            MappedFile(aside / "sessions.map", SESSIONS_BYTES).close()
            MappedFile(aside / "blackbox.map", STATUS_BYTES).close()
            for path in sorted(aside.glob("*.map")):
                files.take(path.name, path)
            if resolved["blackbox"]["kept"]:
                _make_histories(aside, run_dir, resolved, files)
    except OSError:
        files.close()
        raise
    return files


def has_histories(files: RunFiles) -> bool:
    """Whether there is room for a black box."""
    return any(name.startswith(FOLDER) for name in files.descriptors)


def is_pages(name: str) -> bool:
    """Whether the page, which strangers talk to, is given a file."""
    return name in _PAGE_READS


def is_not_pages(name: str) -> bool:
    """Whether the others are given a file."""
    return name != "web.json"


def _make_histories(aside: Path, run_dir: Path, resolved: dict[str, Any], files: RunFiles) -> None:
    rate_hz, plan_hz = resolved["platform"]["rate_hz"], 1.0 / resolved["planner"]["period"]
    before = set(files.descriptors)
    try:
        make_room(aside, rate_hz, plan_hz)
        (run_dir / FOLDER).mkdir(mode=0o700)
        for path in sorted((aside / FOLDER).glob("*.history")):
            files.take(f"{FOLDER}/{path.name}", path)
    except OSError as error:
        log.warning("no black box: no room for it (%s)", error.strerror)
        files.close(but=before)
        clear_room(run_dir)
    finally:
        clear_room(aside)
