"""The command `rerun`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, complain

if TYPE_CHECKING:
    from swarm_forage_env.runs.spec import RunSpec


def rerun(file: Annotated[Path, typer.Argument(help="A record (.parquet) or a failure (.json).")]) -> None:
    """Run a stored run again, here; a record is compared with what comes out, a failure shows its traceback."""
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.policies.registry import load_policy
    from swarm_forage_env.runs.record import RunRecord
    from swarm_forage_env.runs.run import run_policy
    from swarm_forage_env.runs.spec import RunSpec
    from swarm_forage_env.runs.store import read_failure

    if file.suffix == ".json":
        _show_failure_again(read_failure(file).spec)
        return
    stored = RunRecord.read(file)
    spec = RunSpec.from_json(stored.spec)
    try:
        policy = load_policy(spec.policy, spec.parameters)
    except ValueError as error:  # not installed here, or its file has gone or changed
        raise ConfigError(f"Cannot run {file} again: {error}") from error
    again = run_policy(policy, spec)
    typer.echo(again.describe())
    if not again.same_results(stored):
        raise typer.Exit(complain(f"the results differ from those in {file}", EXIT_FAILURE))
    typer.echo(f"bit for bit the same as {file}")


def _show_failure_again(spec: "RunSpec") -> None:
    """Run what has failed; a traceback is what its user wants to see."""
    import traceback

    from swarm_forage_env.policies.trust import UntrustedModelError
    from swarm_forage_env.runs.run import run_one

    try:
        record = run_one(spec)
    except UntrustedModelError:
        raise
    except Exception as error:  # it is the run's own, whatever it is
        typer.echo(traceback.format_exc(), err=True, nl=False)
        raise typer.Exit(complain("the run failed again", EXIT_FAILURE)) from error
    typer.echo(record.describe())
