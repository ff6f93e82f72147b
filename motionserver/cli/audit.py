"""audit verify: is the log of who changed what still as it was written?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motionserver.cli.commands import app

audit_app = typer.Typer(no_args_is_help=True, help="The log of who changed what.")
app.add_typer(audit_app, name="audit")


@audit_app.command()
def verify(
    file: Annotated[
        Path | None, typer.Argument(help="the log; the server's own unless told", metavar="FILE")
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", help="whose log", metavar="CONFIG.toml")
    ] = None,
    head: Annotated[
        str, typer.Option("--head", help="a head hash noted earlier", metavar="HASH")
    ] = "",
) -> None:
    """Walk the audit log's chain of hashes over rotated files; exit status 1 if it is broken.

    It shows lines that were changed, removed, inserted or moved. A chain cannot show by itself
    that its last lines were cut off, nor that somebody who may write here has written all of it
    anew, stored head and all: note the head hash elsewhere, and give it as --head next time.
    """
    from motionserver.cli.audit_verify import verify_text

    text, is_whole = verify_text(file, config, head)
    typer.echo(text)
    raise typer.Exit(0 if is_whole else 1)
