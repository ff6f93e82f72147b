"""The command line: one file per family of commands."""

from __future__ import annotations

import sys

from motionserver.cli import audit, blackbox, chaos, doctor, init, judging
from motionserver.cli.commands import app
from motionserver.errors import MotionServerError

__all__ = ["app", "audit", "blackbox", "chaos", "doctor", "init", "judging", "main"]


def main() -> None:
    """Run a command; a mistake of the user's ends with status 2 and one clear line."""
    try:
        app()
    except MotionServerError as error:
        sys.stderr.write(f"motionserver: {error}\n")
        raise SystemExit(2) from error
