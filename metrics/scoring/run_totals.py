"""Performance of each run, summed over time: what predictions and choices are made of."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicyLike, policy_specs
from swarm_forage_env.runs.table import Table
from swarm_forage_env.wrappers.world import World

from ..checks import CurveError, chosen_seeds


class ReadAs(Protocol):
    """What the numbers of a performance are, as a scenario's performance and `StudyCurves` tell it."""

    @property
    def amount(self) -> str:
        """What there is so and so much of."""
        ...

    @property
    def is_total(self) -> bool:
        """Whether a number is a total over its interval."""
        ...


def plan_totals(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    worlds: Sequence[World],
    *,
    seeds: int | Sequence[int],
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> Plan:
    """Return the plan that runs every policy once per world and seed.

    Args:
        policies: As in `compare_policies`.
        worlds: Where they run.
        seeds: How many, at least two, or which.
        parameters: Keyword arguments of a registered policy or a class.
        caches: "none", "static", "dynamic"; default see `swarm_forage_env.runs.spec.chosen_caches`.

    Raises:
        CurveError: fewer than two seeds.
        ValueError: an unknown policy, or policies of equal names.
    """
    chosen = chosen_seeds(seeds, 0)
    if len(chosen) < 2:
        raise CurveError("Expected two or more seeds, got 1; a single run does not show its scatter.")
    return Plan.product(policy_specs(policies, parameters=parameters, caches=caches), worlds, chosen)


def run_totals(table: Table, condition: Condition) -> dict[int, float]:
    """Return seed -> performance summed over the run, of the finished runs of a condition."""
    return {record.seed: float(record.performance.sum()) for record in table.of(condition)}


def unit_text(read_as: ReadAs, horizon_s: float | None = None) -> str:
    """Return the unit of performance summed over a run, of that length where it is told."""
    if not read_as.is_total:
        return f"{read_as.amount} summed over intervals"
    return read_as.amount if horizon_s is None else f"{read_as.amount} in {horizon_s:,g} s"
