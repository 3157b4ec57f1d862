"""The command `study maps`: where robots of a study's conditions were, and what they did there."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.maps import OwnScales, write_maps

PICTURE_FILE = "maps.png"


def maps(
    place: Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")],
    places: Annotated[
        list[str] | None,
        typer.Option(
            "--condition",
            metavar="KEY=VALUE,...",
            help="Only conditions with these values, e.g. policy=dpo,population_size=16; may be repeated.",
        ),
    ] = None,
    seeds: Annotated[int | None, typer.Option("--seeds", min=1, help="Runs per condition; default at most 4.")] = None,
    side: Annotated[float, typer.Option("--side", help="Side of the squares in m, in the smallest arena.")] = 0.4,
    per_robot: Annotated[
        bool, typer.Option("--per-robot", help="Divide by the swarm size, to compare swarms of several sizes.")
    ] = False,
    own_scales: OwnScales = False,
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/maps/NAME.")] = None,
) -> None:
    """Draw where robots of some conditions were, took and left objects, and got in each other's way.

    One row per condition; then, for each after the first, what is more in it than in the first. The arrays go to .npz
    files beside the picture. Stored runs hold no positions, so they are made again.
    """
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.cli.terminal import notes, progress_bar
    from swarm_forage_env.inspect.maps import ComparedMaps
    from swarm_forage_env.inspect.study_maps import choose_places, maps_of_places, robot_ticks
    from swarm_forage_env.studies.study_table import read_study

    table = read_study(place)
    chosen = choose_places(table.spec, places or ())
    picture = (out or Path("results", "maps", table.spec.name)) / PICTURE_FILE
    check_file(picture)
    with progress_bar("making the runs again", robot_ticks(table.spec, chosen, seeds)) as advance:
        found, changed = maps_of_places(table, chosen, n_seeds=seeds, side_m=side, advance=advance)
    compared = ComparedMaps(maps=tuple(found))
    if changed:
        notes().print(
            f"Runs that come out different from their records, which other versions made: {', '.join(changed)}; "
            "the maps show them as they are now."
        )
    write_maps(compared.per_robot() if per_robot else compared, picture, own_scales=own_scales)
    typer.echo(f"wrote maps of {counted(len(found), 'condition')} to {picture} and .npz files beside it")
