"""The command `score`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import (
    AsJson,
    Band,
    Budget,
    Disturbance,
    DryRun,
    Forms,
    Jobs,
    Measures,
    Out,
    ScoreHorizon,
    ScoreSeeds,
    Variants,
    refuse_options_of_runs,
)
from swarm_forage_env.cli.world_options import SCORED, World, takes_world

_OF_CURVES = ("curves", "measures", "performance", "variant", "form", "band", "as_json")
"""Options of `score` that go with --curves."""


@takes_world(*SCORED)
def score(
    context: typer.Context,
    described: World,
    policy: Annotated[str | None, typer.Option(help="Name, or file of a trained policy.")] = None,
    curves: Annotated[
        Path | None, typer.Option(help="Score curves from a CSV or Parquet file instead (docs/scoring.md).")
    ] = None,
    measures: Measures = None,
    variant: Variants = "corrected",
    form: Forms = "marginal",
    band: Band = False,
    budget: Budget = "standard",
    seeds: ScoreSeeds = None,
    horizon: ScoreHorizon = None,
    disturbance: Disturbance = "throttle",
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run a policy in all experiments that the measures of swarm engineering need, and score it.

    Swarms of several sizes, throttled, noisy and failing robots; one table with intervals and noise floors. Runs that
    the folder holds already are not repeated.
    """
    from swarm_forage_env.cli.scenario_options import default_folder
    from swarm_forage_env.cli.score_options import ScoreOptions, build_question, score_forms, tables_of_file
    from swarm_forage_env.cli.score_report import run_and_show, show_scores

    if (policy is None) == (curves is None):
        raise typer.BadParameter("Expected either --policy or --curves.")
    if curves is not None:
        refuse_options_of_runs(context, _OF_CURVES)
        tables = tables_of_file(curves, measures, described.performance, score_forms(variant, form))
        show_scores(tables, None, as_json=as_json, band=band)
        return
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
    folder = out or default_folder(described.scenario)
    question = build_question(described, options, at_most=1)
    run_and_show(question, folder, "scores.png", jobs, as_json=as_json, dry_run=dry_run, band=band)
