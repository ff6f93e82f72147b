"""The configuration of `motionserver run`: TOML, overridden by the environment."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

from motionserver.errors import ConfigError
from motionserver.settings.problems import config_error, read_toml, unknown_key


def _usable(value: str) -> str:
    if "\0" in value:
        raise ValueError("a path cannot hold the character NUL")
    try:
        Path(value).expanduser()
    except RuntimeError:
        raise ValueError("no user of the name behind ~ exists; give the whole path") from None
    return value


FilePath = Annotated[str, AfterValidator(_usable)]
Port = Annotated[int, Field(ge=1, le=65535)]
AnyPort = Annotated[int, Field(ge=0, le=65535)]
Arm = Annotated[float, Field(allow_inf_nan=False, ge=-10.0, le=10.0)]
PREFIX = "MOTIONSERVER_"


class Strict(BaseModel):
    """A section: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid")

    @field_validator("*", mode="before")
    @classmethod
    def _no_switch(cls, value: object, info: ValidationInfo) -> object:
        """Refuse ``true`` where a number is meant: it would be taken for 1."""
        field = cls.model_fields[str(info.field_name)]
        if isinstance(value, bool) and field.annotation is not bool:
            raise ValueError("true and false are no numbers; write the number")
        return value


class ServerSection(Strict):
    """[server]."""

    run_dir: FilePath = ""
    state_dir: FilePath = ""
    log_level: Literal["debug", "info", "warning"] = "info"
    realtime: bool = True
    blackbox_kept: Annotated[int, Field(ge=0, le=1000)] = 20


class PlatformSection(Strict):
    """[platform]: the machine and its packets."""

    format: str = "moog-6dof2000e"
    preset: FilePath = "t2-compact"
    mode: Literal["length", "dof"] = "length"
    host: str = "127.0.0.1"
    port: Port = 991
    local_host: str = "127.0.0.1"
    local_port: AnyPort = 992
    rate_hz: Annotated[float, Field(ge=20.0, le=1000.0)] = 60.0
    length_offset_m: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    leg_order: tuple[int, int, int, int, int, int] = (0, 1, 2, 3, 4, 5)
    heave_neutral_m: Annotated[float, Field(ge=-2.0, le=2.0)] = -0.2286
    engage_word: Literal[175, 180] = 180
    head_m: tuple[Arm, Arm, Arm] | None = None

    @field_validator("leg_order")
    @classmethod
    def _permutation(cls, value: tuple[int, ...]) -> tuple[int, ...]:
        if sorted(value) != list(range(6)):
            raise ValueError("leg_order must hold 0, 1, 2, 3, 4, 5, each once")
        return value


class SourceSection(Strict):
    """[[sources]]: one way motion comes in."""

    kind: Literal["native", "beamng", "zenoh", "imu"] = "native"
    listen: str = "127.0.0.1:4600"
    key_file: FilePath = ""
    topic: str = "motion/0/in/cue"
    preview_topic: str = ""
    zenoh_config: FilePath = ""
    connect: list[str] = Field(default_factory=list)
    allow_unsigned: bool = False

    @field_validator("listen")
    @classmethod
    def _address(cls, value: str) -> str:
        split_address(value)
        return value

    @model_validator(mode="after")
    def _preview_by_zenoh(self) -> Self:
        if self.zenoh_config and self.kind != "zenoh":
            raise ValueError('zenoh_config needs kind = "zenoh"; other kinds are not encrypted')
        if self.preview_topic and self.kind != "zenoh":
            raise ValueError('preview_topic needs kind = "zenoh"; add a source of that kind')
        if self.preview_topic and self.preview_topic == self.topic:
            raise ValueError("preview_topic must differ from topic; cues may bring previews too")
        return self


class CueingSection(Strict):
    """[cueing]: what starts; everything of it can be tuned live."""

    algorithm: str = "mpc"
    scale: Annotated[float, Field(ge=0.0, le=1.0)] = 0.6
    vehicle_head_m: tuple[Arm, Arm, Arm] = (0.0, 0.0, 0.0)
    budget_ms: Annotated[float, Field(ge=1.0, le=50.0)] = 10.0
    rate_max_hz: Annotated[float, Field(ge=20.0, le=200.0)] = 120.0
    tuning: dict[str, Any] = Field(default_factory=dict)


class PlannerSection(Strict):
    """[planner]: what runs beside the driving algorithm."""

    side_engines: list[str] = Field(default_factory=list)


class OperatorSection(Strict):
    """[operator]: who may engage."""

    engage: Literal["console", "http", "auto"] = "console"
    enable_input: FilePath = ""


class WebSection(Strict):
    """[web]: the page."""

    enabled: bool = True
    host: str = "127.0.0.1"
    port: AnyPort = 8080
    tokens_file: FilePath = ""
    tls_cert: FilePath = ""
    tls_key: FilePath = ""
    allowed_hosts: list[str] = Field(default_factory=list)


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


def split_address(text: str) -> tuple[str, int]:
    """Split "host:port".

    Raises:
        ValueError: It is not host:port, or the port is not 0..65535.
    """
    host, _, port = text.rpartition(":")
    digits = port.isascii() and port.isdigit() and len(port) <= 5
    if not host or not digits or int(port) > 65535:
        raise ValueError(f"{text[:60]!r} is not HOST:PORT, for example 127.0.0.1:4600")
    return host.strip("[]"), int(port)


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
            text = path.read_text("utf-8")
        except OSError as error:
            raise ConfigError(
                str(path), f"cannot be read ({error.strerror})", "Give the path of a TOML file."
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
