"""From the runs of a table to curves that can be scored."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swarm_forage_env.runs.plan import Condition
from swarm_forage_env.runs.table import Curves, Table
from swarm_forage_env.scenarios.performance import Performance, performance_of
from swarm_forage_env.wrappers.world import World

from ..curves import FloatArray
from ..queues import PopulationRates
from .columns import INTERVAL_COLUMNS
from .performance import checked_performance, own_curve
from .studies import RunCurves, StudyCurves


def run_curves(world: World, curves: Curves, n_planned: int) -> RunCurves:
    """Return the runs in a world as measures take them.

    Args:
        world: Its criterion and value say what the runs are to the measures.
        curves: Seeds and columns, as tables of runs give them.
        n_planned: How many runs were planned.
    """
    seeds, columns = curves
    return RunCurves(
        criterion=world.criterion,
        value=world.value,
        n_robots=world.n_robots,
        seeds=seeds,
        curves={name: curve for name, curve in columns.items() if name in INTERVAL_COLUMNS},
        rates=rates_of(world),
        n_planned=n_planned,
    )


def study_curves(
    experiments: Sequence[RunCurves], world: World, *, controller: str, read_as: Performance | Performance, **told: Any
) -> StudyCurves:
    """Return the runs of a policy in several worlds.

    Args:
        experiments: From `run_curves`.
        world: Any of the worlds: all have its clock.
        controller: Name of the policy.
        read_as: What performance is.
        told: Further fields of `StudyCurves`.
    """
    scenario = world.scenario
    n_intervals = round(scenario.horizon_s / scenario.interval_s)
    return StudyCurves(
        controller=controller,
        experiments=tuple(experiments),
        t_end_s=scenario.interval_s * np.arange(1.0, n_intervals + 1.0),
        amount=read_as.amount,
        is_total=read_as.is_total,
        adds_up=bool(read_as.adds_up),
        **told,
    )


def policy_curves(table: Table, policy: str, performance: Performance | None = None) -> StudyCurves:
    """Return all runs of a policy in a table; worlds without a finished run are there, without runs.

    Args:
        table: The runs.
        policy: Label of the policy.
        performance: A function of records that is the performance; None = what the scenario names.

    Raises:
        CurveError: a performance that is negative or no number.
    """
    conditions = table.plan.of_policy(policy)
    world = conditions[0].world
    read_as = performance or performance_of(world.scenario.performance)
    experiments = [
        run_curves(condition.world, _curves(table, condition, performance), len(table.plan.seeds))
        for condition in conditions
    ]
    return study_curves(experiments, world, controller=policy, read_as=read_as)


def _curves(table: Table, condition: Condition, performance: Performance | None) -> Curves:
    """The runs of a condition, with the performance that is asked for."""
    records = table.of(condition)
    seeds, columns = table.curves(condition, *INTERVAL_COLUMNS)
    checked: list[FloatArray] = []
    for record in records:
        where = f"run {record.run_id}"
        if performance is None:
            name = performance_of(condition.world.scenario.performance).name
            checked.append(checked_performance(record.performance, name, record.n_intervals, where))
        else:
            checked.append(own_curve(performance, record.to_frame(), where))
    if checked:
        columns["performance"] = np.stack(checked)
    return seeds, columns


def rates_of(world: World) -> PopulationRates | None:
    """Return the rates at which the population of a world changes, per second; None where it stays as it is."""
    config = world.population
    if config is None:
        return None
    dt_s = world.scenario.dt_s
    return PopulationRates(
        lambda_d=config.death_per_tick / dt_s,
        lambda_bd=config.malfunction_per_tick / dt_s,
        mu_b=config.birth_per_tick / dt_s,
        mu_bd=config.repair_per_tick / dt_s,
    )
