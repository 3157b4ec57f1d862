"""The command `ablate`."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

import typer

from metrics import PAPER_POLICIES
from swarm_forage_env.cli.option_groups import PlaceOptions, PolicyOptions, WorldOptions, takes_options
from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, DryRun, Jobs, Out

if TYPE_CHECKING:
    from swarm_forage_env.runs.store import RunStore
    from swarm_forage_env.studies.ablation import Ablation


@dataclass(frozen=True, kw_only=True, slots=True)
class SeveralPlaces(PlaceOptions):
    """Options of worlds that differ in scenario and size."""

    scenario: Annotated[
        str,
        typer.Option("--scenario", metavar="NAME|FILE.toml", help="One or more presets or files, separated by commas."),
    ] = "warehouse_small,warehouse_medium"
    robots: Annotated[str, typer.Option("--robots", help="One or more swarm sizes, separated by commas.")] = "32,256"

    def places(self) -> list[WorldOptions]:
        """Return the options of each world."""
        from swarm_forage_env.cli.scenario_options import split_names, split_numbers

        common = {field.name: getattr(self, field.name) for field in fields(PlaceOptions)}
        return [
            WorldOptions(**{**common, "scenario": name}, robots=size)
            for name in split_names(self.scenario)
            for size in split_numbers("--robots", self.robots, int)
        ]


@takes_options
def ablate(
    policies: PolicyOptions,
    described: SeveralPlaces,
    quirks: Annotated[
        str, typer.Option("--quirks", help="Which to switch, separated by commas; all; or none: the readings only.")
    ] = "all",
    seeds: Annotated[int, typer.Option(min=2, help="Runs per policy, size and switched quirk.")] = 3,
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
    from swarm_forage_env.runs.store import RunStore

    whole("--seeds", seeds, at_least=2, at_most=MOST_SEEDS)
    plan = _plan(described, policies.names(",".join(PAPER_POLICIES)), quirks, seeds)
    store = RunStore(out or Path("results", "ablation"))
    if dry_run:
        _show_plan(plan, store, seeds, jobs)
    else:
        _run(plan, store, jobs, as_json=as_json)


def _plan(described: SeveralPlaces, policies: Sequence[str], quirks: str, seeds: int) -> "Ablation":
    from swarm_forage_env.cli.scenario_options import described_world, split_names
    from swarm_forage_env.scenarios.quirks import QUIRK_NAMES
    from swarm_forage_env.studies.ablation import plan_ablation

    worlds = [described_world(place)[0] for place in described.places()]
    every = {"all": QUIRK_NAMES, "none": ()}
    switched = every[quirks] if quirks in every else split_names(quirks)
    return plan_ablation(worlds, policies, quirks=switched, seeds=range(seeds), caches=described.caches)


def _show_plan(plan: "Ablation", store: "RunStore", seeds: int, jobs: int | None) -> None:
    from swarm_forage_env.cli.report import estimated_seconds, plan_note
    from swarm_forage_env.runs.workers import available_cores

    todo = [spec for spec in plan.specs if spec.run_id not in store]
    processes = jobs or available_cores()
    note = plan_note(todo, estimated_seconds(todo, processes), processes)
    typer.echo(f"At most {note} A quirk that changes nothing needs one run instead of {seeds}.")


def _run(plan: "Ablation", store: "RunStore", jobs: int | None, *, as_json: bool) -> None:
    from swarm_forage_env.cli.ablation_report import ablation_json, ablation_pages
    from swarm_forage_env.cli.errors import resumable
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
