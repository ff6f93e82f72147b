"""What walking the audit log finds, in words."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Final

from motionserver.cli.running import find_folders
from motionserver.errors import ConfigError
from motionserver.web.audit_chain import Head, Line, read_head, read_lines, rotated, walk

LIMITS: Final = (
    "A chain alone cannot show that its last lines were cut off together with the stored head, "
    "nor that it was written anew as a whole: note the head hash elsewhere, and give it as --head "
    "next time."
)
_TRIES: Final = 5


def verify_text(file: Path | None, config: Path | None, noted: str) -> tuple[str, bool]:
    """What walking the chain finds, for people, and whether it is whole.

    Args:
        file: The log; None for that of a configuration's server, or of the one that runs.
        config: The configuration; None for the server that runs, or else the default folder.
        noted: A head hash that was noted earlier; "" without.

    Raises:
        ConfigError: The log cannot be read.
    """
    if file is None:
        file = find_folders("audit verify", config).state_dir / "audit.jsonl"
    path = file
    lines, head, has_older = _read(path)
    found = walk(lines, head, has_older)
    files = Counter(line.file for line in lines)
    out = [f"{path.with_name(name)}: {count} lines" for name, count in files.items()]
    if not lines:
        out.append(f"{path}: empty, nothing was noted yet")
    out += [f"note: {note}" for note in found.notes]
    problems = [found.problem] if found.problem else []
    digests = [line.digest for line in lines if line.entry is not None]
    if noted and noted.lower() not in digests:
        problems.append("the hash given with --head is not in the chain: lines were cut or changed")
    elif noted:
        behind = len(digests) - 1 - digests.index(noted.lower())
        out.append(f"the hash given with --head is there, {behind} lines before the end")
    if head is None and lines:
        out.append("no head is stored beside this log: compare the one below with one you noted")
    out += [f"BROKEN: {problem}" for problem in problems]
    out.append(f"head {found.head or 'none'}")
    out.append("" if problems else "the chain is whole")
    return "\n".join([*filter(None, out), LIMITS]), not problems


def _read(path: Path) -> tuple[list[Line], Head | None, bool]:
    """Lines of both files and the stored head, all of the same instant of a log in use."""
    older = rotated(path)
    for _ in range(_TRIES):
        head = read_head(path)
        try:
            before = read_lines(older) if older.exists() else []
            if not path.exists() and not before:
                raise FileNotFoundError(2, "there is no such file")
            lines = read_lines(path) if path.exists() else []
        except OSError as error:
            raise ConfigError(
                f"audit verify {path}", f"{error.strerror}", "Give the path of an audit.jsonl."
            ) from error
        is_settled = head is None or any(line.digest == head.head for line in lines[-1:])
        if is_settled and read_head(path) == head:
            break
        time.sleep(0.02)
    return [*before, *lines], head, older.exists() or path.name.endswith(".1")
