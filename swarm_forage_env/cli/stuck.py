"""The command `stuck`."""

from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions, takes_options
from swarm_forage_env.cli.options import EXIT_FAILURE

if TYPE_CHECKING:
    from rich.table import Table

    from swarm_forage_env.inspect.stuck import StuckRobot
    from swarm_forage_env.runs.spec import RunSpec


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
    from rich.console import Console

    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.inspect.stuck import find_stuck

    if not (window > 0.0 and moved > 0.0):
        raise ConfigError(f"Expected --window and --moved above 0, got {window:g} and {moved:g}.")
    specs = plan_runs(described, policies.names("crw"), n_seeds=seeds, first_seed=first_seed)
    found = [(spec, one) for spec in specs for one in find_stuck(spec, window_s=window, moved_m=moved)]
    if not found:
        typer.echo(f"nobody is stuck in {counted(len(specs), 'run')}")
        return
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = 200
    console.print(_table(found))
    raise typer.Exit(EXIT_FAILURE)


def _table(found: "list[tuple[RunSpec, StuckRobot]]") -> "Table":
    from rich.table import Table

    table = Table("policy", "seed", "robot", "from s", "to s", "place m", "wheels m/s", "near m", "what it does")
    for spec, one in found:
        x, y = one.place_m
        left, right = one.wheels_mps
        signs = [sign for sign, is_so in (("carrying", one.carrying), ("obstacle", one.interfering)) if is_so]
        table.add_row(
            spec.policy,
            str(spec.seed),
            str(one.robot),
            f"{one.from_s:g}",
            f"{one.to_s:g}",
            f"{x:.2f}, {y:.2f}",
            f"{left:.2f}, {right:.2f}",
            f"{one.neighbour_m:.2f}",
            "; ".join(filter(None, [*signs, one.task, one.state])),
        )
    return table
