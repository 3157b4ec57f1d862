"""The command `stuck`."""

from typing import Annotated

import typer

from swarm_forage_env._internal.printable import printable
from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions, takes_options
from swarm_forage_env.cli.options import EXIT_FAILURE


@takes_options
def stuck(
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[int, typer.Option(min=1, help="Runs per policy.")] = 1,
    first_seed: Annotated[int, typer.Option(min=0, help="Seed of the first of them.")] = 0,
    window: Annotated[float, typer.Option(help="Seconds in which every robot should get away.")] = 600.0,
    moved: Annotated[float, typer.Option(help="How far that is, in m.")] = 0.05,
) -> None:
    """Find robots that get stuck: active, hardly moved for minutes, not waiting by rule. Exits with 1 if any are."""
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.inspect.stuck import find_stuck_in

    specs = plan_runs(described, policies.names("crw"), n_seeds=seeds, first_seed=first_seed)
    found = find_stuck_in(specs, window_s=window, moved_m=moved)
    typer.echo(printable(found.text()))
    if found.found:
        raise typer.Exit(EXIT_FAILURE)
