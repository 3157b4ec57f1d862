"""The commands `list` and `info`."""

from typing import Annotated

import typer

from swarm_forage_env.cli.options import AsJson


def list_everything(
    what: Annotated[str | None, typer.Argument(help="scenarios, policies, wrappers or columns (of records).")] = None,
    as_json: AsJson = False,
) -> None:
    """List scenarios and policies, wrappers, or the columns of run records."""
    from swarm_forage_env.inspect.descriptions import overview

    listed = overview(what)
    typer.echo(listed.json() if as_json else listed.text())


def info(
    name: Annotated[str, typer.Argument(help="A scenario, an environment id, a policy or its file.")],
    as_json: AsJson = False,
) -> None:
    """Show all fields and spaces of a scenario, or what a policy is."""
    from swarm_forage_env._internal.wording import printable
    from swarm_forage_env.inspect.descriptions import describe

    found = describe(name)
    typer.echo(printable(found.json() if as_json else found.text()))  # a file may hold anything
