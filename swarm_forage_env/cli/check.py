"""The commands `check` and `rerun`: do policies keep the rules, and is a stored run still the same?"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env._internal.wording import printable
from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, FirstSeed, Jobs, PolicyOptions, WorldOptions, complain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swarm_forage_env.runs.spec import RunSpec


def check(
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Runs per policy.")] = 1,
    first_seed: FirstSeed = 0,
    window: Annotated[
        float, typer.Option("--window", help="Simulated seconds in which every robot should move away.")
    ] = 600.0,
    moved: Annotated[float, typer.Option("--moved", help="How far it should move, in m.")] = 0.05,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Check that policies keep the rules, and find stuck robots; exit code 1 if something is wrong.

    swarm_forage_env.checks.check_policy lists the rules. A stuck robot is active and has hardly moved for minutes,
    although no rule makes it wait.
    """
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.inspect.stuck import find_stuck_in

    specs = plan_runs(described, policies.names("crw"), n_seeds=seeds, first_seed=first_seed)
    _check_rules(specs)
    found = find_stuck_in(specs, window_s=window, moved_m=moved, jobs=jobs)
    typer.echo(found.json() if as_json else printable(found.text()))
    if found.found:
        raise typer.Exit(EXIT_FAILURE)


def _check_rules(specs: "Sequence[RunSpec]") -> None:
    """Check each policy once, in its world without wrappers; the first fault ends the command."""
    from swarm_forage_env.checks import CheckError, check_policy

    for spec in {spec.policy: spec for spec in specs}.values():
        try:
            check_policy(spec.policy, spec.scenario, seed=spec.seed)
        except CheckError as error:
            raise typer.Exit(complain(f"{spec.policy} breaks a rule: {error}", EXIT_FAILURE)) from None


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
