"""The command `watch`."""

from typing import Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions
from swarm_forage_env.cli.options import Seed


def watch(
    policies: PolicyOptions,
    described: WorldOptions,
    speed: Annotated[float, typer.Option(help="Simulated seconds per second at first; arrow keys change it.")] = 10.0,
    size: Annotated[int, typer.Option(help="Longer side of the arena in pixels.")] = 900,
    theme: Annotated[str, typer.Option(help="dark or light.")] = "dark",
    seed: Seed = 0,
) -> None:
    """Watch a run in a window: pause, choose robots, raise noise, kill.

    The window shows the keys. Needs a display; without one, see record and replay.
    """
    from swarm_forage_env.cli.scenario_options import described_world
    from swarm_forage_env.inspect.watch import watch_run
    from swarm_forage_env.policies.model_files import ModelError
    from swarm_forage_env.policies.network import NetworkError
    from swarm_forage_env.policies.registry import policy_class
    from swarm_forage_env.rendering.view import RenderError

    policy = policies.one()
    world, asked_caches = described_world(described)
    try:
        policy_class(policy)
    except ValueError as error:  # an unknown name is a mistake in the words; a ValueError of the run is not
        raise typer.BadParameter(str(error)) from error
    try:
        watched = watch_run(
            world.scenario,
            policy,
            seed=seed,
            speed=speed,
            size_px=size,
            theme=theme,
            caches=asked_caches,
            wrappers=world.wrappers,
        )
    except (RenderError, ModelError, NetworkError) as error:
        raise typer.BadParameter(str(error)) from error
    typer.echo(watched.summary())
