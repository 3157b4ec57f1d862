"""The table of a plan's runs: records, curves and failures, condition by condition."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env.runs.plan import Condition, Plan, Table, run_plan
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import PolicySpec, policy_spec
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.world import World

QUIET = World(scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0))
NOISY = replace(QUIET, wrappers=(SensorNoiseConfig(sigma=0.02),), criterion="noise", value=0.02, name="")
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
