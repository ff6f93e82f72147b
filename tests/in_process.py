"""The command line in this process: a busy machine starts Python slowly."""

import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from motionserver.cli import main


@dataclass(frozen=True)
class Ended:
    returncode: int
    stdout: str
    stderr: str


Cli = Callable[..., Ended]


def typed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *before: str) -> Cli:
    """What runs ``motionserver`` with the words ``before``, and those it is called with."""

    def run(*arguments: str) -> Ended:
        monkeypatch.setattr(sys, "argv", ["motionserver", *before, *arguments])
        capsys.readouterr()
        status = 0
        try:
            main()
        except SystemExit as ended:
            status = int(ended.code or 0)
        return Ended(status, *capsys.readouterr())

    return run
