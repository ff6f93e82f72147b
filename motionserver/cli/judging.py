"""Commands that judge, tune and measure offline; what they need is imported when they run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motionserver.cli.commands import app
from motionserver.cli.modes import EVALUATE, TUNE_PREDICTOR, refuse_idle, written

Platform = Annotated[str, typer.Option("--platform", help="preset or file", metavar="PRESET|FILE")]
Head = Annotated[
    str, typer.Option("--head", help="driver's head from the reference point [m]", metavar="X,Y,Z")
]
Figures = Annotated[Path | None, typer.Option("--json", help="write all figures", metavar="OUT")]


@app.command()
def evaluate(
    context: typer.Context,
    recording: Annotated[Path | None, typer.Argument(help="recording", metavar="INPUT.csv")] = None,
    algorithm: Annotated[
        str, typer.Option("--algorithm", help="names, comma between", metavar="A,B")
    ] = "mpc,thondel2014,classical",
    platform: Platform = "t2-compact",
    scale: Annotated[
        float | None, typer.Option("--scale", help="share wanted, else the tuning's", metavar="K")
    ] = None,
    rate: Annotated[float, typer.Option("--rate", help="of setpoints", metavar="HZ")] = 500.0,
    planner_rate: Annotated[
        float | None,
        typer.Option("--planner-rate", help="100, for omct 50 unless told", metavar="HZ"),
    ] = None,
    head: Head = "",
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
        float, typer.Option("--preview", help="seconds told ahead without error", metavar="S")
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
    held_out: Annotated[
        Path | None,
        typer.Option(
            "--held-out",
            help="result.json of tune; --compare then drives each recording with the tunables "
            "chosen without it",
            metavar="RESULT.json",
        ),
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
    predictions: Annotated[
        bool, typer.Option("--predictions", help="only how well reference models foretell it")
    ] = False,
    setpoints: Annotated[
        Path | None,
        typer.Option(
            "--setpoints", help="write executed samples of the only --algorithm", metavar="OUT.csv"
        ),
    ] = None,
    json_out: Figures = None,
    html_out: Annotated[
        Path | None, typer.Option("--html", help="write a report", metavar="OUT")
    ] = None,
) -> None:
    """Judge algorithms offline with the live code: a recording, a folder of them, or sines."""
    from motionserver.cli.offline import run_evaluate, run_predictions
    from motionserver.evaluate.compare import command as comparison
    from motionserver.evaluate.lockstep import PLANNER_HZ
    from motionserver.evaluate.omct import command as sine_test
    from motionserver.evaluate.omct.run import PLANNER_HZ as SINES_HZ
    from motionserver.evaluate.options import EvaluateOptions

    sines = compare is None and recording == Path("omct")
    if compare is None and recording is None:
        raise typer.BadParameter("a recording, the word omct, or --compare FOLDER is needed")
    mode = "--predictions" if predictions else "INPUT.csv"
    mode = "--compare" if compare is not None else "omct" if sines else mode
    refuse_idle(context, mode, EVALUATE)
    if planner_rate is None:
        planner_rate = SINES_HZ if sines else PLANNER_HZ
    options = EvaluateOptions(
        algorithm,
        platform,
        scale,
        rate,
        planner_rate,
        head,
        reference,
        tilt_rate,
        tuning,
        preview,
        disturb,
        seed,
        jobs,
        held_out,
        setpoints,
        json_out,
        html_out,
        written(context),
    )
    if compare is not None:
        raise typer.Exit(comparison.compare(compare, out, options))
    if sines:
        raise typer.Exit(sine_test.omct(out, options, amplitude, boundaries))
    assert recording is not None
    if predictions:
        raise typer.Exit(run_predictions(recording, options))
    raise typer.Exit(run_evaluate(recording, options))


@app.command()
def tune(
    context: typer.Context,
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
    platform: Platform = "t2-compact",
    head: Head = "",
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
        refuse_idle(context, "--predictor", TUNE_PREDICTOR, rest="a search")
        raise typer.Exit(run_predictor(recordings, predictor, out))
    options = {
        "algorithm": algorithm, "criterion": criterion, "trials": trials, "refine": refine,
        "seed": seed, "platform": platform, "excerpt": excerpt, "planner_hz": planner_rate,
        "scale": scale, "search_scale": search_scale, "tilt_rate_deg_s": tilt_rate,
        "sickness_weight": sickness_weight, "jobs": jobs,
    }  # fmt: skip
    if "platform" not in written(context):
        del options["platform"]
    raise typer.Exit(run_tune(recordings, out, head, **options))


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(help="thondel2014")],
    out: Annotated[
        Path, typer.Option("--out", help="folder of figures and numbers", metavar="DIR")
    ] = Path("out/thondel2014"),
) -> None:
    """Redraw a paper's figures; exits non-zero when its claims no longer hold."""
    from motionserver.evaluate.reproduce.command import reproduce as redraw

    raise typer.Exit(redraw(paper, out))


@app.command()
def bench(
    what: Annotated[str, typer.Argument(help="loop, guard, flood, plan, latency or all")] = "all",
    seconds: Annotated[
        float, typer.Option("--seconds", help="length of each part", metavar="S")
    ] = 20.0,
    json_out: Figures = None,
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
    from motionserver.evaluate.bench.command import run_bench

    raise typer.Exit(run_bench(what, seconds, json_out, ticks, paced, only))
