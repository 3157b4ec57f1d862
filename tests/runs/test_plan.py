"""Plans: which runs there are, in which order, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.plan import Condition, Plan, Table, run_plan
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import PolicySpec, plan_run, policy_spec
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.world import World

CRW, STOCHM = policy_spec("crw", parameters={"wander_speed_mps": 0.05}), policy_spec("stochm", label="tasks")
QUIET = World(scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0))
NOISY = replace(QUIET, wrappers=(SensorNoiseConfig(sigma=0.02),), criterion="noise", value=0.02, name="")


def test_every_policy_runs_in_every_world_once_per_seed():
    plan = Plan.product([CRW, STOCHM], [QUIET, NOISY], seeds=[3, 5])
    assert plan.conditions == tuple(Condition(policy, world) for policy in (CRW, STOCHM) for world in (QUIET, NOISY))
    assert plan.policies == (CRW, STOCHM)
    assert plan.of_policy("tasks") == plan.conditions[2:]
    told = [(spec.policy, spec.world.value, spec.seed) for spec in plan.specs]
    assert told == [(policy, value, seed) for policy in ("crw", "stochm") for value in (0.0, 0.02) for seed in (3, 5)]
    assert len({spec.run_id for spec in plan.specs}) == 8
    assert plan.specs[2:4] == plan.specs_of(plan.conditions[1])
    assert plan.robot_ticks == sum(spec.robot_ticks for spec in plan.specs) == 8 * 3 * 20


def test_its_runs_are_those_that_are_planned_one_by_one():
    """Whoever made a run before finds it again."""
    plan = Plan.product([STOCHM], [NOISY], seeds=(0, 1))
    assert plan.specs == tuple(plan_run(NOISY, "stochm", seed=seed) for seed in (0, 1))


@pytest.mark.parametrize(
    ("conditions", "seeds", "message"),
    [
        ((), (), "one or more seeds"),
        ((Condition(CRW, QUIET),), (1, 1), "Expected different seeds, got 1, 1"),
        ((Condition(CRW, QUIET),), (-1,), "a seed to be a whole number >= 0, got -1"),
    ],
)
def test_impossible_plans_are_refused(conditions, seeds, message):
    with pytest.raises(ConfigError, match=message):
        Plan(conditions=conditions, seeds=seeds)


@pytest.mark.parametrize(("policies", "worlds"), [([], [QUIET]), ([CRW], [])])
def test_a_product_without_factors_is_refused(policies, worlds):
    with pytest.raises(ConfigError, match="one or more policies and worlds"):
        Plan.product(policies, worlds, seeds=(0,))


def test_a_condition_that_describes_no_run_is_refused_at_once():
    world = World(scenario("warehouse_small", horizon_s=300.0))
    with pytest.raises(ConfigError, match="whole number of intervals of 200 s, got 300 s"):
        Plan.product([CRW], [QUIET, world], seeds=(0,))


RANDOM = policy_spec("random")
NOBODY = PolicySpec(label="nobody", policy="nobody")
PLAN = Plan.product([RANDOM, NOBODY], [QUIET, NOISY], seeds=(1, 0))
FIRST, SECOND = PLAN.of_policy("random")


@pytest.fixture(scope="module")
def table():
    return run_plan(PLAN, jobs=1)


def test_each_condition_has_its_records_in_the_order_of_the_seeds(table):
    for condition in (FIRST, SECOND):
        for record, spec in zip(table.of(condition), PLAN.specs_of(condition), strict=True):
            assert record.equals(run_one(spec))
    assert table.folder is None


def test_runs_that_failed_are_told_by_condition(table):
    assert table.failure_lines("random") == ()
    assert len(table.failure_lines("nobody")) == 1
    lost = PLAN.of_policy("nobody")[1]
    assert len(table.failures) == 4
    assert table.of(lost) == ()
    assert table.curves(lost) == ((), {})


def test_curves_are_the_columns_of_its_runs(table):
    seeds, curves = table.curves(SECOND, "collected", "interference_fraction", "no_such_column")
    assert seeds == (1, 0)
    assert list(curves) == ["collected", "interference_fraction"]
    for name, values in curves.items():
        assert (values.shape, values.dtype) == ((2, 2), np.float64)
        np.testing.assert_array_equal(values, [record[name] for record in table.of(SECOND)])
    everything = table.curves(SECOND)[1]
    assert {"performance", "n_active", "believed_interference_fraction"} <= everything.keys()
    assert "believed_interference_fraction" not in table.curves(FIRST)[1], "only noisy runs have that column"


def test_a_column_that_only_some_runs_have_is_left_out(table):
    """Records of different versions may differ in what wrappers told them."""
    one, other = table.of(SECOND)
    bare = replace(other, columns={name: other[name] for name in INTERVAL_COLUMNS})
    mixed = Table(plan=PLAN, records={one.run_id: one, other.run_id: bare})
    seeds, curves = mixed.curves(SECOND, "believed_interference_fraction", "n_active")
    assert (seeds, list(curves)) == ((1, 0), ["n_active"])


def test_worlds_that_differ_in_performance_alone_share_runs_and_read_them_their_own_way(table):
    at_work = World(replace(QUIET.scenario, performance="n_active"))
    plan = Plan(conditions=(Condition(RANDOM, at_work), FIRST), seeds=PLAN.seeds)
    both = Table(plan=plan, records=table.records)
    assert both.curves(plan.conditions[0], "performance")[1]["performance"].tolist() == [[3.0, 3.0]] * 2
    collected = both.curves(FIRST, "performance", "collected")[1]
    np.testing.assert_array_equal(collected["performance"], collected["collected"])
    assert all(a is b for a, b in zip(both.of(FIRST), table.of(FIRST), strict=True))
