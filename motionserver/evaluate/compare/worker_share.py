"""How far a worker process is with a result: a small file beside the one that it will write."""

from __future__ import annotations

import contextlib
from pathlib import Path


def tell_share(file: Path, share: float) -> None:
    """Tell that this share of the result is done, 0..1; a full disk costs only the word."""
    with contextlib.suppress(OSError):
        _beside(file).write_text(f"{share:.4f}", encoding="utf-8")


def share_of(file: Path) -> float:
    """Share that a worker has told, 0..1; 0 where it tells nothing."""
    try:
        return min(max(float(_beside(file).read_text(encoding="utf-8")), 0.0), 1.0)
    except (OSError, ValueError):
        return 0.0


def forget_share(file: Path) -> None:
    """Remove what was told."""
    with contextlib.suppress(OSError):
        _beside(file).unlink(missing_ok=True)


def _beside(file: Path) -> Path:
    return file.with_suffix(".share")
