"""The command `ablate`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, Caches, DryRun, Jobs, Out
from swarm_forage_env.cli.world_options import World, takes_world

if TYPE_CHECKING:
    from swarm_forage_env.runs.store import RunStore
    from swarm_forage_env.studies.ablation import Ablation


@takes_world("performance", "settings", "wrappers")
def ablate(
    *,
    scenario: Annotated[
        str, typer.Option("--scenario", help="One or more presets, separated by commas.")
    ] = "warehouse_small,warehouse_medium",
    policy: Annotated[
        str, typer.Option("--policy", "--controller", help="One or more, separated by commas.")
    ] = "crw,dpo,stochm,stochx",
    robots: Annotated[str, typer.Option("--robots", help="One or more swarm sizes, separated by commas.")] = "32,256",
    quirks: Annotated[
        str, typer.Option("--quirks", help="Which to switch, separated by commas; all; or none: the readings only.")
    ] = "all",
    seeds: Annotated[int, typer.Option(min=2, help="Runs per policy, size and switched quirk.")] = 3,
    horizon: Annotated[float | None, typer.Option(help="Simulated seconds per run, whole intervals of 200 s.")] = None,
    caches: Caches = None,
    described: World,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Switch one quirk at a time, on in the described reading and off in the authors' program, and show what it moves.

    The tables are Markdown. Records go to a folder; an interrupted command can simply be given again.
    """
    from pathlib import Path

    from swarm_forage_env._internal.fields import MOST_SEEDS, whole
    from swarm_forage_env.cli.scenario_options import split_names, split_numbers
    from swarm_forage_env.runs.store import RunStore

    whole("--seeds", seeds, at_least=2, at_most=MOST_SEEDS)
    worlds = [
        replace(described, scenario=name, robots=size, horizon=horizon)
        for name in split_names(scenario)
        for size in split_numbers("--robots", robots, int)
    ]
    plan = _plan(worlds, split_names(policy), quirks, seeds, caches)
    store = RunStore(out or Path("results", "ablation"))
    if dry_run:
        _show_plan(plan, store, seeds, jobs)
    else:
        _run(plan, store, jobs, as_json=as_json)


def _plan(
    described: Sequence[World], policies: Sequence[str], quirks: str, seeds: int, caches: str | None
) -> "Ablation":
    from swarm_forage_env.cli.scenario_options import described_world, split_names
    from swarm_forage_env.scenarios.quirks import QUIRK_NAMES
    from swarm_forage_env.studies.ablation import plan_ablation
    from swarm_forage_env.wrappers.world import World

    worlds = [World(scenario, wrappers) for scenario, _, wrappers in map(described_world, described)]
    every = {"all": QUIRK_NAMES, "none": ()}
    switched = every[quirks] if quirks in every else split_names(quirks)
    return plan_ablation(worlds, policies, quirks=switched, seeds=range(seeds), caches=caches)


def _show_plan(plan: "Ablation", store: "RunStore", seeds: int, jobs: int | None) -> None:
    from swarm_forage_env.cli.report import estimated_seconds, plan_note
    from swarm_forage_env.runs.workers import available_cores

    todo = [spec for spec in plan.specs if spec.run_id not in store]
    processes = jobs or available_cores()
    note = plan_note(todo, estimated_seconds(todo, processes), processes)
    typer.echo(f"At most {note} A quirk that changes nothing needs one run instead of {seeds}.")


def _run(plan: "Ablation", store: "RunStore", jobs: int | None, *, as_json: bool) -> None:
    from swarm_forage_env.cli.ablation_report import ablation_json, ablation_pages
    from swarm_forage_env.cli.interrupts import resumable
    from swarm_forage_env.scenarios.performance import performance_of
    from swarm_forage_env.studies.ablation import run_ablation

    with resumable(store.folder):
        result = run_ablation(plan, store=store, jobs=jobs, progress=True)
    show = ablation_json if as_json else ablation_pages
    typer.echo(show(result, performance_of(plan.specs[0].scenario.performance)))
    for failure in result.failures:
        typer.echo(f"failed: {failure.spec.describe()}: {failure.error}", err=True)
    if result.failures:
        raise typer.Exit(EXIT_FAILURE)
