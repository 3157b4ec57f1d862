"""The commands about runs of policies: `run`, `score`, `check` and `rerun`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.types import PositiveInt

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli import CommandError, NothingAskedError
from swarm_forage_env.cli.options import (
    AsJson,
    CurveOptions,
    Names,
    Policies,
    RunOptions,
    Seed,
    Seeds,
    WorldOptions,
)
from swarm_forage_env.cli.printer import ask_and_show, note, say


def run(
    policies: Policies,
    /,
    *,
    world: WorldOptions = WorldOptions(),
    seeds: Seeds = 1,
    seed: Seed = 0,
    options: RunOptions = RunOptions(),
) -> int:
    """Run policies in a scenario and compare how they perform.

    'swarm-forage run crw dpo --robots 10 --seeds 4' makes four runs of each with ten robots.

    Makes the runs in parallel, shows a table, stores one record per run and draws performance over time. The command
    does not repeat runs that the folder already holds, so after an interruption, just enter it again.
    """
    from metrics.scoring import summarize_runs
    from swarm_forage_env.cli.worlds import described_runs
    from swarm_forage_env.runs.plan import Plan

    chosen, specs = described_runs(world, policies)
    plan = Plan.product(specs, chosen, range(seed, seed + seeds))
    return ask_and_show(plan, summarize_runs, options, chosen, policies, seed=seed)


def score(
    policies: Policies = (),
    /,
    *,
    world: WorldOptions = WorldOptions(),
    options: RunOptions = RunOptions(),
    curves: CurveOptions = CurveOptions(),
    measures: Names = (),
    variant: Names = ("corrected",),
    form: Names = ("marginal",),
    against: str | None = None,
    show_all: Annotated[bool, Parameter(name="--all")] = False,
    budget: str = "standard",
    seeds: Annotated[PositiveInt | None, Parameter(help="Runs per experiment; default the budget's number.")] = None,
    disturbance: str = "throttle",
) -> int:
    """Say which policy is better at what: performance, self-organization, scalability, flexibility, robustness.

    Makes the runs that the measures need, which vary swarm size, throttle, noise and failures, and compares runs with
    the same seed. It does not repeat runs that the folder already holds. The budget sets the length of runs, unless
    --horizon does.

    Args:
        measures: Names of measures, separated by commas; default all.
        variant: Forms of equations: corrected, paper (as printed); separated by commas.
        form: Compare with the next smaller swarm (marginal), with N lone robots (interactive), or both.
        against: Compare all policies with this one alone; default all pairs.
        show_all: Show all levels, numbers and differences.
        budget: quick, standard or paper: sets the length and number of runs, and the levels.
        disturbance: Disturbance for reactivity and adaptability: throttle or handling_cost.
    """
    from metrics.scoring import read_curves, score_question
    from swarm_forage_env.cli.worlds import described_fields, described_runs

    asked: dict[str, Any] = {"budget": budget, "seeds": seeds, "disturbance": disturbance, "horizon_s": world.horizon}
    asked |= {"measures": measures or None, "variants": variant, "forms": form, "against": against}
    file = curves.curves
    if file is not None:
        if not policies and world != WorldOptions():
            raise ConfigError("Expected policies to run in a world beside --curves, got a world alone.")
        told = {"columns": curves.named_columns(), "events": curves.events, "interval_s": curves.interval}
        asked["curves"] = read_curves(file, **told)
        options = replace(options, picture=options.picture or file.with_name(f"{file.stem}_scores.png"))
    elif curves != CurveOptions():
        raise ConfigError("Expected a file with --curves for --columns, --events and --interval, got none.")
    elif not policies:
        raise NothingAskedError("Expected policies, or a file with --curves; 'swarm-forage list' names policies.")
    for word in world.settings:
        if word.partition("=")[0] in ("horizon_s", "interval_s"):
            raise ConfigError(f"Expected no --set {word}, which the budget sets; --horizon changes the length of runs.")
    chosen, specs = described_runs(replace(world, horizon=None), policies)
    density = described_fields(world).fields.get("density")
    question = score_question(specs, chosen, density=density, is_full=show_all, **asked)
    return ask_and_show(*question, options, chosen, policies, ending="_scores.png")


def check(policies: Policies, /, *, world: WorldOptions = WorldOptions()) -> None:
    """Check that policies keep the rules; exit code 1 at the first that breaks one.

    swarm_forage_env.checks.check_policy lists the rules. Wrappers are left out.
    """
    from swarm_forage_env.checks import CHECKED, CheckError, check_policy
    from swarm_forage_env.cli.worlds import plan_runs

    for spec in plan_runs(world, policies, [0]):
        try:
            check_policy(spec.policy, spec.world)
        except CheckError as error:
            raise CommandError(f"{spec.policy} breaks a rule: {error}") from None
        say(f"{spec.policy} keeps the rules in {spec.world.name}. {CHECKED}")


def rerun(file: Path, /, *, as_json: AsJson = False) -> int:
    """Repeat a stored run. Compare a record with the new results, or show the traceback of a failure.

    Args:
        file: A record (.parquet) or a failure (.json).
    """
    import json
    import traceback

    from swarm_forage_env.runs import runner
    from swarm_forage_env.runs.record import RecordError

    try:
        again, is_same = runner.rerun(file)
    except RecordError:
        raise
    except Exception as error:  # of a failure it is the run's own, whatever it is, and what its user wants to see
        if file.suffix != ".json":
            raise
        note(traceback.format_exc().rstrip())
        raise CommandError("the run failed again") from error
    told = {**again.keys, "file": str(file), "is_same": is_same}
    say(json.dumps(told, indent=1) if as_json else f"run {again.describe()}")
    if is_same is False:
        raise CommandError(f"the results differ from those in {file}")
    if is_same and not as_json:
        say(f"bit for bit the same as {file}")
    return 0
