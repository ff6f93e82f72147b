"""blackbox list, blackbox show: what was written down on faults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motionserver.cli.commands import RunDir, app

blackbox_app = typer.Typer(
    no_args_is_help=True, help="The last minute before every fault, from the server's own memory."
)
app.add_typer(blackbox_app, name="blackbox")
ConfigOption = Annotated[
    Path | None, typer.Option("--config", help="whose dumps", metavar="CONFIG.toml")
]


@blackbox_app.command(name="list")
def list_dumps(config: ConfigOption = None, run_dir: RunDir = None) -> None:
    """List the dumps, oldest first, and what the running server's black box says of itself."""
    from motionserver.cli.blackbox_text import list_text

    typer.echo(list_text(config, run_dir))


@blackbox_app.command()
def show(
    file: Annotated[
        str, typer.Argument(help="a dump, its name in the folder, or latest", metavar="FILE|latest")
    ] = "latest",
    config: ConfigOption = None,
    csv_out: Annotated[
        Path | None, typer.Option("--csv", help="write its samples here", metavar="OUT")
    ] = None,
    run_dir: RunDir = None,
) -> None:
    """Say what happened: states with reasons, last plans and packets, rates, counters."""
    from motionserver.cli.blackbox_text import show_text

    typer.echo(show_text(file, config, csv_out, run_dir))
