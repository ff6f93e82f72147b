"""All commands; what they need is imported when they run, so that help is quick."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from motionserver import __version__

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Motion-cueing server: a driving simulator in, a hexapod out, verified before it moves.",
)
ConfigFile = Annotated[Path, typer.Argument(help="configuration, TOML", metavar="CONFIG.toml")]
MaybeConfig = Annotated[
    Path | None, typer.Argument(help="configuration of the running server", metavar="CONFIG.toml")
]


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
    config: ConfigFile,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="play everything, send nothing that moves")
    ] = False,
) -> None:
    """Run the server: guard, planner and page; parks on Ctrl-C or SIGTERM."""
    from motionserver.cli.serving import serve

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
) -> None:
    """Validate a configuration, show what it means and what its machine reaches."""
    from motionserver.cli.workspace import check_text

    typer.echo(check_text(config, platform, html_out, svg_out, json_out))


@app.command()
def engage(config: MaybeConfig = None) -> None:
    """Raise the platform: an operator's edge, given at the console."""
    _ask("engage", config)


@app.command()
def park(config: MaybeConfig = None) -> None:
    """Park the platform, from whatever it does."""
    _ask("park", config)


@app.command()
def reset(config: MaybeConfig = None) -> None:
    """Leave FAULT or SAFE once the cause is gone."""
    _ask("reset", config)


@app.command()
def status(
    config: MaybeConfig = None,
    as_json: Annotated[bool, typer.Option("--json", help="print everything as JSON")] = False,
) -> None:
    """Show what a running server does."""
    from motionserver.cli.serving import status_text

    typer.echo(status_text(config, as_json))


@app.command()
def record(
    config: MaybeConfig = None,
    out: Annotated[Path, typer.Option("--out", help="a new file", metavar="FILE.csv")] = Path(
        "drive.csv"
    ),
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="end by itself", metavar="S")
    ] = None,
) -> None:
    """Write what a running server does, one row per packet, without touching it."""
    from motionserver.cli.recording import record as record_drive

    typer.echo(record_drive(config, out, seconds))


def _ask(op: str, config: Path | None) -> None:
    from motionserver.cli.serving import ask_guard

    answer = ask_guard(op, config)
    granted = "ok" if answer["ok"] else "refused"
    typer.echo(f"{op}: {granted}, state {answer['state']}: {answer['reason']}")
    raise typer.Exit(0 if answer["ok"] else 1)


@app.command()
def demo(
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="end by itself", metavar="S")
    ] = None,
    no_page: Annotated[bool, typer.Option("--no-page", help="without the page")] = False,
    algorithm: Annotated[
        str, typer.Option("--algorithm", help="mpc, thondel2014 or classical", metavar="NAME")
    ] = "mpc",
    fault: Annotated[
        str,
        typer.Option(
            "--fault", help="cue-loss, planner-kill, web-kill, platform-loss or nan", metavar="F"
        ),
    ] = "",
    recording: Annotated[
        str, typer.Option("--recording", help="a shipped recording", metavar="NAME")
    ] = "truck_brake_accel",
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write the summary here", metavar="OUT")
    ] = None,
) -> None:
    """A truck's drive moves a simulated Moog base: no configuration, no root, no hardware."""
    from motionserver.cli.demo import Demo

    raise typer.Exit(Demo(seconds, not no_page, algorithm, fault, recording, json_out).run())


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
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="end by itself", metavar="S")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="of everything random")] = 0,
    cut_after: Annotated[
        float | None, typer.Option("--cut-after", help="pull the cable then", metavar="S")
    ] = None,
) -> None:
    """Be a platform: state machine, rate-limited legs, latched faults, and a judge."""
    from motionserver.cli.devices import emulate as emulate_device

    verdict = emulate_device(form, listen, force_to, summary, log, seconds, seed, cut_after)
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


@app.command()
def evaluate(
    recording: Annotated[Path | None, typer.Argument(help="recording", metavar="INPUT.csv")] = None,
    algorithm: Annotated[
        str, typer.Option("--algorithm", help="names, comma between", metavar="A,B")
    ] = "mpc,thondel2014,classical",
    platform: Annotated[
        str, typer.Option("--platform", help="preset or file", metavar="PRESET|FILE")
    ] = "t2-compact",
    scale: Annotated[
        float | None, typer.Option("--scale", help="share wanted, else the tuning's", metavar="K")
    ] = None,
    rate: Annotated[float, typer.Option("--rate", help="of setpoints", metavar="HZ")] = 500.0,
    planner_rate: Annotated[
        float | None,
        typer.Option("--planner-rate", help="100, for omct 50 unless told", metavar="HZ"),
    ] = None,
    head: Annotated[
        str, typer.Option("--head", help="from the reference point [m]", metavar="X,Y,Z")
    ] = "",
    reference: Annotated[
        str, typer.Option("--reference", help="reference model", metavar="NAME")
    ] = "",
    tilt_rate: Annotated[
        str, typer.Option("--tilt-rate", help="threshold, or free", metavar="DEG_S")
    ] = "",
    tuning: Annotated[
        str, typer.Option("--tuning", help="tunables", metavar="PRESET|FILE.toml")
    ] = "",
    preview: Annotated[
        float, typer.Option("--preview", help="seconds told ahead, perfectly", metavar="S")
    ] = 0.0,
    disturb: Annotated[
        bool, typer.Option("--disturb", help="late, failed and senseless plans")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", help="of --disturb")] = 0,
    jobs: Annotated[int, typer.Option("--jobs", help="processes at the same time")] = 2,
    compare: Annotated[
        Path | None,
        typer.Option("--compare", help="all recordings of a folder", metavar="FOLDER"),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", help="of --compare (resumes) and omct", metavar="DIR")
    ] = Path("out/evaluate"),
    amplitude: Annotated[
        float, typer.Option("--amplitude", help="of omct's forces [m/s2]", metavar="A")
    ] = 1.0,
    boundaries: Annotated[
        Path | None, typer.Option("--boundaries", help="of omct", metavar="FILE.toml")
    ] = None,
    setpoints: Annotated[
        Path | None, typer.Option("--setpoints", help="write executed samples", metavar="OUT.csv")
    ] = None,
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write all figures", metavar="OUT")
    ] = None,
    html_out: Annotated[
        Path | None, typer.Option("--html", help="write a report", metavar="OUT")
    ] = None,
) -> None:
    """Judge algorithms offline with the live code: a recording, a folder of them, or sines."""
    from motionserver.cli.offline import run_compare, run_evaluate, run_omct
    from motionserver.evaluate.options import EvaluateOptions

    sines = compare is None and recording == Path("omct")
    options = EvaluateOptions(
        algorithm,
        platform,
        scale,
        rate,
        planner_rate or (50.0 if sines else 100.0),
        head,
        reference,
        tilt_rate,
        tuning,
        preview,
        disturb,
        seed,
        jobs,
        setpoints,
        json_out,
        html_out,
    )
    if compare is not None:
        raise typer.Exit(run_compare(compare, out, options))
    if sines:
        raise typer.Exit(run_omct(out, options, amplitude, boundaries))
    if recording is None:
        raise typer.BadParameter("a recording, the word omct, or --compare FOLDER is needed")
    raise typer.Exit(run_evaluate(recording, options))


@app.command()
def tune(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="two or more recordings; one will do for --predictor", metavar="INPUT.csv..."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="folder of preset and report", metavar="DIR")],
    algorithm: Annotated[
        str, typer.Option("--algorithm", help="mpc, thondel2014 or classical", metavar="NAME")
    ] = "mpc",
    criterion: Annotated[
        str, typer.Option("--criterion", help="rmse, incongruence or sickness", metavar="NAME")
    ] = "rmse",
    trials: Annotated[
        int, typer.Option("--trials", help="sets of values, the defaults among them", metavar="N")
    ] = 30,
    refine: Annotated[
        int, typer.Option("--refine", help="more of them near the best of each fold", metavar="N")
    ] = 0,
    seed: Annotated[int, typer.Option("--seed", help="of everything random", metavar="S")] = 0,
    platform: Annotated[
        str, typer.Option("--platform", help="preset or file", metavar="PRESET|FILE")
    ] = "t2-compact",
    head: Annotated[
        str, typer.Option("--head", help="driver's head on the platform [m]", metavar="X,Y,Z")
    ] = "",
    excerpt: Annotated[
        float, typer.Option("--excerpt", help="most eventful seconds judged; 0 = all", metavar="S")
    ] = 20.0,
    planner_rate: Annotated[
        float, typer.Option("--planner-rate", help="plans per second", metavar="HZ")
    ] = 50.0,
    scale: Annotated[float, typer.Option("--scale", help="share wanted", metavar="K")] = 0.6,
    search_scale: Annotated[
        bool, typer.Option("--search-scale", help="search the scale asked for as well")
    ] = False,
    tilt_rate: Annotated[
        float, typer.Option("--tilt-rate", help="threshold of tilting", metavar="DEG_S")
    ] = 3.0,
    sickness_weight: Annotated[
        float, typer.Option("--sickness-weight", help="of that criterion, per m/s2", metavar="W")
    ] = 1.0,
    jobs: Annotated[int, typer.Option("--jobs", help="processes", metavar="J")] = 1,
    predictor: Annotated[
        str,
        typer.Option(
            "--predictor",
            help="fit the reference 'learned' instead, under this name",
            metavar="NAME",
        ),
    ] = "",
) -> None:
    """Search tunables on recordings, leave-one-out; writes a preset and the reasons for it."""
    from motionserver.cli.tuning import run_predictor, run_tune

    if predictor:
        raise typer.Exit(run_predictor(recordings, predictor, out))
    options = {
        "algorithm": algorithm, "criterion": criterion, "trials": trials, "refine": refine,
        "seed": seed, "platform": platform, "excerpt": excerpt, "planner_hz": planner_rate,
        "scale": scale, "search_scale": search_scale, "tilt_rate_deg_s": tilt_rate,
        "sickness_weight": sickness_weight, "jobs": jobs,
    }  # fmt: skip
    raise typer.Exit(run_tune(recordings, out, head, **options))


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(help="thondel2014")],
    out: Annotated[
        Path, typer.Option("--out", help="folder of figures and numbers", metavar="DIR")
    ] = Path("out/thondel2014"),
) -> None:
    """Redraw a paper's figures; exits non-zero when its claims no longer hold."""
    from motionserver.cli.offline import run_reproduce

    raise typer.Exit(run_reproduce(paper, out))


@app.command()
def bench(
    what: Annotated[str, typer.Argument(help="loop, plan, latency or all")] = "all",
    seconds: Annotated[
        float, typer.Option("--seconds", help="length of each part", metavar="S")
    ] = 20.0,
    json_out: Annotated[
        Path | None, typer.Option("--json", help="write all figures", metavar="OUT")
    ] = None,
    ticks: Annotated[
        int | None, typer.Option("--ticks", help="plan: periods per case", metavar="N")
    ] = None,
    paced: Annotated[
        bool, typer.Option("--paced/--unpaced", help="plan: wait for each period, as live")
    ] = True,
    only: Annotated[
        str, typer.Option("--only", help="plan: cases whose name has this in it", metavar="WORD")
    ] = "",
) -> None:
    """Measure lateness, plan times and latency beside a sentinel that only sleeps."""
    from motionserver.cli.offline import run_bench

    raise typer.Exit(run_bench(what, seconds, json_out, ticks, paced, only))
