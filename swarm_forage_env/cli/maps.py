"""The command `maps`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import NO_PICTURE
from swarm_forage_env.cli.terminal import notes


def maps(
    page: Annotated[Path, typer.Argument(help="A file that 'swarm-forage replay' has written.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Picture to write; default the page's name and .maps.png.")
    ] = None,
    side: Annotated[float, typer.Option(help="Side of the squares in m.")] = 0.4,
) -> None:
    """Draw where robots were, took and left objects, and got in each other's way, from a replay.

    One row per run of the page; then, for each run after the first, what is more in it than in the first. The arrays
    go to .npz files beside the picture.
    """
    from swarm_forage_env.rendering.plots import draw_maps
    from swarm_forage_env.study.maps import MEANINGS, floor_maps
    from swarm_forage_env.study.replay.files import read_replays
    from swarm_forage_env.study.replay.frames import ReplayError

    try:
        found = [floor_maps(replay, side_m=side) for replay in read_replays(page)]
    except ReplayError as error:
        raise typer.BadParameter(str(error)) from error
    every = [*found, *(one.minus(found[0]) for one in found[1:])]
    picture = out or page.with_suffix(".maps.png")
    picture.parent.mkdir(parents=True, exist_ok=True)
    for one in every:
        one.write(picture.with_suffix(f".{one.label.replace(' ', '_')}.npz"))
    try:
        draw_maps(picture, [(one.label, one.arrays, one.is_difference) for one in every], MEANINGS, every[0].size_m)
    except ImportError:
        notes().print(NO_PICTURE)
    typer.echo(f"wrote maps of {len(found)} run{'s' * (len(found) > 1)} to {picture} and .npz files beside it")
