"""The commands `list`, `info` and `schema`."""

from typing import Annotated

import typer


def list_everything() -> None:
    """List scenarios and policies."""
    from swarm_forage_env.inspect.descriptions import overview

    typer.echo(overview().text())


def info(name: Annotated[str, typer.Argument(help="A scenario, an environment id, a policy or its file.")]) -> None:
    """Show all fields and spaces of a scenario, or what a policy is."""
    from swarm_forage_env._internal.printable import printable
    from swarm_forage_env.inspect.descriptions import describe

    typer.echo(printable(describe(name).text()))  # a file may hold anything


def schema() -> None:
    """Show the columns of run records: name, type, unit, meaning."""
    from swarm_forage_env.runs.record import schema_table

    typer.echo(schema_table())
