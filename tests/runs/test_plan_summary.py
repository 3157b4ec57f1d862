"""What a plan would run: counts, and what is stored; and stored runs again."""

import json

from swarm_forage_env import Plan, World, policy_specs, rerun, run_plan, scenario, summarize_plan
from swarm_forage_env.runs.store import RunStore

WORLDS = [World(scenario("warehouse_small", n_robots=n, horizon_s=20.0, interval_s=10.0)) for n in (2, 3)]


def test_stored_runs_are_counted(tmp_path):
    part = Plan.product(policy_specs(["random"]), WORLDS[:1], seeds=(0, 1))
    run_plan(part, store=RunStore(tmp_path), jobs=1)
    plan = Plan.product(policy_specs(["random", "crw"]), WORLDS, seeds=(0, 1))
    summary = summarize_plan(plan, out=tmp_path, name="mine")
    assert (len(summary.stored), len(summary.todo)) == (2, 6)
    robot_ticks = (2 * 2 + 4 * 3) * 100
    assert (
        str(summary) == f"mine: 8 runs, 2 stored, 6 to do with {robot_ticks:.3g} robot-ticks; records go to {tmp_path}"
    )
    assert [run["stored"] for run in json.loads(summary.json())["runs"]].count(True) == 2
    assert str(summarize_plan(part, out=tmp_path)).startswith("2 runs, 2 stored, 0 to do with 0 robot-ticks;")
    assert str(summarize_plan(part)).startswith("2 runs, 0 stored, 2 to do with 400 robot-ticks")


def test_a_stored_run_is_made_again(tmp_path):
    store = RunStore(tmp_path)
    table = run_plan(Plan.product(policy_specs(["random"]), WORLDS[:1], seeds=(5,)), store=store, jobs=1)
    (run_id,) = table.records
    again = rerun(store.path(run_id))
    assert (again.is_same, again.record.seed) == (True, 5)
    assert str(again).endswith(f"bit for bit the same as {store.path(run_id)}")
    assert again.to_mapping()["is_same"] is True
