"""The command `saliency`."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions, takes_options
from swarm_forage_env.cli.options import Picture, no_picture
from swarm_forage_env.cli.terminal import notes, output

if TYPE_CHECKING:
    from rich.table import Table

    from swarm_forage_env.inspect.saliency import Saliency


@takes_options
def saliency(
    policies: PolicyOptions,
    described: WorldOptions,
    picture: Picture = None,
    seconds: Annotated[float | None, typer.Option(help="Simulated seconds to look at; default the whole run.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the run.")] = 0,
) -> None:
    """Show what a trained network looks at: how much it acts otherwise when one part of what it sees is exchanged.

    A robot gets, for example, the light readings of another robot. How often does it then decide otherwise? The policy
    is a shipped network, or an .npz file of a training.
    """
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.inspect.saliency import GROUPS, open_network_of
    from swarm_forage_env.inspect.saliency import saliency as measured
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.rendering.plots import draw_saliency

    policy = policies.one()
    network = open_network_of(policy)
    (spec,) = plan_runs(described, (policy,), n_seeds=1, first_seed=seed)
    file = picture or Path("results", f"{spec.scenario.name}_{Path(policy).stem}.saliency.png")
    check_picture(file)
    found = measured(network, spec, seconds=seconds)
    title = f"{Path(policy).stem} in {spec.scenario.name}, {spec.scenario.robots.n_robots} robots, seed {seed}"
    output().print(_table(found, title))
    bars = {group: found.changed[group] for group in GROUPS[1:] if found.n_rows[group]}
    try:
        draw_saliency(file, found.slices, bars, title=title, xlabel=_axis_words(found))
    except ImportError as error:
        notes().print(str(error))
        return
    except OSError as error:  # the table is worth more than its picture
        notes().print(no_picture(file, error))
        return
    typer.echo(f"wrote {file}")


def _words(found: "Saliency") -> str:
    return "share of decisions that change" if found.moved is not None else "mean change of the commands"


def _axis_words(found: "Saliency") -> str:
    """Return what the bars are, in which unit, and what their ends mean."""
    exchanged = "when the slice comes from another observation"
    if found.moved is not None:
        return f"share of decisions that change {exchanged}\n(0: it is not looked at, 1: every decision changes)"
    return f"mean change of the commands {exchanged}\n(0: it is not looked at; commands lie in [-1, 1], so at most 2)"


def _table(found: "Saliency", title: str) -> "Table":
    from rich.table import Table

    from swarm_forage_env.inspect.saliency import GROUPS

    table = Table(title=title, caption=f"{_words(found)} when a slice comes from another observation")
    table.add_column("slice")
    table.add_column("columns", justify="right")
    for group in GROUPS:
        table.add_column(f"{group}\n{found.n_rows[group]:,} seen", justify="right")
    if found.moved is not None:
        table.add_column("probability\nmoved", justify="right")
    table.add_column("what it holds")
    for row in found.ranked:
        numbers = [found.changed[group][row] for group in GROUPS]
        numbers += [] if found.moved is None else [found.moved["all"][row]]
        table.add_row(
            found.slices[row],
            str(found.n_columns[row]),
            *("" if math.isnan(number) else f"{number:.3f}" for number in numbers),
            found.meanings[row],
        )
    return table
