"""The command `maps`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import Jobs, Picture, PolicyOptions, WorldOptions
from swarm_forage_env.cli.printer import notes, progress_bar


def maps(
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Runs per policy.")] = 1,
    square: Annotated[float, typer.Option("--square", help="Side of the squares in m.")] = 0.4,
    jobs: Jobs = None,
    picture: Picture = None,
) -> None:
    """Draw where robots were, where they took and left objects, and where they got in each other's way.

    The picture has one row per policy. Further rows show the difference of each from the first. The arrays go to .npz
    files beside the picture.
    """
    from swarm_forage_env.cli.scenario_options import described_world, plan_runs
    from swarm_forage_env.inspect.maps import maps_of_runs
    from swarm_forage_env.rendering.figures import check_picture

    specs = plan_runs(described, policies.names(), n_seeds=seeds, first_seed=0)
    file = picture or Path("results", "maps", described_world(described)[0].file_name, "maps.png")
    check_picture(file)
    with progress_bar("runs", sum(spec.robot_ticks for spec in specs)) as advance:
        found = maps_of_runs(specs, side_m=square, jobs=jobs, advance=advance)
    try:
        found.write(file)
    except ImportError as error:
        notes().print(str(error))
    typer.echo(f"wrote maps to {file} and .npz files beside it")
