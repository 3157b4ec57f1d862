"""Performance of each run, summed over time: what predictions and choices are made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from metrics.checks import CurveError, chosen_seeds

from .contestants import PolicyLike, contestants_of
from .plan import ScoringPlan
from .runs import run_plan

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from swarm_forage_env.scenarios.config import ScenarioConfig
    from swarm_forage_env.studies.ladders import Experiment


class ReadAs(Protocol):
    """What the numbers of a performance are, as `ScoringPlan.read_as` and `StudyCurves` tell it."""

    @property
    def amount(self) -> str:
        """What there is so and so much of."""
        ...

    @property
    def is_total(self) -> bool:
        """Whether a number is a total over its interval."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyTotals:
    """The finished runs of one policy."""

    policy: str
    totals: tuple[Mapping[int, float], ...]
    """For each experiment of the plan: seed -> performance summed over the run."""
    failures: tuple[str, ...]
    """Runs that failed, one line each."""


def plan_conditions(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    scenario: "ScenarioConfig",
    experiments: "Sequence[Experiment]",
    *,
    seeds: int | Sequence[int],
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> ScoringPlan:
    """Return the plan that runs every policy once per experiment and seed.

    Args:
        policies: As in `compare_policies`.
        scenario: What the experiments are variants of; its horizon and interval are theirs.
        experiments: What is run.
        seeds: How many, at least two, or which.
        parameters: Keyword arguments of a registered policy or a class.
        caches: "none", "static", "dynamic"; default see `swarm_forage_env.runs.spec.chosen_caches`.

    Raises:
        CurveError: fewer than two seeds.
        ValueError: an unknown policy, or policies of equal names.
    """
    from swarm_forage_env.studies.ladders import Budget

    chosen = chosen_seeds(seeds, 0)
    if len(chosen) < 2:
        raise CurveError("Expected two or more seeds, got 1; a single run does not show its scatter.")
    return ScoringPlan(
        contestants=contestants_of(policies, parameters or {}, scenario, caches),
        experiments=tuple(experiments),
        seeds=chosen,
        measures=("raw_performance",),
        scenario=scenario,
        budget=Budget(
            horizon_s=scenario.horizon_s,
            interval_s=scenario.interval_s,
            n_seeds=len(chosen),
            n_sizes=None,
            n_levels=None,
        ),
        budget_name="",
    )


def unit_text(read_as: ReadAs, horizon_s: float | None = None) -> str:
    """Return the unit of performance summed over a run, of that length where it is told."""
    if not read_as.is_total:
        return f"{read_as.amount} summed over intervals"
    return read_as.amount if horizon_s is None else f"{read_as.amount} in {horizon_s:,g} s"


def run_totals(
    plan: ScoringPlan,
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> tuple[PolicyTotals, ...]:
    """Run a plan and return the total performance of its runs; arguments and errors as in `score_policy`."""
    results = run_plan(plan, out=out, jobs=jobs, executor=executor, progress=progress)
    records = {record.run_id: record for result in results for record in result.records}
    failures = {failure.run_id: failure for result in results for failure in result.failures}
    found: list[PolicyTotals] = []
    for contestant in plan.contestants:
        specs = plan.specs_of(contestant)
        totals: tuple[dict[int, float], ...] = tuple({} for _ in plan.experiments)
        for spec, of_seeds in zip(specs, cycle(totals), strict=False):  # seed by seed, experiments in their order
            if spec.run_id in records:
                of_seeds[spec.seed] = float(records[spec.run_id].performance.sum())
        failed = [failures[spec.run_id] for spec in specs if spec.run_id in failures]
        found.append(
            PolicyTotals(
                policy=contestant.label,
                totals=totals,
                failures=tuple(f"{failure.spec.describe()}: {failure.error}" for failure in failed),
            )
        )
    return tuple(found)
