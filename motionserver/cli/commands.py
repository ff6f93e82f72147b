"""All commands; what they need is imported when they run, so that help is quick."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from motionserver import __version__

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Motion-cueing server: a driving simulator in, a hexapod out, verified before it moves.",
)
ConfigFile = Annotated[
    Path | None, typer.Argument(help="configuration, TOML", metavar="CONFIG.toml")
]
MaybeConfig = Annotated[
    Path | None,
    typer.Argument(
        help="configuration of the server; the one that runs unless given", metavar="CONFIG.toml"
    ),
]
RunDir = Annotated[
    Path | None,
    typer.Option("--run-dir", help="run directory of the server, if several run", metavar="FOLDER"),
]
Seconds = Annotated[float | None, typer.Option("--seconds", help="end by itself", metavar="S")]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"motionserver {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    """Software here is operational protection, not a safety function: E-stop is hardware."""


@app.command()
def run(
    config: ConfigFile = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="play everything, send nothing that moves")
    ] = False,
) -> None:
    """Run the server: guard, planner and page; parks on Ctrl-C or SIGTERM."""
    from motionserver.cli.serving import serve
    from motionserver.errors import ConfigError

    if config is None:
        raise ConfigError(
            "run",
            "no configuration is given",
            "Make one with `motionserver init > my.toml`, adapt it, then `motionserver run "
            "my.toml`; `motionserver demo` runs without one and without hardware.",
        )
    raise typer.Exit(serve(config, dry_run))


@app.command()
def check(
    config: Annotated[
        Path | None, typer.Argument(help="configuration, TOML", metavar="CONFIG.toml")
    ] = None,
    platform: Annotated[
        str | None,
        typer.Option("--platform", help="a machine alone: preset or file", metavar="PRESET|FILE"),
    ] = None,
    html_out: Annotated[
        Path | None, typer.Option("--html", help="draw the workspace as a page", metavar="OUT")
    ] = None,
    svg_out: Annotated[
        Path | None, typer.Option("--svg", help="draw its planes as a picture", metavar="OUT")
    ] = None,
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write all its figures", metavar="OUT")
    ] = None,
    no_drive: Annotated[
        bool, typer.Option("--no-drive", help="do not drive it off-line for some seconds")
    ] = False,
) -> None:
    """Validate a configuration, drive its machine off-line, show what it reaches."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # as in the planner, or its times would be others
    from motionserver.cli.workspace import check_text

    typer.echo(check_text(config, platform, html_out, svg_out, json_out, not no_drive))


@app.command()
def engage(config: MaybeConfig = None, run_dir: RunDir = None) -> None:
    """Raise the platform: an operator's edge, given at the console."""
    _ask("engage", config, run_dir)


@app.command()
def park(config: MaybeConfig = None, run_dir: RunDir = None) -> None:
    """Park the platform, from whatever it does."""
    _ask("park", config, run_dir)


@app.command()
def reset(config: MaybeConfig = None, run_dir: RunDir = None) -> None:
    """Leave FAULT or SAFE once the cause is gone."""
    _ask("reset", config, run_dir)


@app.command()
def status(
    config: MaybeConfig = None,
    as_json: Annotated[bool, typer.Option("--json", help="print everything as JSON")] = False,
    run_dir: RunDir = None,
) -> None:
    """Show what a running server does."""
    from motionserver.cli.serving import status_text

    typer.echo(status_text(config, as_json, run_dir))


@app.command()
def record(
    config: MaybeConfig = None,
    out: Annotated[Path, typer.Option("--out", help="a new file", metavar="FILE.csv")] = Path(
        "drive.csv"
    ),
    seconds: Seconds = None,
    run_dir: RunDir = None,
) -> None:
    """Write what a running server does, one row per packet, without touching it."""
    from motionserver.cli.recording import record as record_drive

    typer.echo(record_drive(config, out, seconds, run_dir))


def _ask(op: str, config: Path | None, run_dir: Path | None) -> None:
    from motionserver.cli.serving import ask_guard

    answer = ask_guard(op, config, run_dir)
    granted = "ok" if answer["ok"] else "refused"
    typer.echo(f"{op}: {granted}, state {answer['state']}: {answer['reason']}")
    raise typer.Exit(0 if answer["ok"] else 1)


@app.command()
def demo(
    seconds: Seconds = None,
    no_page: Annotated[bool, typer.Option("--no-page", help="without the page")] = False,
    algorithm: Annotated[
        str, typer.Option("--algorithm", help="mpc, thondel2014 or classical", metavar="NAME")
    ] = "mpc",
    fault: Annotated[
        str,
        typer.Option(
            "--fault",
            help="cue-loss, planner-kill, guard-kill, web-kill, platform-loss or nan",
            metavar="F",
        ),
    ] = "",
    recording: Annotated[
        str, typer.Option("--recording", help="a shipped recording", metavar="NAME")
    ] = "truck_brake_accel",
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write the summary here", metavar="OUT")
    ] = None,
    open_page: Annotated[bool, typer.Option("--open", help="open the page in the browser")] = False,
) -> None:
    """A truck's drive moves a simulated Moog base: no configuration, no root, no hardware."""
    from motionserver.cli.demo import Demo

    raise typer.Exit(
        Demo(seconds, not no_page, algorithm, fault, recording, json_out, open_page).run()
    )


@app.command()
def emulate(
    form: Annotated[str, typer.Argument(help="moog-6dof2000e", metavar="FORMAT")],
    listen: Annotated[str, typer.Option("--listen", help="address", metavar="HOST:PORT")],
    force_to: Annotated[
        str, typer.Option("--force-to", help="send measured force as cues", metavar="HOST:PORT")
    ] = "",
    summary: Annotated[
        Path | None, typer.Option("--summary", help="write the verdict here", metavar="OUT")
    ] = None,
    log: Annotated[
        Path | None, typer.Option("--log", help="write every datagram here", metavar="OUT")
    ] = None,
    seconds: Seconds = None,
    seed: Annotated[int, typer.Option("--seed", help="of everything random")] = 0,
    cut_after: Annotated[
        float | None, typer.Option("--cut-after", help="pull the cable then", metavar="S")
    ] = None,
    may_lose: Annotated[
        bool, typer.Option("--may-lose", help="the wire loses packets: judge gaps by their length")
    ] = False,
) -> None:
    """Be a platform: state machine, rate-limited legs, latched faults, and a judge."""
    from motionserver.cli.devices import emulate as emulate_device

    verdict = emulate_device(
        form, listen, force_to, summary, log, seconds, seed, cut_after, may_lose
    )
    typer.echo(json.dumps(verdict, indent=2))


@app.command()
def replay(
    recording: Annotated[str, typer.Argument(help="CSV file or shipped name", metavar="INPUT.csv")],
    to: Annotated[str, typer.Option("--to", help="the server's input", metavar="HOST:PORT")],
    form: Annotated[str, typer.Option("--format", help="native or beamng")] = "native",
    loop: Annotated[bool, typer.Option("--loop", help="begin again at the end")] = False,
    preview: Annotated[
        float, typer.Option("--preview", help="seconds of future to send along", metavar="S")
    ] = 0.0,
) -> None:
    """Send a recording as a simulator would, in real time."""
    from motionserver.cli.devices import replay as replay_recording

    typer.echo(replay_recording(recording, to, form, loop, preview))
