"""The command `chaos`; what it needs is imported when it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motionserver.cli.commands import app


@app.command()
def chaos(
    listen: Annotated[
        str, typer.Option("--listen", help="where senders send instead", metavar="HOST:PORT")
    ],
    to: Annotated[str, typer.Option("--to", help="where it goes on to", metavar="HOST:PORT")],
    delay_ms: Annotated[
        float, typer.Option("--delay-ms", help="of every packet", metavar="MS")
    ] = 0.0,
    jitter_ms: Annotated[
        float, typer.Option("--jitter-ms", help="further delay, uniform up to this", metavar="MS")
    ] = 0.0,
    loss: Annotated[float, typer.Option("--loss", help="% of packets", metavar="%")] = 0.0,
    duplicate: Annotated[
        float, typer.Option("--duplicate", help="% of packets that arrive twice", metavar="%")
    ] = 0.0,
    reorder: Annotated[
        float, typer.Option("--reorder", help="% held back so that others overtake", metavar="%")
    ] = 0.0,
    reorder_ms: Annotated[
        float, typer.Option("--reorder-ms", help="for how long", metavar="MS")
    ] = 25.0,
    corrupt: Annotated[
        float, typer.Option("--corrupt", help="% with 1 to 8 bits flipped", metavar="%")
    ] = 0.0,
    truncate: Annotated[float, typer.Option("--truncate", help="% cut short", metavar="%")] = 0.0,
    silent: Annotated[
        list[str] | None,
        typer.Option(
            "--silent",
            help="seconds after the start in which nothing passes; may repeat; 5: is for ever",
            metavar="FROM:UNTIL",
        ),
    ] = None,
    back: Annotated[
        bool,
        typer.Option("--back/--no-back", help="replies meet the same flaws, or none"),
    ] = True,
    seed: Annotated[int, typer.Option("--seed", help="of everything random")] = 0,
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="end by itself", metavar="S")
    ] = None,
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write the counters here", metavar="OUT")
    ] = None,
) -> None:
    """Be a bad network: a UDP proxy that delays, loses and damages packets, by a seed."""
    from motionserver.cli.chaos_options import ChaosOptions
    from motionserver.cli.chaos_run import run_chaos

    run_chaos(
        ChaosOptions(
            listen=listen,
            to=to,
            delay_ms=delay_ms,
            jitter_ms=jitter_ms,
            loss=loss,
            duplicate=duplicate,
            reorder=reorder,
            reorder_ms=reorder_ms,
            corrupt=corrupt,
            truncate=truncate,
            silent=tuple(silent or ()),
            are_replies_flawed=back,
            seed=seed,
            seconds=seconds,
            json_out=json_out,
        )
    )
