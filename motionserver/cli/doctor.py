"""doctor: what this machine can promise; everything it needs is imported when it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motionserver.cli.commands import app


@app.command()
def doctor(
    config: Annotated[
        Path | None, typer.Argument(help="configuration, TOML", metavar="CONFIG.toml")
    ] = None,
    seconds: Annotated[
        float, typer.Option("--seconds", help="how long wake-ups are watched", min=0.1, metavar="S")
    ] = 5.0,
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write all findings", metavar="OUT")
    ] = None,
) -> None:
    """Tell what this machine can promise, and the command that mends each finding."""
    import json

    from motionserver.doctor.examine import examine
    from motionserver.doctor.tree import Tree
    from motionserver.errors import ConfigError
    from motionserver.settings.config import load_config

    report = examine(load_config(config), config, seconds, Tree())
    if json_out is not None:
        try:
            json_out.write_text(json.dumps(report.to_mapping(), indent=2) + "\n", "utf-8")
        except OSError as error:
            raise ConfigError(
                "--json", f"{json_out}: {error.strerror}", "Give a path that can be written."
            ) from error
    typer.echo(report.to_text())
    raise typer.Exit(report.exit_status)
