"""The command `play`."""

import webbrowser
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import PolicyOptions, Seed, WorldOptions, complain
from swarm_forage_env.cli.printer import refusing
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from swarm_forage_env.inspect.play.server import PlayServer
    from swarm_forage_env.inspect.play.session import PlaySession


def play(
    policies: PolicyOptions,
    described: WorldOptions,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of the page on this machine; 0 = any that is free.")
    ] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    seed: Seed = 0,
) -> None:
    """Steer a run in the browser: move sliders, draw walls, kill robots.

    The page is on this machine only. It needs no further packages. Ctrl-C ends it.
    """
    from swarm_forage_env.cli.scenario_options import described_world
    from swarm_forage_env.inspect.play.session import PlaySession, Setting

    policy = policies.one("crw")
    world, asked_caches = described_world(described)
    with refusing():
        session = PlaySession(Setting(world=world, policy=policy, seed=seed, caches=asked_caches))
    server = _listening(session, port)
    typer.echo(f"play at {server.address}")
    typer.echo("Ctrl-C ends it.", err=True)
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        complain(f"Interrupted. The page has ended; {session.summary()}.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    finally:
        server.server_close()


def _listening(session: "PlaySession", port: int) -> "PlayServer":
    from swarm_forage_env.inspect.play.server import PlayServer

    try:
        return PlayServer(session, port)
    except OSError as error:
        raise OSError(f"{error.strerror or error}: port {port}; leave out --port to get one that is free.") from error
