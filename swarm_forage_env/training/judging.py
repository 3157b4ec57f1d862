"""How policies do in the evaluations of a training: functions of the table of their runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_spec
from swarm_forage_env.runs.runner import run_plan
from swarm_forage_env.runs.table import Table
from swarm_forage_env.training.evaluation_worlds import BEST, CHOSEN_BY, EvaluationWorld
from swarm_forage_env.training.plan import EvaluationPlan, TrainingPlan
from swarm_forage_env.training.status import Evaluation, WorldEvaluation
from swarm_forage_env.wrappers.world import World

Baselines: TypeAlias = Mapping[str, tuple[str, float]]
"""Name of a world -> the policy to compare with, and its performance per 1,000 s."""


def finished_runs(plan: Plan, *, jobs: int | None = 1, progress: bool = False) -> Table:
    """Make the runs of a plan, all of them; arguments as in `runs.runner.run_plan`.

    Raises:
        ConfigError: a run failed.
    """
    table = run_plan(plan, jobs=jobs, progress=progress)
    for failure in table.failures.values():
        raise ConfigError(
            f"Expected all runs of evaluations to finish, got {failure.error} in {failure.spec.describe()}."
        )
    return table


def baseline_runs(plan: TrainingPlan) -> Plan:
    """Return the runs of all policies that may be the baseline of a world.

    In the plan's scenario it has the caches of the scenario; those of other worlds have their own.
    """
    return Plan(
        conditions=tuple(condition for world in plan.judging_worlds for condition in _baselines_of(world, plan)),
        seeds=plan.evaluation.seeds,
    )


def _baselines_of(world: World, plan: TrainingPlan) -> list[Condition]:
    from metrics.controllers import (
        PAPER_POLICIES,  # late: a user's own metrics.py must not keep a training from running
    )

    if not isinstance(world, EvaluationWorld):
        return [Condition(replace(_called(plan.evaluation.baseline), caches=None), world)]
    names = PAPER_POLICIES if world.baseline == BEST else (world.baseline,)
    return [Condition(_called(name), world) for name in names]


def _called(name: str) -> PolicySpec:
    return policy_spec(name, label=name)


def best_baselines(table: Table) -> dict[str, tuple[str, float]]:
    """Return the policy that did best in each world, as `Baselines`."""
    found: dict[str, tuple[str, float]] = {}
    for condition in table.plan.conditions:
        world = condition.world.name
        performance, _ = means(table, condition)
        if world not in found or performance > found[world][1]:
            found[world] = condition.policy.label, performance
    return found


def known_baselines(plan: TrainingPlan, evaluation: Evaluation) -> dict[str, tuple[str, float]]:
    """Return the baselines of an evaluation, as `Baselines`."""
    if not evaluation.worlds:
        return {plan.judging_worlds[0].name: (plan.evaluation.baseline, evaluation.baseline)}
    return {world.world: (world.baseline_policy, world.baseline) for world in evaluation.worlds}


def means(table: Table, condition: Condition) -> tuple[float, float]:
    """Return performance per 1,000 s and interference of a policy in a world, means over its runs."""
    records = table.of(condition)
    performance = np.mean([record.rate_per_1000_s("performance") for record in records])
    return float(performance), float(np.mean([record.interference_fraction.mean() for record in records]))


def judged(table: Table, policy: str, baselines: Baselines) -> tuple[WorldEvaluation, ...]:
    """Return how a policy did in each world.

    Args:
        table: The runs.
        policy: Its label in them.
        baselines: What it is compared with.
    """
    found: list[WorldEvaluation] = []
    for condition in table.plan.of_policy(policy):
        performance, interference = means(table, condition)
        name, reached = baselines[condition.world.name]
        found.append(
            WorldEvaluation(
                world=condition.world.name,
                performance=performance,
                baseline=reached,
                ratio=ratio_to(reached, performance, condition.world.scenario.horizon_s * len(table.plan.seeds)),
                interference_fraction=interference,
                baseline_policy=name,
            )
        )
    return tuple(found)


def in_all_worlds(plan: EvaluationPlan, found: Sequence[WorldEvaluation]) -> tuple[float, float]:
    """Return what counts of how a policy did, and its mean interference.

    That is performance per 1,000 s; in several worlds the mean or the worst of their ratios to the baselines.
    """
    performance = CHOSEN_BY[plan.chosen_by]([world.ratio for world in found]) if plan.worlds else found[0].performance
    return float(performance), float(np.mean([world.interference_fraction for world in found]))


def ratio_to(baseline: float, performance: float, seconds: float) -> float:
    """Return the ratio of a performance to that of the baseline, both per 1,000 s.

    A baseline that brings nothing home counts as if it had brought one object in all runs together (our choice: there
    is a ratio then, and finding what it does not find is still worth a lot).

    Args:
        baseline: Of the baseline.
        performance: Of the policy.
        seconds: Simulated seconds of all runs of one of them.
    """
    return performance / max(baseline, 1000.0 / seconds)
