"""The commands `score` and `compare`; what they do is in `cli.score_report` and `metrics.scoring`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import (
    EXIT_FAILURE,
    EXIT_INTERRUPTED,
    NO_PICTURE,
    AsJson,
    Budget,
    Caches,
    DryRun,
    Jobs,
    Measures,
    Objects,
    Out,
    Robots,
    Scenario,
    ScoreHorizon,
    ScoreSeeds,
    Settings,
    Side,
    complain,
)

_OF_CURVES = ("curves", "measures", "as_json")
"""Options of `score` that go with --curves."""

if TYPE_CHECKING:
    from metrics.score_table import ScoreTable
    from metrics.scoring import ScoringPlan


def score(
    context: typer.Context,
    policy: Annotated[str | None, typer.Option(help="Name, or file of a trained policy.")] = None,
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
    from swarm_forage_env.cli.scenario_options import ScenarioOptions, default_folder
    from swarm_forage_env.cli.score_report import ScoreOptions, build_plan, tables_of_file

    if (policy is None) == (curves is None):
        raise typer.BadParameter("Expected either --policy or --curves.")
    if curves is not None:
        _refuse_options_of_runs(context)
        _show_scores(tables_of_file(curves, measures), None, as_json=as_json)
        return
    world = ScenarioOptions(
        scenario=scenario, robots=robots, objects=objects, side=side, caches=caches, settings=tuple(settings or ())
    )
    options = ScoreOptions(policies=policy or "", measures=measures, budget=budget, seeds=seeds, horizon=horizon)
    folder = out or default_folder(scenario)
    _score(build_plan(world, options, at_most=1), folder, "scores.png", jobs, as_json=as_json, dry_run=dry_run)


def _refuse_options_of_runs(context: typer.Context) -> None:
    """Refuse what curves that exist already would silently ignore."""
    sources = {option: context.get_parameter_source(str(option.name)) for option in context.command.params}
    given = [
        option.opts[0]
        for option, source in sources.items()
        if source is not None and source.name == "COMMANDLINE" and option.name not in _OF_CURVES
    ]
    if given:
        raise typer.BadParameter(
            f"Expected --curves with no other options than --measures and --json, got {', '.join(given)}, which are "
            "about runs."
        )


def compare(
    policies: Annotated[
        str,
        typer.Option(
            "--policy", "--policies", help="Two or more, separated by commas: names, or files of trained ones."
        ),
    ],
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
    from swarm_forage_env.cli.scenario_options import ScenarioOptions, default_folder
    from swarm_forage_env.cli.score_report import ScoreOptions, build_plan

    world = ScenarioOptions(
        scenario=scenario, robots=robots, objects=objects, side=side, caches=caches, settings=tuple(settings or ())
    )
    options = ScoreOptions(policies=policies, measures=measures, budget=budget, seeds=seeds, horizon=horizon)
    plan = build_plan(world, options, at_least=2)
    _score(plan, out or default_folder(scenario), "comparison.png", jobs, as_json=as_json, dry_run=dry_run)


def _score(plan: "ScoringPlan", folder: Path, picture: str, jobs: int | None, *, as_json: bool, dry_run: bool) -> None:
    from metrics.scoring import run_scores
    from swarm_forage_env.cli.score_report import plan_json, plan_text
    from swarm_forage_env.study.runner import StudyInterrupted, available_cores
    from swarm_forage_env.study.store import RunStore

    if dry_run:
        show = plan_json if as_json else plan_text
        typer.echo(show(plan, RunStore(folder), jobs or available_cores()))
        return
    try:
        tables = run_scores(plan, out=folder, jobs=jobs, progress=True)
    except StudyInterrupted as interrupt:
        complain(f"{interrupt} They are in {folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    _show_scores(tables, folder / picture, as_json=as_json)
    if any(table.failures for table in tables):
        raise typer.Exit(EXIT_FAILURE)


def _show_scores(tables: "tuple[ScoreTable, ...]", picture: Path | None, *, as_json: bool) -> None:
    from swarm_forage_env.cli.score_report import compared, draw, json_text

    comparison = compared(tables)
    drawn = None
    if picture is not None:
        try:
            drawn = draw(tables, picture)
        except ImportError:
            typer.echo(NO_PICTURE, err=True)
    if as_json:
        typer.echo(json_text(tables, comparison, drawn))
    else:
        typer.echo(str(tables[0] if comparison is None else comparison))
    if drawn is not None:
        typer.echo(f"picture {drawn}", err=True)
