"""Named sets of tunables: those that come with the server and those the user saved."""

from __future__ import annotations

import os
import re
import tempfile
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import tomli_w

from motionserver.bounded_files import FileNotUsableError, read_bounded
from motionserver.core.limits import Machine
from motionserver.settings.fields import FieldError, TuningError
from motionserver.settings.tuning import TuningModel, apply_changes, default_for, readable
from motionserver.settings.tuning_scope import without_effect

NAME: Final = re.compile(r"[a-z0-9-]{1,40}")
MOST_SAVED: Final = 100
_LARGEST: Final = 64 * 1024
"""Largest preset file that is read [B]."""


@dataclass(frozen=True, slots=True)
class Preset:
    """A whole state under one name: the values its file holds, and the defaults for all others.

    Attributes:
        name: Lower-case letters, digits, hyphens, at most 40.
        about: One line for the reader.
        built_in: True if it comes with the server.
        values: Tunables that its file sets, in the units of people.
        warnings: What of its file is left out, and why.
    """

    name: str
    about: str
    built_in: bool
    values: dict[str, Any]
    warnings: tuple[str, ...] = ()

    def whole(self, machine: Machine) -> tuple[TuningModel, tuple[str, ...]]:
        """Every tunable of the state on a machine.

        What the preset's algorithm does not read is left at its default: files of earlier versions
        hold such values.

        Returns:
            The state, and what was left out.

        Raises:
            TuningError: A value is not allowed on this machine.
        """
        default = default_for(machine)
        algorithm = str(self.values.get("algorithm", default.algorithm))
        dead = without_effect(self.values, algorithm, (default.values(),))
        names = {error.field for error in dead}
        live = {name: value for name, value in self.values.items() if name not in names}
        model = apply_changes(default, live)
        model.check_machine(machine)
        left_out = (f"{error.field} is left out: it {error.message}" for error in dead)
        return model, (*self.warnings, *left_out)


class PresetShelf:
    """Reads built-in and saved presets; saves the user's.

    Args:
        directory: Where the user's presets are kept; made when the first is saved.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        root = files("motionserver.presets").joinpath("tunings")
        self._built_in = {
            item.name.removesuffix(".toml"): item.read_text(encoding="utf-8")
            for item in sorted(root.iterdir(), key=lambda item: item.name)
            if item.name.endswith(".toml")
        }

    def names(self) -> list[str]:
        """Built-in names, then the saved ones."""
        return [*self._built_in, *(n for n in self._saved() if n not in self._built_in)]

    def read(self, name: str) -> Preset:
        """Read one preset.

        Raises:
            KeyError: There is none of that name (or the name is no name).
            TuningError: The file is not a valid preset.
        """
        if not NAME.fullmatch(name):
            raise KeyError(name)
        if name in self._built_in:
            return _parsed(name, self._built_in[name], built_in=True)
        try:
            text = read_bounded(self._path(name), _LARGEST)
        except FileNotUsableError as error:
            raise _error(name, None, "a regular file", str(error.strerror)) from None
        except OSError:
            raise KeyError(name) from None
        return _parsed(name, text.decode("utf-8", "replace"), built_in=False)

    def save(self, name: str, about: str, values: dict[str, Any]) -> Preset:
        """Save a preset of the user; it is on disk, whole, when this returns.

        Raises:
            TuningError: Bad name, a built-in's name, bad values, or too many presets.
            OSError: The disk refused.
        """
        if not NAME.fullmatch(name):
            raise _error("name", ascii(name)[:60], "a-z, 0-9 and -, at most 40", "not a name")
        if name in self._built_in:
            raise _error("name", name, "another name", "a built-in preset cannot be replaced")
        saved = self._saved()
        if name not in saved and len(saved) >= MOST_SAVED:
            raise _error("name", name, f"at most {MOST_SAVED} presets", "too many presets")
        apply_changes(TuningModel(), values)
        self._directory.mkdir(parents=True, exist_ok=True)
        text = tomli_w.dumps({"about": about[:200], "values": values})
        handle, scratch = tempfile.mkstemp(dir=self._directory, suffix=".tmp")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                stream.write(text)
                stream.flush()
                os.fsync(stream.fileno())
            Path(scratch).replace(self._path(name))
        except BaseException:
            Path(scratch).unlink(missing_ok=True)
            raise
        return Preset(name, about[:200], built_in=False, values=dict(values))

    def _saved(self) -> list[str]:
        found = (path.stem for path in self._directory.glob("*.toml"))
        return sorted(name for name in found if NAME.fullmatch(name))

    def _path(self, name: str) -> Path:
        return self._directory / f"{name}.toml"


def _parsed(name: str, text: str, *, built_in: bool) -> Preset:
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise _error(name, str(error)[:120], "a TOML file", "not a preset") from None
    about, values = data.get("about", ""), data.get("values")
    if not isinstance(about, str) or not isinstance(values, dict):
        raise _error(name, None, "a line 'about' and a table [values]", "not a preset")
    kept, warnings = readable(values)
    apply_changes(TuningModel(), kept)
    return Preset(name, about[:200], built_in, kept, tuple(warnings))


def _error(field: str, value: object, allowed: str, message: str) -> TuningError:
    return TuningError([FieldError(field, value, allowed, message)])
