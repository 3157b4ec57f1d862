"""The command `maps`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from swarm_forage_env.cli.options import Picture
from swarm_forage_env.cli.terminal import notes

if TYPE_CHECKING:
    from swarm_forage_env.inspect.maps import FloorMaps


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
    from swarm_forage_env.inspect.maps import floor_maps
    from swarm_forage_env.inspect.replay.files import read_replays
    from swarm_forage_env.inspect.replay.frames import ReplayError
    from swarm_forage_env.rendering.figures import check_picture

    if page.suffix == ".parquet":
        raise typer.BadParameter(
            f"Expected a page that 'swarm-forage replay' has written, got {page}; records of runs hold no positions. "
            f"'swarm-forage replay {page}' makes the page of a run, and 'swarm-forage study maps' the maps of a study."
        )
    try:
        found = [floor_maps(replay, side_m=square) for replay in read_replays(page)]
    except ReplayError as error:
        raise typer.BadParameter(str(error)) from error
    file = picture or page.with_suffix(".maps.png")
    check_picture(file)
    write_maps(with_differences(found), file, own_scales=own_scales)
    typer.echo(f"wrote maps of {counted(len(found), 'run')} to {file} and .npz files beside it")


def with_differences(found: "Sequence[FloorMaps]") -> "list[FloorMaps]":
    """Return maps, and for each after the first what is more in it than in the first."""
    return [*found, *(one.minus(found[0]) for one in found[1:])]


def write_maps(every: "Sequence[FloorMaps]", picture: Path, *, per: str = "", own_scales: bool = False) -> None:
    """Write a picture of maps, and their arrays to files beside it; without matplotlib, say so.

    Args:
        every: Maps and differences.
        picture: File to write.
        per: What everything is divided by, for the units.
        own_scales: See `rendering.plots.draw_maps`.
    """
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env.inspect.maps import MEANINGS
    from swarm_forage_env.rendering.plots import draw_maps

    for one in every:
        one.write(picture.with_suffix(f".{as_file_name(one.label)}.npz"))
    columns = {name: (what, f"{unit}, per {per}" if per else unit) for name, (what, unit) in MEANINGS.items()}
    rows = [(one.label, one.arrays, one.is_difference, one.size_m, one.obstacles_m) for one in every]
    try:
        draw_maps(picture, rows, columns, own_scales=own_scales)
    except ImportError as error:
        notes().print(str(error))
