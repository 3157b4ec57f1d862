"""The command `maps`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions, refuse_others
from swarm_forage_env.cli.options import Picture
from swarm_forage_env.cli.terminal import notes, progress_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swarm_forage_env.inspect.maps import ComparedMaps
    from swarm_forage_env.runs.spec import RunSpec

_OF_ALL = ("policies", "named_policies", "square", "per_robot", "own_scales", "picture")
"""Options that go with a page, too."""


OwnScales: TypeAlias = Annotated[
    bool, typer.Option("--own-scales", help="A scale of its own for each map; default one per column, to compare rows.")
]


def maps(
    context: typer.Context,
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Runs per policy.")] = 1,
    square: Annotated[float, typer.Option("--square", help="Side of the squares in m.")] = 0.4,
    per_robot: Annotated[
        bool, typer.Option("--per-robot", help="Divide by the swarm size, to compare swarms of several sizes.")
    ] = False,
    own_scales: OwnScales = False,
    picture: Picture = None,
) -> None:
    """Draw where robots were, took and left objects, and got in each other's way.

    Runs of policies are made for it. In their place you can name a page that 'swarm-forage replay' has written. One
    row per policy or run of the page; then, for each after the first, what is more in it than in the first. The arrays
    go to .npz files beside the picture.
    """
    from swarm_forage_env.inspect.maps import maps_of_page
    from swarm_forage_env.rendering.figures import check_picture

    words = policies.names()
    if Path(words[0]).suffix in (".html", ".parquet"):
        refuse_others(context, "a page", _OF_ALL, "which describe runs; leave them out, or name a policy")
        page = Path(policies.one())
        file = picture or page.with_suffix(".maps.png")
        found = maps_of_page(page, side_m=square)
        check_picture(file)
    else:
        specs = _planned(words, described, seeds)
        file = picture or Path("results", "maps", specs[0].scenario.name, "maps.png")
        check_picture(file)
        found = _made(specs, square)
    write_maps(found.per_robot() if per_robot else found, file, own_scales=own_scales)
    typer.echo(f"wrote maps to {file} and .npz files beside it")


def write_maps(found: "ComparedMaps", picture: Path, *, own_scales: bool) -> None:
    """Write arrays and picture; without matplotlib, say so."""
    try:
        found.write(picture, own_scales=own_scales)
    except ImportError as error:
        notes().print(str(error))


def _planned(words: "Sequence[str]", described: WorldOptions, seeds: int) -> "Sequence[RunSpec]":
    from swarm_forage_env.cli.scenario_options import plan_runs

    return plan_runs(described, words, n_seeds=seeds, first_seed=0)


def _made(specs: "Sequence[RunSpec]", square: float) -> "ComparedMaps":
    """Make the runs, and show how far they are."""
    from swarm_forage_env.inspect.maps import maps_of_runs

    with progress_bar("runs", sum(spec.robot_ticks for spec in specs)) as advance:
        return maps_of_runs(specs, side_m=square, advance=advance)
