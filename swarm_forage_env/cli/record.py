"""The command `record`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.terminal import progress_bar
from swarm_forage_env.cli.world_options import World, takes_world


@takes_world()
def record(
    described: World,
    out: Annotated[
        Path | None, typer.Option(help="File to write, .gif or .mp4; default results/SCENARIO_POLICY.gif.")
    ] = None,
    policy: Annotated[str, typer.Option("--policy", "--controller", help="Name, or file of a trained policy.")] = "crw",
    seconds: Annotated[float, typer.Option(help="Simulated seconds to film.")] = 300.0,
    speedup: Annotated[float, typer.Option(help="Simulated seconds per second of film.")] = 20.0,
    fps: Annotated[float, typer.Option(help="Pictures per second.")] = 20.0,
    size: Annotated[int, typer.Option(help="Longer side of the arena in pixels.")] = 900,
    theme: Annotated[str, typer.Option(help="dark or light.")] = "dark",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the run.")] = 0,
) -> None:
    """Film a run."""
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env.cli.scenario_options import described_world
    from swarm_forage_env.policies.model_files import ModelError
    from swarm_forage_env.policies.network import NetworkError
    from swarm_forage_env.policies.registry import policy_label
    from swarm_forage_env.rendering.view import RenderError
    from swarm_forage_env.study.film import record_run

    world, asked_caches, disturbances = described_world(described)
    _refuse_unknown(policy)
    film = out or Path("results", f"{described.scenario}_{as_file_name(policy_label(policy))}.gif")
    try:
        with progress_bar("pictures") as progress:
            written = record_run(
                world,
                policy,
                film,
                seconds=seconds,
                seed=seed,
                speedup=speedup,
                fps=fps,
                size_px=size,
                theme=theme,
                caches=asked_caches,
                wrappers=disturbances,
                progress=progress,
            )
    except (RenderError, ModelError, NetworkError) as error:
        raise typer.BadParameter(str(error)) from error
    typer.echo(f"wrote {written}")


def _refuse_unknown(policy: str) -> None:
    from swarm_forage_env.policies.registry import policy_class

    try:
        policy_class(policy)
    except ValueError as error:  # an unknown name is a mistake in the words; a ValueError of the run is not
        raise typer.BadParameter(str(error)) from error
