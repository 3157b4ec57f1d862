"""The command `score`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import (
    AsJson,
    Band,
    Budget,
    Caches,
    Density,
    Disturbance,
    DryRun,
    Forms,
    Jobs,
    Measures,
    Objects,
    Out,
    Performance,
    Robots,
    Scenario,
    ScoreHorizon,
    ScoreSeeds,
    Settings,
    Side,
    Variants,
    refuse_options_of_runs,
)

_OF_CURVES = ("curves", "measures", "performance", "variant", "form", "band", "as_json")
"""Options of `score` that go with --curves."""


def score(  # long: one parameter per option
    context: typer.Context,
    policy: Annotated[str | None, typer.Option(help="Name, or file of a trained policy.")] = None,
    curves: Annotated[
        Path | None, typer.Option(help="Score curves from a CSV or Parquet file instead (docs/scoring.md).")
    ] = None,
    scenario: Scenario = "warehouse_small",
    measures: Measures = None,
    variant: Variants = "corrected",
    form: Forms = "marginal",
    band: Band = False,
    budget: Budget = "standard",
    seeds: ScoreSeeds = None,
    horizon: ScoreHorizon = None,
    robots: Robots = None,
    objects: Objects = None,
    side: Side = None,
    density: Density = None,
    disturbance: Disturbance = "throttle",
    caches: Caches = None,
    performance: Performance = None,
    settings: Settings = None,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run a policy in all experiments that the measures of swarm engineering need, and score it.

    Swarms of several sizes, throttled, noisy and failing robots; one table with intervals and noise floors. Runs that
    the folder holds already are not repeated.
    """
    from swarm_forage_env.cli.scenario_options import ScenarioOptions, default_folder
    from swarm_forage_env.cli.score_options import ScoreOptions, build_plan, score_forms, tables_of_file
    from swarm_forage_env.cli.score_report import run_and_show, show_scores

    if (policy is None) == (curves is None):
        raise typer.BadParameter("Expected either --policy or --curves.")
    if curves is not None:
        refuse_options_of_runs(context, _OF_CURVES)
        tables = tables_of_file(curves, measures, performance, score_forms(variant, form))
        show_scores(tables, None, as_json=as_json, band=band)
        return
    chosen = ScenarioOptions(
        scenario=scenario,
        robots=robots,
        objects=objects,
        side=side,
        density=density,
        caches=caches,
        performance=performance,
        settings=tuple(settings or ()),
    )
    options = ScoreOptions(
        policies=policy or "",
        measures=measures,
        variants=variant,
        forms=form,
        budget=budget,
        seeds=seeds,
        horizon=horizon,
        disturbance=disturbance,
    )
    folder = out or default_folder(scenario)
    plan = build_plan(chosen, options, at_most=1)
    run_and_show(plan, folder, "scores.png", jobs, as_json=as_json, dry_run=dry_run, band=band)
