"""The command `compare`."""

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
)


def compare(
    policies: Annotated[
        str,
        typer.Option(
            "--policy", "--policies", help="Two or more, separated by commas: names, or files of trained policies."
        ),
    ],
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
    """Score policies in the same experiments, seed by seed, and say which differences are significant."""
    from swarm_forage_env.cli.scenario_options import ScenarioOptions, default_folder
    from swarm_forage_env.cli.score_options import ScoreOptions, build_plan
    from swarm_forage_env.cli.score_report import run_and_show

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
        policies=policies,
        measures=measures,
        variants=variant,
        forms=form,
        budget=budget,
        seeds=seeds,
        horizon=horizon,
        disturbance=disturbance,
    )
    plan = build_plan(chosen, options, at_least=2)
    folder = out or default_folder(scenario)
    run_and_show(plan, folder, "comparison.png", jobs, as_json=as_json, dry_run=dry_run, band=band)
