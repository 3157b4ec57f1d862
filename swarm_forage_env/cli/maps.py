"""The command `maps`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from swarm_forage_env.cli.options import Picture
from swarm_forage_env.cli.terminal import notes

if TYPE_CHECKING:
    from swarm_forage_env.inspect.maps import ComparedMaps


OwnScales: TypeAlias = Annotated[
    bool, typer.Option("--own-scales", help="A scale of its own for each map; default one per column, to compare rows.")
]


def maps(
    page: Annotated[Path, typer.Argument(help="A file that 'swarm-forage replay' has written.")],
    picture: Picture = None,
    square: Annotated[float, typer.Option("--square", help="Side of the squares in m.")] = 0.4,
    own_scales: OwnScales = False,
) -> None:
    """Draw where robots were, took and left objects, and got in each other's way, from a replay.

    One row per run of the page; then, for each run after the first, what is more in it than in the first. The arrays
    go to .npz files beside the picture.
    """
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.inspect.maps import maps_of_page
    from swarm_forage_env.rendering.figures import check_picture

    found = maps_of_page(page, side_m=square)
    file = picture or page.with_suffix(".maps.png")
    check_picture(file)
    write_maps(found, file, own_scales=own_scales)
    typer.echo(f"wrote maps of {counted(len(found.maps), 'run')} to {file} and .npz files beside it")


def write_maps(found: "ComparedMaps", picture: Path, *, own_scales: bool) -> None:
    """Write arrays and picture; without matplotlib, say so."""
    try:
        found.write(picture, own_scales=own_scales)
    except ImportError as error:
        notes().print(str(error))
