"""Training plans: from TOML, to JSON and back, and what is refused."""

from dataclasses import replace

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.pretrained import plan_file
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.plan import LEARNING, Stage, TrainingPlan, named_plan, read_plan
from swarm_forage_env.wrappers.world import World

TOML = """
algorithm = "dqn"
n_arenas = 2
hidden = [16]

[scenario]
preset = "warehouse_small"
n_robots = 6
nest_centre_m = [4.0, 8.0]

[wrappers.sensor_noise]
sigma = 0.02

[interface]
actions = "discrete"
decision_ticks = 2

[options]
gamma = 0.9

[[stages]]
steps = 100
scenario = { width_m = 20.0, nest_centre_m = [2.0, 8.0] }

[[stages]]
steps = 200
options = { learning_rate = 0.1 }

[evaluation]
every_steps = 50
horizon_s = 400.0
"""


@pytest.fixture
def plan(tmp_path) -> TrainingPlan:
    path = tmp_path / "plan.toml"
    path.write_text(TOML)
    return read_plan(path)


def test_a_plan_says_what_its_file_says(plan):
    assert plan.algorithm == "dqn"
    assert plan.hidden == (16,)
    assert plan.scenario == warehouse_small(n_robots=6, nest_centre_m=(4.0, 8.0))
    assert [config.name for config in plan.wrappers] == ["sensor_noise"]
    assert plan.interface == InterfaceConfig(actions="discrete", decision_ticks=2)
    assert plan.stages[0] == Stage(steps=100, scenario={"width_m": 20.0, "nest_centre_m": (2.0, 8.0)})
    assert plan.stages[1].options == {"learning_rate": 0.1}
    assert plan.total_steps == 300
    assert plan.evaluation == EvaluationPlan(every_steps=50, horizon_s=400.0)


def test_evaluations_are_whole_runs_of_the_scenario_under_seeds_of_their_own(plan):
    twice = replace(plan.evaluation, n_runs=2)
    specs = replace(plan, evaluation=twice).judging(LEARNING).specs
    assert [spec.seed for spec in specs] == [1_000_000, 1_000_001]
    assert {spec.scenario.horizon_s for spec in specs} == {400.0}
    assert specs[0].wrappers == plan.wrappers


def test_a_plan_is_read_back_from_what_it_writes(plan, tmp_path):
    framed = replace(plan, interface=replace(plan.interface, frame_decisions=5))
    for one in (framed, replace(framed, in_runs={"decision_ticks": 1, "frame_decisions": 9})):
        one.write(str(tmp_path / "plan.json"))
        assert read_plan(tmp_path / "plan.json") == one
        assert one.differences(framed) == (() if one is framed else tuple(
            f"in_runs.{name}: nothing before, {value} now" for name, value in one.in_runs.items()
        ))  # fmt: skip


def test_in_runs_needs_a_network_that_a_file_can_hold(plan):
    sac = replace(plan, algorithm="sac", interface=replace(plan.interface, actions="continuous"), options={})
    with pytest.raises(ConfigError, match="Expected in_runs only with ppo, a2c, dqn, got sac; leave it out"):
        replace(sac, in_runs={"decision_ticks": 1})


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('algorithm = "dqn"', 'algorithm = "sac"', "actions that sac can choose, got discrete"),
        ("n_arenas = 2", "n_arenas = 0", "n_arenas to be a whole number from 1 to 10,000"),
        ("n_arenas = 2", "arenas = 2", "Did you mean 'n_arenas'"),
        ("hidden = [16]", "hidden = [0]", "hidden to be a whole number"),
        ("gamma = 0.9", "gamma = 5", r"options.gamma to be a number > 0 and <= 1, got 5"),
        ("learning_rate = 0.1", "learning_rate = inf", "stage.options.learning_rate"),
        ("sigma = 0.02", "sigma = -1.0", "sigma"),
        ("[options]", "[options", "plan.toml"),
        ("width_m = 20.0", "n_robots = 5", "n_robots to stay 6"),
        ("steps = 100", "", "Expected a stage with its steps, such as steps = 1_000_000"),
        ("horizon_s = 400.0", 'horizon_s = 400.0\nbaseline = "crv"', "Did you mean 'crw'"),
        ("n_arenas = 2", "n_arenas = 2\ntemperature = 0.0", r"temperature to be a number from 0.0001 to 100, got 0"),
        ("n_arenas = 2", "n_arenas = 2\nin_runs = { frame_decisions = 5 }", "only of robots that learn in frames, too"),
        ("n_arenas = 2", "n_arenas = 2\ntemperature = 0.5", "only with samples, got 0.5; set samples = true"),
    ],
)
def test_plans_that_cannot_be_are_refused_with_their_file(tmp_path, old, new, reason):
    path = tmp_path / "plan.toml"
    path.write_text(TOML.replace(old, new))
    with pytest.raises(ConfigError, match=reason) as refusal:
        read_plan(path)
    assert str(path) in str(refusal.value)


def test_a_plan_has_stages_and_a_readable_file(tmp_path):
    with pytest.raises(ConfigError, match="at least one stage"):
        TrainingPlan(world=World(warehouse_small()), stages=())
    with pytest.raises(ConfigError, match="Cannot read the plan"):
        read_plan(tmp_path / "nothing.toml")


def test_a_shipped_plan_that_there_is_not_is_told_with_those_that_there_are():
    assert named_plan("generalist").in_runs
    with pytest.raises(
        ConfigError,
        match=r"as a shipped policy \(generalist, .*got 'generalst', which is neither. Did you mean 'generalist'",
    ):
        named_plan("generalst")


def test_performances_that_arenas_do_not_count_are_refused(plan):
    with pytest.raises(ConfigError, match="to be one of collected, first_picked, got 'n_carrying'"):
        replace(plan, world=replace(plan.world, scenario=replace(plan.scenario, performance="n_carrying")))


def test_a_file_without_a_table_is_no_plan(tmp_path):
    (tmp_path / "plan.json").write_text("[1]")
    with pytest.raises(ConfigError, match=r"the plan to be a table of values by name, got \[1\]"):
        read_plan(tmp_path / "plan.json")


def test_stages_are_a_list(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(TOML.partition("[[stages]]")[0] + "[stages]\nsteps = 100\n")
    with pytest.raises(ConfigError, match=r"stages to be a list of tables, \[\[stages\]\]"):
        read_plan(path)


def test_plans_that_go_on_with_a_training_differ_in_steps_to_come_alone(plan):
    assert plan.differences(plan) == ()
    assert plan.longer(300) == plan
    assert [stage.steps for stage in plan.longer(1000).stages] == [100, 900]
    assert plan.longer(1000).differences(plan) == ()
    assert replace(plan, stages=(*plan.stages, Stage(steps=5))).differences(plan) == ()
    with pytest.raises(ConfigError, match="at least the 300 steps of the plan, got 299"):
        plan.longer(299)


@pytest.mark.parametrize(
    ("changes", "difference"),
    [
        ({"seed": 4}, "seed: 0 before, 4 now"),
        (
            {"world": World(warehouse_small(n_robots=6))},
            "scenario.arena.nest_centre_m: (4.0, 8.0) before, (3.2, 8.0) now",
        ),
        (
            {"world": World(warehouse_small(n_robots=6, nest_centre_m=(4.0, 8.0)))},
            "wrappers.sensor_noise.sigma: 0.02 before, nothing now",
        ),
        ({"options": {"gamma": 0.9, "tau": 0.5}}, "options.tau: nothing before, 0.5 now"),
        ({"hidden": (16, 16)}, "hidden: (16,) before, (16, 16) now"),
    ],
)
def test_differences_are_named_field_by_field(plan, changes, difference):
    assert difference in replace(plan, **changes).differences(plan)


def test_stages_that_began_do_not_change(plan):
    first, last = plan.stages
    assert replace(plan, stages=(replace(first, steps=101), last)).differences(plan) == (
        "stages[0].steps: 100 before, 101 now",
    )
    assert replace(plan, stages=(first, replace(last, steps=199))).differences(plan) == (
        "stages[1].steps: 200 before, 199 now",
    )
    (fewer,) = replace(plan, stages=(first,)).differences(plan)[:1]
    assert fewer == "stages[1].steps: 200 before, nothing now"


def test_the_plan_of_the_shipped_policy_is_a_plan():
    path = plan_file("ppo_warehouse_small")
    assert path is not None
    plan = read_plan(path)
    assert plan.scenario.robots.n_robots == 50
    assert plan_file("crw") is None
