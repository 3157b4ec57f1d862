"""The commands `check` and `rerun`: do policies keep the rules, and is a stored run still the same?"""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env._internal.wording import printable
from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, PolicyOptions, Seed, WorldOptions, complain


def check(policies: PolicyOptions, described: WorldOptions, seed: Seed = 0) -> None:
    """Check that policies keep the rules; exit code 1 at the first that breaks one.

    swarm_forage_env.checks.check_policy lists the rules.
    """
    from swarm_forage_env.checks import CheckError, check_policy
    from swarm_forage_env.cli.scenario_options import plan_runs

    for spec in plan_runs(described, policies.names("crw"), n_seeds=1, first_seed=seed):
        try:
            check_policy(spec.policy, spec.scenario, seed=spec.seed)
        except CheckError as error:
            raise typer.Exit(complain(f"{spec.policy} breaks a rule: {error}", EXIT_FAILURE)) from None
        typer.echo(f"{printable(spec.policy)} keeps the rules")


def rerun(
    file: Annotated[Path, typer.Argument(help="A record (.parquet) or a failure (.json).")], as_json: AsJson = False
) -> None:
    """Repeat a stored run. Compare a record with the new results, or show the traceback of a failure."""
    import traceback

    from swarm_forage_env.policies.trust import UntrustedModelError
    from swarm_forage_env.runs import runner as again
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
