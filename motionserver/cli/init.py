"""init: a configuration to begin with, and the other files that a deployment needs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motionserver.cli.commands import app


@app.command()
def init(
    platform: Annotated[
        str,
        typer.Option(
            "--platform",
            help="machine preset, machine file or packet format to enter",
            metavar="PRESET|FILE|FORMAT",
        ),
    ] = "",
    unit: Annotated[
        bool, typer.Option("--unit", help="print the systemd unit instead; see deploy/README.md")
    ] = False,
    zenoh: Annotated[
        bool, typer.Option("--zenoh", help="print a Zenoh file with certificates instead")
    ] = False,
) -> None:
    """Print an annotated configuration: motionserver init > my.toml."""
    from motionserver.settings.reference import annotated_config

    asked = [
        name
        for name, given in (("--platform", platform), ("--unit", unit), ("--zenoh", zenoh))
        if given
    ]
    if len(asked) > 1:
        raise typer.BadParameter(f"{' and '.join(asked)} each ask for another file; give one")
    if unit or zenoh:
        typer.echo(shipped("motionserver.service" if unit else "zenoh-secure.json5"), nl=False)
        return
    typer.echo(annotated_config(_platform_values(platform)), nl=False)


def shipped(name: str) -> str:
    """A file of the folder deploy/, which the wheel carries as well."""
    from importlib.resources import files

    return (files("motionserver.presets") / "deploy" / name).read_text("utf-8")


def _platform_values(name: str) -> dict[str, dict[str, object]]:
    """What to enter for ``--platform``.

    Raises:
        ConfigError: Nothing has this name, or the machine file is wrong.
    """
    from motionserver.errors import ConfigError
    from motionserver.platforms.registry import platform_names
    from motionserver.settings.machine import load_machine, machine_presets

    if not name:
        return {}
    if name in platform_names():
        return {"platform": {"format": name}}
    if name.endswith(".toml"):
        load_machine(name)
        # the server may be started in another folder than this command
        return {"platform": {"preset": str(Path(name).absolute())}}
    if name not in machine_presets():
        known = ", ".join([*machine_presets(), *platform_names()])
        raise ConfigError(
            "--platform", f"unknown {name!r}", f"Allowed: {known}, or the path of a .toml file."
        )
    return {"platform": {"preset": name}}
