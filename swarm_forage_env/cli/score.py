"""The commands `score` and `compare`, which are one: scores of several policies are compared."""

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, RunOptions, WorldOptions, refuse_others
from swarm_forage_env.cli.options import (
    OF_RUNS,
    Band,
    Budget,
    Curves,
    Disturbance,
    Forms,
    Measures,
    Picture,
    ScoreSeeds,
    Variants,
)

_OF_CURVES = ("curves", "measures", "performance", "variant", "form", "band", "picture", "as_json")
"""Options that go with --curves."""


def score(
    context: typer.Context,
    policies: PolicyOptions,
    described: WorldOptions,
    options: RunOptions,
    curves: Curves = None,
    measures: Measures = None,
    variant: Variants = "corrected",
    form: Forms = "marginal",
    band: Band = False,
    budget: Budget = "standard",
    seeds: ScoreSeeds = None,
    disturbance: Disturbance = "throttle",
    picture: Picture = None,
) -> None:
    """Run policies in all experiments that the measures of swarm engineering need, score and compare them.

    Swarms of several sizes, throttled, noisy and failing robots; one table with intervals and noise floors. Several
    policies are compared seed by seed, with the differences that are significant. Runs that the folder holds already
    are not repeated. The budget says how long runs are, unless --horizon does.
    """
    from metrics.scoring.policy_scores import score_curves
    from metrics.scoring.score_tables import side_by_side
    from swarm_forage_env.cli.printer import ask_and_show, refusing, show
    from swarm_forage_env.cli.scenario_options import default_folder, split_names
    from swarm_forage_env.cli.score_options import asked_scores, score_forms

    forms = score_forms(variant, form, band=band)
    wanted = None if measures is None else split_names(measures)
    if curves is not None:
        refuse_others(context, "--curves", _OF_CURVES, OF_RUNS)
        with refusing():
            tables = score_curves(curves, measures=wanted, performance=described.performance, forms=forms)
        show(side_by_side(tables), picture, as_json=options.as_json)
        return
    question = asked_scores(
        policies.names(),
        described,
        measures=wanted,
        budget=budget,
        seeds=seeds,
        disturbance=disturbance,
        forms=forms,
    )
    folder = options.out or default_folder(question.world.scenario.name)
    file = picture or folder / ("scores.png" if len(question.plan.policies) == 1 else "comparison.png")
    ask_and_show(question, folder, options, picture=file)
