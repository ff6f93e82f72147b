"""Where results go: refused before minutes of work what could not be written after them."""

from __future__ import annotations

from pathlib import Path

from motionserver.errors import ConfigError


def check_file(option: str, path: str | Path | None) -> None:
    """Make sure that a file can be written there; None is none.

    Raises:
        ConfigError: It lies in no folder, or is one.
    """
    if path is not None and (not Path(path).parent.is_dir() or Path(path).is_dir()):
        raise ConfigError(
            f"{option} {path}", "is no file in an existing folder", "Name a file to write."
        )


def make_folder(option: str, path: str | Path) -> Path:
    """The folder, made if missing.

    Raises:
        ConfigError: It cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(
            f"{option} {path}", f"cannot be made ({error.strerror})", "Name a folder to write to."
        ) from error
    return folder
