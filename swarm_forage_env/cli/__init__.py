"""The console command `swarm-forage`. It may import everything; nothing imports it.

Commands import what they need when they run, so that `--help` answers at once.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

if TYPE_CHECKING:
    from metrics.score_table import ScoreTable
    from metrics.scoring import ScoringPlan
    from swarm_forage_env.study.runner import StudyResult
    from swarm_forage_env.study.spec import RunSpec
    from swarm_forage_env.study.store import RunStore

EXIT_FAILURE = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130
"""What shells report for a program that Ctrl-C ended."""

_USAGE_ERROR: type[Exception] = typer.BadParameter.__bases__[0]
"""Base of typer's complaints about arguments; typer gives it no public name."""
_WIDTH_WITHOUT_TERMINAL = 140

app = typer.Typer(
    help="Swarm foraging: run controllers, inspect scenarios, film runs.",
    add_completion=False,
    invoke_without_command=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Scenario = Annotated[str, typer.Option("--scenario", help="Preset; see 'swarm-forage list'.")]
Robots = Annotated[int | None, typer.Option("--robots", min=1, help="Swarm size.")]
Objects = Annotated[int | None, typer.Option("--objects", min=1, help="Number of objects.")]
Side = Annotated[float | None, typer.Option("--side", help="Side of the arena in m (search_and_rescue only).")]
Caches = Annotated[
    str | None, typer.Option("--caches", help="none, static or dynamic; default: the controller's world.")
]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any scenario field; may be repeated.")
]
Wrappers = Annotated[
    list[str] | None,
    typer.Option(
        "--wrapper",
        metavar="NAME:KEY=VALUE,...",
        help="Disturb the swarm, e.g. sensor_noise:sigma=0.03 or population:death_per_tick=0.0001; may be repeated.",
    ),
]

ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE.toml",
        help="Scenario fields and wrappers, one table each; what other options say goes before it.",
    ),
]

Measures = Annotated[str | None, typer.Option("--measures", help="Names separated by commas; default all.")]
Budget = Annotated[str, typer.Option("--budget", help="quick, standard or paper: how long, how many runs and levels.")]
ScoreSeeds = Annotated[int | None, typer.Option("--seeds", min=1, help="Runs per experiment; default the budget's.")]
ScoreHorizon = Annotated[float | None, typer.Option("--horizon", help="Seconds per run; default the budget's.")]
Out = Annotated[Path | None, typer.Option("--out", help="Folder for records; default results/SCENARIO.")]
Jobs = Annotated[int | None, typer.Option("--jobs", min=1, help="Processes; default one per core.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the results as JSON.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Print the plan and an estimate, run nothing.")]


def main() -> None:
    """Run the command line and exit; whatever a person got wrong is one line on stderr."""
    from swarm_forage_env.config import ConfigError
    from swarm_forage_env.recording import RecordError

    try:
        code = app(standalone_mode=False)
    except _USAGE_ERROR as error:
        code = _complain(error.format_message(), EXIT_USAGE)  # type: ignore[attr-defined]
    except (ConfigError, RecordError) as error:
        code = _complain(str(error), EXIT_USAGE)
    except OSError as error:
        named = f"{error.strerror}: {error.filename}" if error.strerror and error.filename else str(error)
        code = _complain(named, EXIT_FAILURE)
    except ImportError as error:
        code = _complain(str(error), EXIT_FAILURE)
    except (KeyboardInterrupt, typer.Abort):
        code = _complain("interrupted", EXIT_INTERRUPTED)
    sys.exit(code)


def _complain(message: str, code: int) -> int:
    typer.echo("swarm-forage: " + " ".join(message.split()), err=True)
    return code


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed_version

        typer.echo(f"swarm-forage {installed_version('swarm-forage-env')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
def run(
    scenario: Scenario = "warehouse_small",
    controller: Annotated[str, typer.Option(help="One or more names, separated by commas.")] = "crw",
    robots: Robots = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs per controller.")] = 1,
    first_seed: Annotated[int, typer.Option(min=0, help="Seed of the first of them.")] = 0,
    horizon: Annotated[float | None, typer.Option(help="Simulated seconds per run, whole intervals of 200 s.")] = None,
    objects: Objects = None,
    side: Side = None,
    caches: Caches = None,
    settings: Settings = None,
    wrappers: Wrappers = None,
    config: ConfigFile = None,
    out: Annotated[Path | None, typer.Option(help="Folder for records; default results/SCENARIO.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default one per core.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the plan and an estimate, run nothing.")] = False,
) -> None:
    """Run controllers in a scenario and compare them.

    Runs in parallel, shows a table, stores one record per run and draws performance over time. Runs that the folder
    holds already are not repeated, so an interrupted command can simply be given again.
    """
    from swarm_forage_env.cli.plan import WorldOptions, default_folder, plan_runs, split_names
    from swarm_forage_env.study.store import RunStore

    options = WorldOptions(
        scenario=scenario,
        robots=robots,
        objects=objects,
        side=side,
        caches=caches,
        horizon=horizon,
        settings=tuple(settings or ()),
        wrappers=tuple(wrappers or ()),
        config_file=config,
    )
    specs = plan_runs(options, split_names(controller), n_seeds=seeds, first_seed=first_seed)
    store = RunStore(out or default_folder(scenario))
    if dry_run:
        _show_plan(specs, store, jobs, as_json=as_json)
    else:
        result = _run_specs(specs, store, jobs)
        _show_results(specs, result, store, as_json=as_json)


def _show_plan(specs: "tuple[RunSpec, ...]", store: "RunStore", jobs: int | None, *, as_json: bool) -> None:
    from swarm_forage_env.cli.plan import estimated_seconds
    from swarm_forage_env.cli.report import plan_json, plan_note, plan_table
    from swarm_forage_env.study.runner import available_cores

    todo = [spec for spec in specs if spec.run_id not in store]
    processes = jobs or available_cores()
    seconds = estimated_seconds(todo, processes)
    if as_json:
        typer.echo(plan_json(specs, store, seconds))
    else:
        console = _console()
        console.print(plan_table(specs, store))
        console.print(plan_note(todo, seconds, processes))


def _run_specs(specs: "tuple[RunSpec, ...]", store: "RunStore", jobs: int | None) -> "StudyResult":
    from swarm_forage_env.study.runner import StudyInterrupted, run_all

    store.folder.mkdir(parents=True, exist_ok=True)
    try:
        return run_all(specs, store=store, jobs=jobs, progress=True)
    except StudyInterrupted as interrupt:
        _complain(f"{interrupt} They are in {store.folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None


def _show_results(specs: "tuple[RunSpec, ...]", result: "StudyResult", store: "RunStore", *, as_json: bool) -> None:
    from swarm_forage_env.cli.report import draw_performance, results_json, results_table, summarize

    notes = Console(stderr=True, highlight=False, soft_wrap=True)
    plot = None
    if result.records:
        plot = store.folder / "performance.png"
        try:
            draw_performance(specs, result.records, plot)
        except ImportError:
            plot = None
            notes.print("No picture without matplotlib: pip install 'swarm-forage-env[plots]'", markup=False)
    if as_json:
        typer.echo(results_json(specs, result, store, plot))
    elif result.records:
        _console().print(results_table(specs, summarize(specs, result.records)))
        notes.print(f"{len(result.records)} records in {store.folder}" + (f", picture {plot}" if plot else ""))
    for failure in result.failures:
        notes.print(f"failed: {failure.spec.describe()}: {failure.error}", markup=False)
        notes.print(f"  again, alone: swarm-forage rerun {store.failure_path(failure.run_id)}", markup=False)
    if result.failures:
        raise typer.Exit(EXIT_FAILURE)


@app.command()
def score(
    policy: Annotated[str | None, typer.Option(help="Name of a controller, or file of a trained policy.")] = None,
    curves: Annotated[
        Path | None, typer.Option(help="Score curves from elsewhere instead: a CSV or Parquet file (docs/scoring.md).")
    ] = None,
    scenario: Scenario = "warehouse_small",
    measures: Measures = None,
    budget: Budget = "standard",
    seeds: ScoreSeeds = None,
    horizon: ScoreHorizon = None,
    robots: Robots = None,
    objects: Objects = None,
    side: Side = None,
    caches: Caches = None,
    settings: Settings = None,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run a policy in all that the measures of swarm engineering need, and score it.

    Swarms of several sizes, throttled, noisy and failing robots; one table with intervals and noise floors. Runs that
    the folder holds already are not repeated.
    """
    from swarm_forage_env.cli.plan import WorldOptions, default_folder
    from swarm_forage_env.cli.scoring import ScoreOptions, build_plan, tables_of_file

    if (policy is None) == (curves is None):
        raise typer.BadParameter("Expected either --policy or --curves.")
    if curves is not None:
        _show_scores(tables_of_file(curves, measures), None, as_json=as_json)
        return
    world = WorldOptions(
        scenario=scenario, robots=robots, objects=objects, side=side, caches=caches, settings=tuple(settings or ())
    )
    options = ScoreOptions(policies=policy or "", measures=measures, budget=budget, seeds=seeds, horizon=horizon)
    folder = out or default_folder(scenario)
    _score(build_plan(world, options), folder, "scores.png", jobs, as_json=as_json, dry_run=dry_run)


@app.command()
def compare(
    policies: Annotated[str, typer.Option(help="Names or files of two or more policies, separated by commas.")],
    scenario: Scenario = "warehouse_small",
    measures: Measures = None,
    budget: Budget = "standard",
    seeds: ScoreSeeds = None,
    horizon: ScoreHorizon = None,
    robots: Robots = None,
    objects: Objects = None,
    side: Side = None,
    caches: Caches = None,
    settings: Settings = None,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Score policies in the same worlds, seed by seed, and say which differences are significant."""
    from swarm_forage_env.cli.plan import WorldOptions, default_folder
    from swarm_forage_env.cli.scoring import ScoreOptions, build_plan

    world = WorldOptions(
        scenario=scenario, robots=robots, objects=objects, side=side, caches=caches, settings=tuple(settings or ())
    )
    options = ScoreOptions(policies=policies, measures=measures, budget=budget, seeds=seeds, horizon=horizon)
    plan = build_plan(world, options, at_least=2)
    _score(plan, out or default_folder(scenario), "comparison.png", jobs, as_json=as_json, dry_run=dry_run)


def _score(plan: "ScoringPlan", folder: Path, picture: str, jobs: int | None, *, as_json: bool, dry_run: bool) -> None:
    from metrics.scoring import run_scores
    from swarm_forage_env.cli.scoring import plan_json, plan_text
    from swarm_forage_env.study.runner import StudyInterrupted, available_cores
    from swarm_forage_env.study.store import RunStore

    if dry_run:
        show = plan_json if as_json else plan_text
        typer.echo(show(plan, RunStore(folder), jobs or available_cores()))
        return
    folder.mkdir(parents=True, exist_ok=True)
    try:
        tables = run_scores(plan, out=folder, jobs=jobs, progress=True)
    except StudyInterrupted as interrupt:
        _complain(f"{interrupt} They are in {folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    _show_scores(tables, folder / picture, as_json=as_json)
    if any(table.failures for table in tables):
        raise typer.Exit(EXIT_FAILURE)


def _show_scores(tables: "tuple[ScoreTable, ...]", picture: Path | None, *, as_json: bool) -> None:
    from swarm_forage_env.cli.scoring import compared, comparison_text, draw, json_text, table_text

    comparison = compared(tables)
    drawn = None
    if picture is not None:
        try:
            drawn = draw(tables, picture)
        except ImportError:
            typer.echo("No picture without matplotlib: pip install 'swarm-forage-env[plots]'", err=True)
    if as_json:
        typer.echo(json_text(tables, comparison, drawn))
    else:
        typer.echo(table_text(tables[0]) if comparison is None else comparison_text(comparison))
    if drawn is not None:
        typer.echo(f"picture {drawn}", err=True)


@app.command("list")
def list_everything() -> None:
    """List scenarios and controllers."""
    from swarm_forage_env.cli.show import overview

    for table in overview():
        _console().print(table)


@app.command()
def info(name: Annotated[str, typer.Argument(help="A scenario, an environment id or a controller.")]) -> None:
    """Show all fields and spaces of a scenario, or what a controller is."""
    from swarm_forage_env.cli.show import information

    typer.echo(information(name))


@app.command()
def schema() -> None:
    """Show the columns of run records: name, type, unit, meaning."""
    from swarm_forage_env.recording import schema_table

    typer.echo(schema_table())


@app.command()
def rerun(file: Annotated[Path, typer.Argument(help="A record (.parquet) or a failure (.json).")]) -> None:
    """Run a stored run again, here; a record is compared with what comes out, a failure shows its traceback."""
    from swarm_forage_env.recording import RunRecord
    from swarm_forage_env.study.run import run_one
    from swarm_forage_env.study.spec import RunSpec
    from swarm_forage_env.study.store import read_failure

    if file.suffix == ".json":
        typer.echo(run_one(read_failure(file).spec).describe())
        return
    stored = RunRecord.read(file)
    again = run_one(RunSpec.from_json(stored.spec))
    typer.echo(again.describe())
    if not again.same_results(stored):
        raise typer.Exit(_complain(f"the results differ from those in {file}", EXIT_FAILURE))
    typer.echo(f"bit for bit the same as {file}")


@app.command()
def record(
    out: Annotated[Path, typer.Option(help="File to write, .gif or .mp4.")],
    scenario: Scenario = "warehouse_small",
    controller: Annotated[str, typer.Option(help="Name of a controller.")] = "crw",
    robots: Robots = None,
    seconds: Annotated[float, typer.Option(help="Simulated seconds to film.")] = 300.0,
    speedup: Annotated[float, typer.Option(help="Simulated seconds per second of film.")] = 20.0,
    fps: Annotated[float, typer.Option(help="Pictures per second.")] = 20.0,
    size: Annotated[int, typer.Option(help="Longer side of the arena in pixels.")] = 900,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the run.")] = 0,
    objects: Objects = None,
    side: Side = None,
    caches: Caches = None,
    settings: Settings = None,
    wrappers: Wrappers = None,
    config: ConfigFile = None,
) -> None:
    """Film a run."""
    from rich.progress import Progress

    from swarm_forage_env.cli.plan import WorldOptions, plan_runs
    from swarm_forage_env.rendering_run import record_run
    from swarm_forage_env.rendering_view import RenderError

    options = WorldOptions(
        scenario=scenario,
        robots=robots,
        objects=objects,
        side=side,
        caches=caches,
        settings=tuple(settings or ()),
        wrappers=tuple(wrappers or ()),
        config_file=config,
    )
    spec = plan_runs(options, (controller,), n_seeds=1, first_seed=seed)[0]
    try:
        screen = Console(stderr=True)
        with Progress(console=screen, transient=True, disable=not screen.is_terminal) as bar:
            task = bar.add_task("pictures")
            written = record_run(
                spec.scenario,
                spec.policy,
                out,
                seconds=seconds,
                seed=seed,
                speedup=speedup,
                fps=fps,
                size_px=size,
                wrappers=spec.wrappers,
                progress=lambda done, total: bar.update(task, completed=done, total=total),
            )
    except RenderError as error:
        raise typer.BadParameter(str(error)) from error
    typer.echo(f"wrote {written}")


def _console() -> Console:
    """Return a console on stdout; tables stay whole where nobody knows the width."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _WIDTH_WITHOUT_TERMINAL
    return console
