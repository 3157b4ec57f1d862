"""What a plan would run: counts, what is stored, and a measured estimate; and stored runs again."""

import json

import numpy as np
import pytest

from swarm_forage_env import Plan, World, policy_specs, rerun, run_plan, scenario, summarize_plan
from swarm_forage_env.runs.plan_summary import PlanSummary
from swarm_forage_env.runs.store import RunStore

WORLDS = [World(scenario("warehouse_small", n_robots=n, horizon_s=20.0, interval_s=10.0)) for n in (2, 3)]


def test_stored_runs_are_counted_and_not_measured(tmp_path):
    part = Plan.product(policy_specs(["random"]), WORLDS[:1], seeds=(0, 1))
    run_plan(part, store=RunStore(tmp_path), jobs=1)
    plan = Plan.product(policy_specs(["random", "crw"]), WORLDS, seeds=(0, 1))
    told: list[str] = []
    summary = summarize_plan(plan, out=tmp_path, jobs=3, tell=told.append)
    assert told == ["measuring random, N = 3", "measuring crw, N = 2", "measuring crw, N = 3"]
    assert (len(summary.stored), len(summary.todo), summary.processes) == (2, 6, 3)
    assert 0.0 < summary.core_hours < 0.01
    lines = str(summary).splitlines()
    assert lines[0] == f"8 runs, 6 to do, records go to {tmp_path}"
    assert [line.split()[-2:] for line in lines[2:4]] == [["4", "2"], ["4", "4"]]
    assert [line.split()[:4] for line in lines[6:9]] == [
        ["random", "none", "4", "2"],
        ["crw", "none", "4", "4"],
        ["all", "none", "8", "6"],
    ]
    assert "on 3 cores as fast as this one is now" in lines[-1]
    answer = json.loads(summary.json())
    assert [run["stored"] for run in answer["runs"]].count(True) == 2
    assert answer["core_hours"] == pytest.approx(summary.core_hours)


def test_arenas_of_several_densities_are_told():
    worlds = [World(scenario("warehouse_small", n_robots=20, density=density)) for density in (0.02, 0.05)]
    plan = Plan.product(policy_specs(["random"]), worlds, seeds=(0,))
    sheet, _ = PlanSummary(
        name="", runs=tuple((one, {}) for one in plan.conditions), stored=frozenset(), costs={}, processes=1
    ).sheets()
    place = sheet.header.index("robots/m2")
    assert [float(row[place]) for row in sheet.rows] == pytest.approx([0.02, 0.05], rel=0.1)


def test_nothing_to_do_needs_no_estimate(tmp_path):
    plan = Plan.product(policy_specs(["random"]), WORLDS[:1], seeds=(0,))
    run_plan(plan, store=RunStore(tmp_path), jobs=1)
    summary = summarize_plan(plan, out=tmp_path)
    assert (summary.todo, summary.wall_s) == ((), 0.0)
    assert "about" not in str(summary)


def test_what_only_this_process_can_build_is_measured_and_what_fails_is_left_out():
    def still(obs):
        return np.zeros((len(obs), 3), dtype=np.float32)

    def refuse(obs):
        raise RuntimeError("I would rather not")

    summary = summarize_plan(Plan.product(policy_specs({"still": still, "no": refuse}), WORLDS[:1], seeds=(0,)))
    hours = {line.split()[0]: line.split()[-1] for line in str(summary).splitlines()[5:8]}
    assert hours == {"still": "<0.01", "no": "-", "all": "<0.01"}
    assert "What has no core-hours is not in the estimate" in str(summary)


def test_a_stored_run_is_made_again(tmp_path):
    store = RunStore(tmp_path)
    table = run_plan(Plan.product(policy_specs(["random"]), WORLDS[:1], seeds=(5,)), store=store, jobs=1)
    (run_id,) = table.records
    again = rerun(store.path(run_id))
    assert (again.is_same, again.record.seed) == (True, 5)
    assert str(again).endswith(f"bit for bit the same as {store.path(run_id)}")
    assert again.to_mapping()["is_same"] is True
