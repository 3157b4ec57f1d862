"""The command `availability`."""

import json
from typing import Annotated

import typer

from swarm_forage_env.cli.options import AsJson, Picture


def availability(
    robots: Annotated[str, typer.Option("--robots", help="Swarm sizes, separated by commas.")] = "50,200",
    teams: Annotated[str, typer.Option("--teams", help="Mean teams M, robots at work on average.")] = "5,10,20",
    needed: Annotated[str, typer.Option("--needed", help="Numbers of robots needed, for the table.")] = "1,5,10,20,40",
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Show how likely enough robots are at work, over how many are needed. Computed in equilibrium, without runs."""
    from metrics.scoring.theory import availability as computed
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.cli.scenario_options import split_numbers
    from swarm_forage_env.cli.terminal import notes
    from swarm_forage_env.rendering.figures import check_picture

    sizes = split_numbers("--robots", robots, int)
    means = split_numbers("--teams", teams, float)
    demands = split_numbers("--needed", needed, int)
    if picture is not None:
        check_picture(picture)
    try:
        found = computed(sizes, means, demands)
    except ValueError as error:  # a size or a team that cannot be
        raise ConfigError(str(error)) from error
    told = {**found.to_mapping(), "picture": None if picture is None else str(picture)}
    typer.echo(json.dumps(told) if as_json else found.text())
    if picture is not None:
        found.draw(picture)
        notes().print(f"picture {picture}")
