"""The command `run`."""

from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions, takes_options
from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, DryRun, FirstSeed, Jobs, Out, no_picture
from swarm_forage_env.cli.terminal import notes, output

if TYPE_CHECKING:
    from swarm_forage_env.runs.runner import Outcomes
    from swarm_forage_env.runs.spec import RunSpec
    from swarm_forage_env.runs.store import RunStore


@takes_options
def run(
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[int, typer.Option(min=1, help="Runs per policy.")] = 1,
    first_seed: FirstSeed = 0,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run policies in a scenario and compare how they perform.

    Runs in parallel, shows a table, stores one record per run and draws performance over time. Runs that the folder
    holds already are not repeated, so an interrupted command can simply be given again.
    """
    from swarm_forage_env.cli.scenario_options import default_folder, plan_runs
    from swarm_forage_env.runs.store import RunStore

    specs = plan_runs(described, policies.names("crw"), n_seeds=seeds, first_seed=first_seed)
    store = RunStore(out or default_folder(specs[0].scenario.name))
    if dry_run:
        _show_plan(specs, store, jobs, as_json=as_json)
    else:
        result = _run_specs(specs, store, jobs)
        _show_results(specs, result, store, as_json=as_json)


def _show_plan(specs: "tuple[RunSpec, ...]", store: "RunStore", jobs: int | None, *, as_json: bool) -> None:
    from swarm_forage_env.cli.report import estimated_seconds, plan_json, plan_note, plan_table
    from swarm_forage_env.runs.workers import available_cores

    todo = [spec for spec in specs if spec.run_id not in store]
    processes = jobs or available_cores()
    seconds = estimated_seconds(todo, processes)
    if as_json:
        typer.echo(plan_json(specs, store, seconds))
    else:
        console = output()
        console.print(plan_table(specs, store))
        console.print(plan_note(todo, seconds, processes))


def _run_specs(specs: "tuple[RunSpec, ...]", store: "RunStore", jobs: int | None) -> "Outcomes":
    from swarm_forage_env.cli.errors import resumable
    from swarm_forage_env.runs.runner import run_specs

    with resumable(store.folder):
        return run_specs(specs, store=store, jobs=jobs, progress=True)


def _show_results(specs: "tuple[RunSpec, ...]", result: "Outcomes", store: "RunStore", *, as_json: bool) -> None:
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.cli.report import draw_performance, results_json, results_table, summarize

    aside = notes()
    plot = None
    if result.records:
        plot = store.folder / "performance.png"
        try:
            draw_performance(specs, [*result.records.values()], plot)
        except ImportError as error:
            plot = None
            aside.print(str(error))
        except OSError as error:  # the table is worth more than its picture
            aside.print(no_picture(plot, error))
            plot = None
    if as_json:
        typer.echo(results_json(specs, result, store, plot))
    elif result.records:
        output().print(results_table(specs, summarize(specs, [*result.records.values()])))
        aside.print(
            f"{counted(len(result.records), 'record')} in {store.folder}" + (f", picture {plot}" if plot else "")
        )
    for failure in result.failures.values():
        aside.print(f"failed: {failure.spec.describe()}: {failure.error}")
        aside.print(f"  again, alone: swarm-forage rerun {store.failure_path(failure.run_id)}")
    if result.failures:
        raise typer.Exit(EXIT_FAILURE)
