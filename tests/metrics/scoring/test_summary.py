"""What runs were: rows by condition, in every form."""

import json

import pytest

from metrics import summarize_runs
from metrics.scoring.plots import interval_words
from swarm_forage_env import Plan, World, parse_wrapper, policy_specs, run_plan, scenario
from tests.support.pictures import keep_figures

WORLD = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=20.0, interval_s=10.0)


def test_conditions_in_several_worlds_have_a_row_each(tmp_path, monkeypatch):
    noisy = World(WORLD, (parse_wrapper("sensor_noise:sigma=0.03"),))
    plan = Plan.product(policy_specs(["random", "crw"]), [World(WORLD), noisy], seeds=(0, 1))
    summary = summarize_runs(run_plan(plan, jobs=1))
    assert [(row["controller"], row["world"]) for row in summary.rows] == [
        (policy.label, world.name) for policy, world in plan.conditions
    ]
    lines = str(summary).splitlines()
    assert lines[0] == "warehouse_small and others: 2 worlds"
    assert "warehouse_small, 3 robots, 20 objects, sensor noise: sigma 0.03 (all sensors)" in lines[3]
    assert summary.csv().splitlines()[0].startswith("policy,world,caches,runs,")
    answer = json.loads(summary.json())
    assert [len(answer[name]) for name in ("controllers", "runs", "failures")] == [4, 8, 0]
    assert (answer["out"], answer["runs"][0]["file"]) == (None, None)
    figures = keep_figures(monkeypatch)
    summary.draw(tmp_path / "runs.png")
    assert len(figures[0].axes[0].get_lines()) == 4


def test_failed_runs_are_in_the_answer_and_leave_nothing_to_draw(tmp_path):
    def refuse(obs):
        raise RuntimeError("I would rather not")

    plan = Plan.product(policy_specs({"no": refuse}), [World(WORLD)], seeds=[0])
    summary = summarize_runs(run_plan(plan))
    assert (summary.rows, summary.has_picture) == ((), False)
    assert str(summary).endswith("RuntimeError: I would rather not")
    with pytest.raises(ValueError, match="nothing to draw"):
        summary.draw(tmp_path / "runs.png")


@pytest.mark.parametrize(
    ("n_runs", "words"),
    [
        ([1, 1], "one seed, so no interval"),
        ([1, 3], "± 95% t interval over 3 seeds, wide because so few say little (make 4 or more)"),
        ([0, 4], "± 95% t interval over seeds"),
    ],
)
def test_wide_and_absent_intervals_are_explained(n_runs, words):
    assert interval_words(n_runs) == words
