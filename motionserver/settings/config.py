"""The configuration of `motionserver run`: TOML, overridden by the environment."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import Field, ValidationError
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.errors import ConfigError
from motionserver.settings.keys import split_address
from motionserver.settings.problems import config_error, read_toml, unknown_key
from motionserver.settings.sections import (
    CueingSection,
    OperatorSection,
    PlannerSection,
    PlatformSection,
    ServerSection,
    SourceSection,
    WebSection,
)

__all__ = [
    "PREFIX",
    "Config",
    "SourceSection",
    "load_config",
    "run_dir_of",
    "split_address",
    "state_dir_of",
]

PREFIX: Final = "MOTIONSERVER_"


class Config(BaseSettings):
    """The whole configuration; defaults run on loopback."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        env_nested_delimiter="__",
        extra="forbid",
        nested_model_default_partial_update=True,
    )

    server: ServerSection = Field(default_factory=ServerSection)
    platform: PlatformSection = Field(default_factory=PlatformSection)
    sources: list[SourceSection] = Field(default_factory=lambda: [SourceSection()])
    cueing: CueingSection = Field(default_factory=CueingSection)
    planner: PlannerSection = Field(default_factory=PlannerSection)
    operator: OperatorSection = Field(default_factory=OperatorSection)
    web: WebSection = Field(default_factory=WebSection)

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """The environment wins over the file."""
        return env_settings, init_settings


def load_config(path: Path | None, overrides: Mapping[str, Any] | None = None) -> Config:
    """Read a configuration.

    Args:
        path: TOML file; None for the defaults.
        overrides: Values that stand in for the file's, as nested mapping.

    Raises:
        ConfigError: The file cannot be read, or a key or value is wrong.
    """
    text = ""
    data: dict[str, Any] = dict(overrides or {})
    if path is not None:
        try:
            text = read_bounded_text(path, SETTINGS_BYTES)
        except OSError as error:
            raise ConfigError(
                str(path),
                f"cannot be read ({error.strerror})",
                "Give the path of a TOML file; `motionserver init > my.toml` makes one.",
            ) from error
        except UnicodeDecodeError as error:
            raise ConfigError(str(path), f"not TOML: {error}", "Correct the syntax.") from error
        data = _merged(read_toml(text, str(path)), data)
    # pydantic-settings would take the first for its own options and look for values elsewhere, and
    # the second for a section of that name, beside one that has it
    known = sorted(Config.model_fields)
    for key in data:
        if key.startswith("_") or (key not in known and key.lower() in known):
            raise unknown_key(f"{path}: {key}", key, known)
    try:
        return Config(**data)
    except ValidationError as error:
        raise config_error(error, path, text, Config) from error
    except ValueError as error:
        raise ConfigError(
            "environment", str(error), f"Correct the {PREFIX}... variable."
        ) from error


def _merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    out = dict(base)
    for key, value in over.items():
        below = out.get(key)
        if isinstance(below, dict) and isinstance(value, Mapping):
            value = _merged(below, value)
        out[key] = value
    return out


def run_dir_of(config: Config) -> Path:
    """Where the processes meet: [server] run_dir, or a folder of this user and platform port."""
    if config.server.run_dir:
        return Path(config.server.run_dir).expanduser()
    base = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/tmp/motionserver-{os.getuid()}")
    return base / f"motionserver-{config.platform.local_port}"


def state_dir_of(config: Config) -> Path:
    """What outlives a run (tokens, presets, tuning): [server] state_dir, or the user's own."""
    if config.server.state_dir:
        return Path(config.server.state_dir).expanduser()
    base = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    return Path(base).expanduser() / "motionserver"
