"""Plan and table: which runs there are, and what they were. Every question is a function of a table.

    plan = Plan.product(["crw", "dpo"], "warehouse_small", seeds=(0, 1, 2))
    table = run_plan(plan)
    seeds, curves = table.curves(plan.conditions[0], "performance")     # (R,), name -> (R, T)

A plan is a list of conditions and not only a product: policies may have worlds of their own. Studies, scores, the
benchmark and the evaluations of a training each write a plan.
"""

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product, starmap
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, instance, whole
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import PolicyLike, PolicySpec, RunSpec, policy_specs
from swarm_forage_env.runs.store import RunFailure, failure_lines, is_stored
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

Curves = tuple[tuple[int, ...], dict[str, FloatArray]]
"""Seeds of the R finished runs, and for each column its values in T intervals, (R, T)."""


class Condition(NamedTuple):
    """A policy in a world: what is run once per seed."""

    policy: PolicySpec
    world: World


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Runs that belong together.

    Raises:
        ConfigError: no seeds, equal seeds, or conditions that describe no run.
    """

    conditions: tuple[Condition, ...]
    seeds: tuple[int, ...]
    """All conditions share them, so their runs are paired."""

    def __post_init__(self) -> None:
        if not self.seeds:
            raise ConfigError("Expected a plan with one or more seeds, got none.")
        for condition in self.conditions:
            instance("a condition", condition, Condition, hint="; Plan.product makes them of policies and worlds")
        for seed in self.seeds:
            whole("a seed", seed, at_least=0)
        if len(set(self.seeds)) < len(self.seeds):
            raise ConfigError(f"Expected different seeds, got {', '.join(map(str, self.seeds))}.")
        _ = [self.specs_of(one) for one in self.conditions[:1]], self.robot_ticks  # refuse what runs refuse

    @classmethod
    def product(
        cls,
        policies: Iterable[PolicyLike] | PolicyLike,
        worlds: Iterable[WorldLike] | WorldLike,
        seeds: Iterable[int],
    ) -> "Plan":
        """Return the plan in which every policy runs in every world, policy by policy."""
        instance("seeds", seeds, Iterable, hint="; range(n) has n of them")
        several = [worlds] if isinstance(worlds, str) or not isinstance(worlds, Iterable) else worlds
        specs, found = policy_specs(policies), [world_of(world) for world in several]
        if not specs or not found:
            raise ConfigError("Expected one or more policies and worlds, got none.")
        return cls(conditions=tuple(starmap(Condition, product(specs, found))), seeds=tuple(seeds))

    @property
    def policies(self) -> tuple[PolicySpec, ...]:
        """Each policy once, in the order of the conditions."""
        return tuple({condition.policy.label: condition.policy for condition in self.conditions}.values())

    def of_policy(self, label: str) -> tuple[Condition, ...]:
        """Return the conditions of a policy."""
        return tuple(condition for condition in self.conditions if condition.policy.label == label)

    def specs_of(self, condition: Condition) -> tuple[RunSpec, ...]:
        """Return the runs of a condition, one per seed."""
        first = condition.policy.run_in(condition.world)
        return tuple(replace(first, seed=seed) for seed in self.seeds)

    @property
    def specs(self) -> tuple[RunSpec, ...]:
        """All runs, condition by condition and seed by seed."""
        return tuple(spec for condition in self.conditions for spec in self.specs_of(condition))

    @cached_property
    def robot_ticks(self) -> int:
        """Robots times ticks of all runs."""
        return len(self.seeds) * sum(policy.run_in(world).robot_ticks for policy, world in self.conditions)


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """The runs of a plan."""

    plan: Plan
    records: Mapping[str, Record]
    """run_id -> record, of the runs that finished."""
    failures: Mapping[str, RunFailure] = field(default_factory=dict[str, RunFailure])
    """run_id -> why a run failed."""
    folder: Path | None = None
    """Where the records are, None where they are not stored."""

    def of(self, condition: Condition) -> tuple[Record, ...]:
        """Return the records of a condition, in the order of the seeds; runs that failed are left out.

        They are read with the performance of its world: worlds that differ in that alone share their runs.
        """
        ids = (spec.run_id for spec in self.plan.specs_of(condition))
        performance = condition.world.scenario.performance
        return tuple(self.records[run_id].read_as(performance) for run_id in ids if run_id in self.records)

    def failure_lines(self, policy: str) -> tuple[str, ...]:
        """Return why runs of a policy failed, see `store.failure_lines`."""
        ids = (spec.run_id for condition in self.plan.of_policy(policy) for spec in self.plan.specs_of(condition))
        return failure_lines(self.failures[run_id] for run_id in ids if run_id in self.failures)

    def curves(self, condition: Condition, *columns: str) -> Curves:
        """Return the finished runs of a condition as arrays.

        Args:
            condition: One of the plan.
            columns: Columns of records; those that its runs do not have are left out. Default all.
        """
        records = self.of(condition)
        if not records:
            return (), {}
        names = [name for name in columns or records[0].columns if all(name in record.columns for record in records)]
        return (
            tuple(record.seed for record in records),
            {name: np.stack([record[name] for record in records]).astype(np.float64) for name in names},
        )


def run_plan(
    plan: Plan,
    *,
    out: str | Path | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: bool = False,
) -> Table:
    """Make the runs of a plan and return them as a table; arguments and errors are those of `run_all`.

    Policies that only this process can build run here, after all others.

    Raises:
        ValueError: a folder, and a policy without a name by which its runs are found again.
    """
    instance("plan", plan, Plan, hint="; Plan.product(policies, worlds, seeds) makes one")
    unnamed = [policy.label for policy in plan.policies if not policy.is_named]
    if out is not None and unnamed:
        raise ValueError(
            f"Expected a name for the policy {unnamed[0]}, by which its runs in {out} are found again; give a mapping "
            "{name: policy}."
        )
    made_here = {policy.policy: policy.factory for policy in plan.policies if policy.factory is not None}
    found = run_all(plan.specs, out=out, executor=executor, jobs=jobs, progress=progress, made_here=made_here)
    folder = None if out is None else Path(out)
    return Table(plan=plan, records=found.records, failures=found.failures, folder=folder)


def finished_runs(plan: Plan, *, out: str | Path | None = None, jobs: int | None = 1, progress: bool = False) -> Table:
    """Make all runs of a plan; arguments as in `run_plan`. Raises ConfigError where a run failed."""
    table = run_plan(plan, out=out, jobs=jobs, progress=progress)
    for first in table.failures.values():
        raise ConfigError(
            f"Expected all {len(plan.specs)} runs to finish, {len(table.failures)} failed; the first, "
            f"{first.spec.describe()}: {first.error}"
        )
    return table


def planned_line(specs: Iterable[RunSpec], out: str | Path) -> str:
    """Say in one line which runs there would be."""
    planned = {spec.run_id: spec for spec in specs}
    todo = [spec for spec in planned.values() if not is_stored(Path(out), spec)]
    robot_ticks = sum(spec.robot_ticks for spec in todo)
    return (
        f"{counted(len(planned), 'run')}, {len(planned) - len(todo):,} stored, {len(todo):,} to do with "
        f"{robot_ticks:.3g} robot-ticks; records go to {out}"
    )
