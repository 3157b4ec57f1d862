"""Scores of any performance: recorded, computed, or a function; stored runs are read again, never repeated."""

import dataclasses

import numpy as np
import pytest

from metrics import CurveError, Performance, score, score_curves
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import runner
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.performance import DERIVED_PERFORMANCES, PERFORMANCE_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.ladders import Budget
from tests.support.curve_tables import rows, table

WORLD = scenario("warehouse_small", n_robots=4, n_objects=20)
TINY = Budget(horizon_s=4.0, interval_s=2.0, n_seeds=2, n_sizes=2, n_levels=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Stored runs of two sizes and two seeds of a policy with tasks, scored by deliveries."""
    place = tmp_path_factory.mktemp("runs")
    scored(out=place)
    return place


def scored(policy="stochm", world=WORLD, **options):
    """Score in this process, quietly, in the tiny budget."""
    return score(
        policy, world, **{"budget": TINY, "jobs": 1, "progress": False, "measures": ["raw_performance"], **options}
    )


def values(found) -> dict[tuple[int, int], float]:
    """(Robots, seed) -> raw performance."""
    return {(n, seed): value for n, seed, value in found.frame.select("n_robots", "seed", "value").iter_rows()}


@pytest.fixture
def no_runs(monkeypatch):
    monkeypatch.setattr(runner, "run_one", lambda spec: pytest.fail("a stored run was repeated"))


@pytest.mark.parametrize("name", [*PERFORMANCE_COLUMNS, *DERIVED_PERFORMANCES, "1/interference_fraction"])
def test_every_column_of_stored_runs_can_be_scored(name, folder, no_runs):
    found = scored(out=folder, performance=name)
    assert len(values(found)) == 4
    assert all(np.isfinite(value) and value >= 0.0 for value in values(found).values())
    assert found.settings["performance"] == name
    if name in PERFORMANCE_COLUMNS:
        for record in load(folder):
            expected = record.columns.get(name, np.full(2, float(name == "task_share_none"))).sum()
            assert values(found)[record.spec.world.n_robots, record.seed] == pytest.approx(expected)


def test_scenario_and_argument_mean_the_same(folder, no_runs):
    by_scenario = scored(world=dataclasses.replace(WORLD, performance="n_active"), out=folder)
    assert str(by_scenario) == str(scored(performance="n_active", out=folder))
    assert values(by_scenario) == {(1, 0): 2.0, (1, 1): 2.0, (4, 0): 8.0, (4, 1): 8.0}
    assert str(by_scenario).startswith("stochm in warehouse_small with 20 objects, performance n_active, budget custom")


def test_units_follow(folder, no_runs):
    def units(**options):
        measures = ["raw_performance", "efficiency"]
        return (
            scored(out=folder, measures=measures, **options)
            .summary.group_by("measure", maintain_order=True)
            .first()["unit"]
            .to_list()
        )

    assert units() == ["objects in 4 s", "objects per robot in 4 s"]
    assert units(performance="deaths") == ["robots in 4 s", "robots per robot in 4 s"]
    assert units(performance="n_active") == ["robots summed over intervals", "robots per robot summed over intervals"]
    assert units(performance="task_balance")[0] == "task_balance summed over intervals"
    own = Performance(function=lambda record: record["n_active"], name="crowd", unit="heads", is_total=True)
    assert units(performance=own)[0] == "heads in 4 s"


def test_shares_are_noted_where_growth_in_proportion_is_the_scale(folder, no_runs):
    """Two swarms in full balance are no worse than one; a swarm of four is not expected to have four times of it."""
    measures = ["raw_performance", "efficiency", "t_lost_fraction", "task_emergence", "scalability"]

    def noted(performance):
        found = scored(out=folder, measures=measures, performance=performance)
        return {row["measure"] for row in found.summary.iter_rows(named=True) if "no sum over robots" in row["remark"]}

    assert noted("task_balance") == noted("1/n_active") == {"efficiency", "task_emergence", "scalability"}
    assert noted("n_active") == noted("collected") == noted(lambda record: record["n_active"]) == set()
    share = Performance(function=lambda record: record["interference_fraction"], name="lost", adds_up=False)
    assert noted(share) == {"efficiency", "task_emergence", "scalability"}


def test_a_function_of_the_record_is_a_performance(folder, no_runs):
    def at_work(record):
        assert record.height == 2
        return 2.0 * record["n_active"]

    found = scored(out=folder, performance=at_work)
    assert values(found) == {(1, 0): 4.0, (1, 1): 4.0, (4, 0): 16.0, (4, 1): 16.0}
    assert found.settings["performance"] == "at_work"
    assert found.frame["unit"][0] == "at_work summed over intervals"


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda record: record["n_active"] - 2.0, r"performance mine of run \w+ as finite numbers >= 0, got -1\.0 in"),
        (lambda record: record["n_active"] * np.nan, "got nan in interval 0"),
        (lambda record: [1.0, np.inf], "got inf in interval 1; let 1/0 be 0"),
        (lambda record: 3.0, r"one number per interval, shape \(2,\), got shape \(\)"),
        (lambda record: record["controller"], "as numbers, got"),
    ],
    ids=["negative", "nan", "inf", "one number", "text"],
)
def test_values_that_are_no_performance_are_told(function, message, folder):
    with pytest.raises(CurveError, match=message):
        scored(out=folder, performance=Performance(function=function, name="mine"))


def test_unknown_performances_are_refused_before_anything_runs(no_runs):
    with pytest.raises(ConfigError, match=r"got 'n_carying'\. Did you mean 'n_carrying'\?"):
        scored(performance="n_carying")
    with pytest.raises(CurveError, match="name of a recorded column, or a function of a record, got 3"):
        scored(performance=3)


def test_units_of_known_columns_of_a_file_follow(tmp_path):
    frame = table(*(rows(n, [[9.0]], n_active=float(n), interference_fraction=0.5) for n in (1, 2)))
    frame.write_csv(tmp_path / "c.csv")

    def told(performance):
        found = score_curves(tmp_path / "c.csv", measures=["task_emergence"], performance=performance)
        assert found.settings["performance"] == performance
        return found.frame["unit"][0], "no sum over robots" in found.frame["remark"][0]

    assert told("n_active") == ("robots summed over intervals", False)
    assert told("interference_fraction") == ("interference_fraction summed over intervals", True)
    assert told("1/n_active") == ("1/n_active summed over intervals", True)
