"""The command `predict`."""

from typing import Annotated

import typer

from swarm_forage_env.cli.option_groups import PlaceOptions, PolicyOptions, RunOptions, refuse_others
from swarm_forage_env.cli.options import OF_RUNS, Curves, Picture

_OF_CURVES = ("curves", "fit", "hold", "performance", "picture", "as_json")
"""Options of `predict` that go with --curves."""


def predict(
    context: typer.Context,
    policies: PolicyOptions,
    described: PlaceOptions,
    options: RunOptions,
    curves: Curves = None,
    fit: Annotated[
        str | None,
        typer.Option(
            help="Swarm sizes that are fitted, four or more; default 1,2,4,8,16,32 (search_and_rescue: "
            "12,51,115,204,320), or those of the file."
        ),
    ] = None,
    hold: Annotated[
        str | None, typer.Option(help="Larger sizes that are run, or in the file, but not fitted: the test.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=2, help="Runs per size.")] = 4,
    picture: Picture = None,
) -> None:
    """Fit performance to small swarms; predict twice and four times the largest, with intervals, and the critical size.

    The critical size is the swarm size of the largest performance. Sizes of --hold are run as well and held against
    the prediction. Runs that the folder holds already are not repeated.
    """
    from metrics.scoring.prediction import Predictions, predict_curves, prediction_question
    from swarm_forage_env.cli.printer import ask_and_show, refusing, show
    from swarm_forage_env.cli.scenario_options import default_folder, described_world, split_numbers

    fitted = None if fit is None else split_numbers("--fit", fit, int)
    held = () if hold is None else split_numbers("--hold", hold, int)
    if curves is not None:
        refuse_others(context, "--curves", _OF_CURVES, OF_RUNS)
        with refusing():
            tables = predict_curves(curves, fit=fitted, hold=held, performance=described.performance)
        show(Predictions(tables=tables), picture, as_json=options.as_json)
        return
    if any(word.partition("=")[0] == "n_robots" for word in described.settings):
        raise typer.BadParameter("Expected no --set n_robots=..., because sizes are varied; use --fit and --hold.")
    world, caches = described_world(described)
    with refusing():
        question = prediction_question(policies.names(), world, fit=fitted, hold=held, seeds=seeds, caches=caches)
    folder = options.out or default_folder(world.scenario.name)
    file = picture or folder / "prediction.png"
    ask_and_show(question, folder, options, picture=file)
