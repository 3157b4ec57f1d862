"""The command `predict`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import AsJson, DryRun, Jobs, Out, refuse_options_of_runs
from swarm_forage_env.cli.world_options import World, takes_world

_OF_CURVES = ("curves", "fit", "hold", "performance", "out", "as_json")
"""Options of `predict` that go with --curves."""


@takes_world("scenario", "objects", "caches", "performance", "settings")
def predict(
    context: typer.Context,
    described: World,
    policy: Annotated[
        str | None, typer.Option(help="One or more, separated by commas: names, or files of trained policies.")
    ] = None,
    curves: Annotated[
        Path | None, typer.Option(help="Predict from curves in a CSV or Parquet file instead (docs/deciding.md).")
    ] = None,
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
    horizon: Annotated[float | None, typer.Option(help="Seconds per run, whole intervals of 200 s.")] = None,
    out: Out = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Fit performance to small swarms; predict twice and four times the largest, with intervals, and the critical size.

    The critical size is the swarm size of the largest performance. Sizes of --hold are run as well and held against
    the prediction. Runs that the folder holds already are not repeated.
    """
    from swarm_forage_env.cli.decision_report import predict_file, predict_runs
    from swarm_forage_env.cli.scenario_options import default_folder, split_numbers

    if (policy is None) == (curves is None):
        raise typer.BadParameter("Expected either --policy or --curves.")
    fitted = None if fit is None else split_numbers("--fit", fit, int)
    held = () if hold is None else split_numbers("--hold", hold, int)
    if curves is not None:
        refuse_options_of_runs(context, _OF_CURVES)
        predict_file(curves, fitted, held, described.performance, out, as_json=as_json)
        return
    folder = out or default_folder(described.scenario)
    world = replace(described, horizon=horizon)
    predict_runs(world, policy or "", fitted, held, seeds, folder, jobs, as_json=as_json, dry_run=dry_run)
