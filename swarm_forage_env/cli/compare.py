"""The command `compare`."""

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
)
from swarm_forage_env.cli.world_options import SCORED, World, takes_world


@takes_world(*SCORED)
def compare(
    described: World,
    policies: Annotated[
        str,
        typer.Option(
            "--policy", "--policies", help="Two or more, separated by commas: names, or files of trained policies."
        ),
    ],
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
    """Score policies in the same experiments, seed by seed, and say which differences are significant."""
    from swarm_forage_env.cli.scenario_options import default_folder
    from swarm_forage_env.cli.score_options import ScoreOptions, build_question
    from swarm_forage_env.cli.score_report import run_and_show

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
    question = build_question(described, options, at_least=2)
    folder = out or default_folder(described.scenario)
    run_and_show(question, folder, "comparison.png", jobs, as_json=as_json, dry_run=dry_run, band=band)
