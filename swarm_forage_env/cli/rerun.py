"""The command `rerun`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, complain


def rerun(
    file: Annotated[Path, typer.Argument(help="A record (.parquet) or a failure (.json).")], as_json: AsJson = False
) -> None:
    """Run a stored run again, here; a record is compared with what comes out, a failure shows its traceback."""
    import traceback

    from swarm_forage_env.policies.trust import UntrustedModelError
    from swarm_forage_env.runs import rerun as again
    from swarm_forage_env.runs.record import RecordError

    try:
        answer = again.rerun(file)
    except (UntrustedModelError, RecordError):
        raise
    except Exception as error:  # of a failure it is the run's own, whatever it is, and what its user wants to see
        if file.suffix != ".json":
            raise
        typer.echo(traceback.format_exc(), err=True, nl=False)
        raise typer.Exit(complain("the run failed again", EXIT_FAILURE)) from error
    typer.echo(answer.json() if as_json else answer.record.describe())
    if answer.is_same is False:
        raise typer.Exit(complain(f"the results differ from those in {file}", EXIT_FAILURE))
    if answer.is_same and not as_json:
        typer.echo(f"bit for bit the same as {file}")
