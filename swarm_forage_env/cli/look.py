"""The commands that show what is there, or one run: `list`, `info`, `record`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from swarm_forage_env._internal.wording import printable
from swarm_forage_env.cli.options import AsJson, PolicyOptions, Seed, WorldOptions
from swarm_forage_env.cli.printer import progress_bar, width_of_terminal


def list_everything(
    what: Annotated[
        str | None, typer.Argument(help="What to list: scenarios, policies, wrappers or columns (of records).")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List scenarios and policies, wrappers, or the columns of run records."""
    from swarm_forage_env.inspect.descriptions import overview

    listed = overview(what)
    typer.echo(listed.json() if as_json else listed.text(width=width_of_terminal()))


def info(
    name: Annotated[str, typer.Argument(help="A scenario, an environment id, a policy or its file.")],
    as_json: AsJson = False,
) -> None:
    """Describe a scenario, with all its fields and spaces, or a policy."""
    from swarm_forage_env.inspect.descriptions import describe

    found = describe(name)
    text = found.json() if as_json else found.text(width=width_of_terminal())
    typer.echo(printable(text))  # a file may hold anything


def record(
    policies: PolicyOptions,
    described: WorldOptions,
    file: Annotated[
        Path | None,
        typer.Option(
            "--file", help="File to write: .gif or .mp4, or .png with --at; default results/SCENARIO_POLICY.gif."
        ),
    ] = None,
    at: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Draw one picture at this simulated time, in place of a film."),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Simulated seconds to film.")] = 300.0,
    speedup: Annotated[float, typer.Option(help="Simulated seconds per second of film.")] = 20.0,
    fps: Annotated[float, typer.Option(help="Pictures per second.")] = 20.0,
    size: Annotated[int, typer.Option(help="Longer side of the arena in pixels.")] = 900,
    theme: Annotated[str, typer.Option(help="dark or light.")] = "dark",
    seed: Seed = 0,
) -> None:
    """Film a run, or draw it at one time.

    'swarm-forage record dpo --at 300 --file dpo.png' draws the run after 300 s.
    """
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env.cli.scenario_options import described_world
    from swarm_forage_env.inspect.film import picture_run, record_run
    from swarm_forage_env.policies.model_files import ModelError
    from swarm_forage_env.policies.network import NetworkError
    from swarm_forage_env.policies.registry import policy_label
    from swarm_forage_env.rendering.view import RenderError

    policy = policies.one("crw")
    world, asked_caches = described_world(described)
    _refuse_unknown(policy)
    ending = "gif" if at is None else "png"
    path = file or Path("results", f"{world.file_name}_{as_file_name(policy_label(policy))}.{ending}")
    look: dict[str, Any] = {"seed": seed, "size_px": size, "theme": theme, "caches": asked_caches}
    look["wrappers"] = world.wrappers
    try:
        if at is not None:
            written = picture_run(world.scenario, policy, path, at_s=at, **look)
        else:
            with progress_bar("pictures") as progress:
                film: dict[str, Any] = {"seconds": seconds, "speedup": speedup, "fps": fps, "progress": progress}
                written = record_run(world.scenario, policy, path, **film, **look)
    except (RenderError, ModelError, NetworkError) as error:
        raise typer.BadParameter(str(error)) from error
    typer.echo(f"wrote {written}")


def _refuse_unknown(policy: str) -> None:
    from swarm_forage_env.policies.registry import policy_class

    try:
        policy_class(policy)
    except ValueError as error:  # an unknown name is a mistake in the words; a ValueError of the run is not
        raise typer.BadParameter(str(error)) from error
