"""The command `availability`."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarm_forage_env.cli.options import AsJson, Picture

if TYPE_CHECKING:
    from rich.table import Table


def availability(
    robots: Annotated[str, typer.Option("--robots", help="Swarm sizes, separated by commas.")] = "50,200",
    teams: Annotated[str, typer.Option("--teams", help="Mean teams M, robots at work on average.")] = "5,10,20",
    needed: Annotated[str, typer.Option("--needed", help="Numbers of robots needed, for the table.")] = "1,5,10,20,40",
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Show how likely enough robots are at work, over how many are needed. Computed in equilibrium, without runs."""
    from metrics import availability_curves
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.cli.scenario_options import split_numbers
    from swarm_forage_env.cli.terminal import notes, output
    from swarm_forage_env.cli.theory import availability_figure
    from swarm_forage_env.rendering.figures import SCREEN, check_picture

    sizes = split_numbers("--robots", robots, int)
    means = split_numbers("--teams", teams, float)
    demands = split_numbers("--needed", needed, int)
    if picture is not None:
        check_picture(picture)
    try:
        rows = [
            {"robots": n, "team": team, "at_work": _mean_at_work(n, team), "needed": demands, "availability": curve}
            for n in sizes
            for team, curve in zip(means, availability_curves(n, means, demands).tolist(), strict=True)
        ]
        figure = None if picture is None else availability_figure(sizes, means)
    except ValueError as error:  # a size or a team that cannot be
        raise ConfigError(str(error)) from error
    if as_json:
        typer.echo(json.dumps({"curves": rows, "picture": None if picture is None else str(picture)}))
    else:
        output().print(_table(rows, demands))
    if picture is not None and figure is not None:
        figure.draw([picture], SCREEN)
        notes().print(f"picture {picture}")


def _mean_at_work(n: int, team: float) -> float:
    """Mean number at work of a swarm of n robots, which cannot have more than n there."""
    from metrics import PopulationRates, queue_statistics, ratio_for_team

    away = queue_statistics(PopulationRates(lambda_bd=ratio_for_team(team), mu_bd=1.0), n).truncated_length
    assert away is not None, "it is there whenever a size is given"
    return n - away


def _table(rows: Sequence[dict[str, Any]], demands: Sequence[int]) -> "Table":
    from rich.table import Table

    title = "probability that at least so many robots are at work"
    table = Table("robots", "mean team", "mean at work", *map(str, demands), title=title)
    for column in table.columns:
        column.justify = "right"
    for row in rows:
        values = (f"{value:.3f}" for value in row["availability"])
        table.add_row(str(row["robots"]), f"{row['team']:g}", f"{row['at_work']:.1f}", *values)
    return table
