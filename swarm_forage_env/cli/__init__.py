"""The console command `swarm-forage`. It may import everything; nothing imports it.

Commands import what they need when they run, so that `--help` answers at once.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from swarm_forage_env.cli.options import (
    EXIT_FAILURE,
    EXIT_INTERRUPTED,
    EXIT_USAGE,
    NO_PICTURE,
    AsJson,
    Caches,
    ConfigFile,
    DryRun,
    Jobs,
    Objects,
    Out,
    Robots,
    Scenario,
    Settings,
    Side,
    Wrappers,
    complain,
)
from swarm_forage_env.cli.score_commands import compare, score
from swarm_forage_env.cli.stuck import stuck
from swarm_forage_env.cli.train_command import train

if TYPE_CHECKING:
    from swarm_forage_env.study.runner import StudyResult
    from swarm_forage_env.study.spec import RunSpec
    from swarm_forage_env.study.store import RunStore

_USAGE_ERROR: type[Exception] = typer.BadParameter.__bases__[0]
"""Base of typer's complaints about arguments; typer gives it no public name."""
_WIDTH_WITHOUT_TERMINAL = 140

app = typer.Typer(
    help="Swarm foraging: run, film, train and score policies, inspect scenarios.",
    add_completion=False,
    invoke_without_command=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line and exit; whatever a person got wrong is one line on stderr."""
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.study.record import RecordError

    try:
        code = app(standalone_mode=False)
    except _USAGE_ERROR as error:
        code = complain(error.format_message(), EXIT_USAGE)  # type: ignore[attr-defined]
    except (ConfigError, RecordError) as error:
        code = complain(str(error), EXIT_USAGE)
    except OSError as error:
        named = f"{error.strerror}: {error.filename}" if error.strerror and error.filename else str(error)
        code = complain(named, EXIT_FAILURE)
    except ImportError as error:
        code = complain(str(error), EXIT_FAILURE)
    except (KeyboardInterrupt, typer.Abort):
        code = complain("interrupted", EXIT_INTERRUPTED)
    sys.exit(code)


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
    policy: Annotated[
        str,
        typer.Option(
            "--policy", "--controller", help="One or more, separated by commas: names, or files of trained ones."
        ),
    ] = "crw",
    robots: Robots = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs per policy.")] = 1,
    first_seed: Annotated[int, typer.Option(min=0, help="Seed of the first of them.")] = 0,
    horizon: Annotated[float | None, typer.Option(help="Simulated seconds per run, whole intervals of 200 s.")] = None,
    objects: Objects = None,
    side: Side = None,
    caches: Caches = None,
    settings: Settings = None,
    wrappers: Wrappers = None,
    config: ConfigFile = None,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run policies in a scenario and compare how they perform.

    Runs in parallel, shows a table, stores one record per run and draws performance over time. Runs that the folder
    holds already are not repeated, so an interrupted command can simply be given again.
    """
    from swarm_forage_env.cli.plan import ScenarioOptions, default_folder, plan_runs, split_names
    from swarm_forage_env.study.store import RunStore

    options = ScenarioOptions(
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
    specs = plan_runs(options, split_names(policy), n_seeds=seeds, first_seed=first_seed)
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
        complain(f"{interrupt} They are in {store.folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None


def _show_results(specs: "tuple[RunSpec, ...]", result: "StudyResult", store: "RunStore", *, as_json: bool) -> None:
    from metrics.scoring.texts import counted
    from swarm_forage_env.cli.report import draw_performance, results_json, results_table, summarize

    notes = Console(stderr=True, highlight=False, soft_wrap=True)
    plot = None
    if result.records:
        plot = store.folder / "performance.png"
        try:
            draw_performance(specs, result.records, plot)
        except ImportError:
            plot = None
            notes.print(NO_PICTURE, markup=False)
    if as_json:
        typer.echo(results_json(specs, result, store, plot))
    elif result.records:
        _console().print(results_table(specs, summarize(specs, result.records)))
        notes.print(
            f"{counted(len(result.records), 'record')} in {store.folder}" + (f", picture {plot}" if plot else "")
        )
    for failure in result.failures:
        notes.print(f"failed: {failure.spec.describe()}: {failure.error}", markup=False)
        notes.print(f"  again, alone: swarm-forage rerun {store.failure_path(failure.run_id)}", markup=False)
    if result.failures:
        raise typer.Exit(EXIT_FAILURE)


app.command()(score)
app.command()(compare)
app.command()(train)
app.command()(stuck)


@app.command("list")
def list_everything() -> None:
    """List scenarios and policies."""
    from swarm_forage_env.cli.show import overview

    for table in overview():
        _console().print(table)


@app.command()
def info(name: Annotated[str, typer.Argument(help="A scenario, an environment id, a policy or its file.")]) -> None:
    """Show all fields and spaces of a scenario, or what a policy is."""
    from swarm_forage_env.cli.show import information

    typer.echo(information(name))


@app.command()
def schema() -> None:
    """Show the columns of run records: name, type, unit, meaning."""
    from swarm_forage_env.study.record import schema_table

    typer.echo(schema_table())


@app.command()
def rerun(file: Annotated[Path, typer.Argument(help="A record (.parquet) or a failure (.json).")]) -> None:
    """Run a stored run again, here; a record is compared with what comes out, a failure shows its traceback."""
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.policies.registry import load_policy
    from swarm_forage_env.study.record import RunRecord
    from swarm_forage_env.study.run import run_one, run_policy
    from swarm_forage_env.study.spec import RunSpec
    from swarm_forage_env.study.store import read_failure

    if file.suffix == ".json":
        typer.echo(run_one(read_failure(file).spec).describe())
        return
    stored = RunRecord.read(file)
    spec = RunSpec.from_json(stored.spec)
    try:
        policy = load_policy(spec.policy, spec.parameters)
    except ValueError as error:  # not installed here, or its file has gone or changed
        raise ConfigError(f"Cannot run {file} again: {error}") from error
    again = run_policy(policy, spec)
    typer.echo(again.describe())
    if not again.same_results(stored):
        raise typer.Exit(complain(f"the results differ from those in {file}", EXIT_FAILURE))
    typer.echo(f"bit for bit the same as {file}")


@app.command()
def record(
    out: Annotated[
        Path | None, typer.Option(help="File to write, .gif or .mp4; default results/SCENARIO_POLICY.gif.")
    ] = None,
    scenario: Scenario = "warehouse_small",
    policy: Annotated[str, typer.Option("--policy", "--controller", help="Name, or file of a trained policy.")] = "crw",
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

    from swarm_forage_env.cli.plan import ScenarioOptions, plan_runs
    from swarm_forage_env.policies.model_files import ModelError
    from swarm_forage_env.policies.network import NetworkError
    from swarm_forage_env.rendering.view import RenderError
    from swarm_forage_env.study.film import record_run

    options = ScenarioOptions(
        scenario=scenario,
        robots=robots,
        objects=objects,
        side=side,
        caches=caches,
        settings=tuple(settings or ()),
        wrappers=tuple(wrappers or ()),
        config_file=config,
    )
    spec = plan_runs(options, (policy,), n_seeds=1, first_seed=seed)[0]
    film = out or _film_in_results(f"{scenario}_{Path(policy).stem}.gif")
    try:
        screen = Console(stderr=True)
        with Progress(console=screen, transient=True, disable=not screen.is_terminal) as bar:
            task = bar.add_task("pictures")
            written = record_run(
                spec.scenario,
                spec.policy,
                film,
                seconds=seconds,
                seed=seed,
                speedup=speedup,
                fps=fps,
                size_px=size,
                caches=spec.scenario.caches,  # else "none" would mean the policy's own
                wrappers=spec.wrappers,
                progress=lambda done, total: bar.update(task, completed=done, total=total),
            )
    except (RenderError, ModelError, NetworkError) as error:
        raise typer.BadParameter(str(error)) from error
    typer.echo(f"wrote {written}")


def _film_in_results(name: str) -> Path:
    folder = Path("results")
    folder.mkdir(exist_ok=True)
    return folder / name


def _console() -> Console:
    """Return a console on stdout; tables stay whole where nobody knows the width."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _WIDTH_WITHOUT_TERMINAL
    return console
