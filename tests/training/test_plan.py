"""Training plans: from TOML, to JSON and back, and what is refused."""

import dataclasses
import re
from dataclasses import replace
from pathlib import Path

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import scenario, warehouse_small
from swarm_forage_env.training.evaluation import Evaluation, EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.recipe import LATE_OPTIONS, recipe, small_arena
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.sampled import TWO_WORLDS, sampler

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
frame_decisions = 5

[in_runs]
decision_ticks = 1

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
PRESET = {"scenario": {"preset": "warehouse_small"}}


@pytest.fixture
def plan(tmp_path) -> TrainingPlan:
    path = tmp_path / "plan.toml"
    path.write_text(TOML)
    return read_plan(path)


def test_a_plan_says_what_its_file_says(plan, tmp_path):
    assert (plan.algorithm, plan.hidden, plan.total_steps) == ("dqn", (16,), 300)
    assert plan.scenario == warehouse_small(n_robots=6, nest_centre_m=(4.0, 8.0))
    assert [config.name for config in plan.wrappers] == ["sensor_noise"]
    assert plan.interface == InterfaceConfig(actions="discrete", decision_ticks=2, frame_decisions=5)
    assert plan.run_interface == replace(plan.interface, decision_ticks=1)
    assert plan.stages[0] == Stage(steps=100, scenario={"width_m": 20.0, "nest_centre_m": (2.0, 8.0)})
    assert plan.stages[1].options == {"learning_rate": 0.1}
    assert plan.evaluation == EvaluationPlan(every_steps=50, horizon_s=400.0)
    assert {world.scenario.horizon_s for world in plan.judging_worlds} == {400.0}
    plan.write(str(tmp_path / "plan.json"))
    assert read_plan(tmp_path / "plan.json") == plan


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('algorithm = "dqn"', 'algorithm = "sac"', "actions that sac can choose, got discrete"),
        ("width_m = 20.0", "n_robots = 5", "n_robots to stay 6"),
        ("steps = 100", "", r"Missing key 'stages\[0\].steps'"),
        ("n_arenas = 2", "n_arenas = 2\ntemperature = 0.5", "only with samples, got 0.5; set samples = true"),
        ("n_arenas = 2", "n_arenas = 2\nsamples = true", "a temperature for samples of dqn"),
        ("frame_decisions = 5\n\n[in_runs]", "\n[in_runs]\nframe_decisions = 5", "a policy that learns with frames"),
    ],
)
def test_plans_that_cannot_be_are_refused_with_their_file(tmp_path, old, new, reason):
    path = tmp_path / "plan.toml"
    path.write_text(TOML.replace(old, new))
    with pytest.raises(ConfigError, match=reason) as refusal:
        read_plan(path)
    assert str(path) in str(refusal.value)


@pytest.mark.parametrize(
    ("mapping", "reason"),
    [
        ({**PRESET, "stages": {"steps": 100}}, r"stages to be a list of tables, \[\[stages\]\]"),
        ({"sampler": TWO_WORLDS}, r"evaluation\.worlds beside a sampler"),
        ({"sampler": TWO_WORLDS, **PRESET}, "either sampler or scenario"),
        ({**PRESET, "starts": 2}, "a second stage for the best of 2 starts"),
        (
            {**PRESET, "wrappers": {"sensor_noise": {"sigma": 0.1}}, "evaluation": {"worlds": [PRESET]}},
            "without wrappers beside samplers and evaluation.worlds",
        ),
        (
            {**PRESET, "algorithm": "sac", "interface": {"actions": "continuous"}, "in_runs": {"decision_ticks": 1}},
            "Expected in_runs only with ppo, a2c, dqn, got sac",
        ),
    ],
)
def test_tables_that_are_no_plan_are_refused(mapping, reason):
    with pytest.raises(ConfigError, match=reason):
        TrainingPlan.from_mapping(mapping)


@pytest.mark.parametrize("fields", [{"neighbours_seen": 2}, {"caches": "static"}])
def test_worlds_to_be_judged_in_fit_the_policy(fields):
    """The policy sees two neighbours within 4 m, which the worlds do not show so."""
    seen = {"neighbours_seen": 2, "neighbour_range_m": 4.0} if "neighbours_seen" in fields else {}
    odd = EvaluationWorld(scenario=warehouse_small(**fields), name="odd", baseline="crw")
    with pytest.raises(ConfigError, match=r"evaluation world odd(: .* neighbour_range_m=4| with the caches)"):
        TrainingPlan(world=World(warehouse_small(**seen)), evaluation=EvaluationPlan(worlds=(odd,)))


def test_fields_are_set_by_name(plan):
    changed = plan.with_settings({"n_arenas": 3, "options.tau": 0.5, "scenario.robots.n_robots": 7})
    assert (changed.n_arenas, changed.options, changed.scenario.robots.n_robots) == (3, {"gamma": 0.9, "tau": 0.5}, 7)
    with pytest.raises(ConfigError, match=r"Did you mean 'interface\.observation'"):
        plan.with_settings({"interfac.observation": "full"})


@pytest.mark.parametrize(
    ("told", "ends"),
    [
        ([], [10, 20, 30, 35]),
        ([(10, 0.9), (14, 2.0)], [10, 20, 30, 35]),
        ([(12, 0.9), (20, 1.0)], [10, 20, 25]),
        ([(10, 1.0)], [10, 15]),
    ],
)
def test_a_start_that_reaches_enough_is_the_last_one(told, ends):
    plan = TrainingPlan.from_mapping({**PRESET, "starts": 3, "enough": 1.0, "stages": [{"steps": 10}, {"steps": 5}]})
    none = {"wall_time_s": 0.0, "cpu_time_s": 0.0, "worlds": ()}
    parts = plan.parts([Evaluation(steps=steps, reached=reached, **none) for steps, reached in told])
    assert [end for _, end in parts] == ends
    assert [stage.steps for stage, _ in parts] == [10] * (len(ends) - 1) + [5]
    assert plan.total_steps == 35


def test_plans_that_go_on_with_a_training_differ_in_steps_to_come_alone(plan):
    first, last = plan.stages
    assert plan.differences(plan) == ()
    assert [stage.steps for stage in plan.longer(1000).stages] == [100, 900]
    assert plan.longer(1000).differences(plan) == ()
    assert replace(plan, stages=(*plan.stages, Stage(steps=5))).differences(plan) == ()
    with pytest.raises(ConfigError, match="at least the 300 steps of the plan, got 299"):
        plan.longer(299)
    for changes, difference in (
        ({"seed": 4}, "seed: 0 before, 4 now"),
        ({"world": World(plan.scenario)}, "wrappers.sensor_noise.sigma: 0.02 before, nothing now"),
        ({"options": {"gamma": 0.9, "tau": 0.5}}, "options.tau: nothing before, 0.5 now"),
        ({"hidden": (16, 16)}, "hidden: (16,) before, (16, 16) now"),
        ({"stages": (replace(first, steps=101), last)}, "stages[0].steps: 100 before, 101 now"),
        ({"stages": (first, replace(last, steps=199))}, "stages[1].steps: 200 before, 199 now"),
        ({"stages": (first,)}, "stages[1].steps: 200 before, nothing now"),
    ):
        assert difference in replace(plan, **changes).differences(plan)


def test_a_world_or_its_file_brings_its_fields_and_wrappers(tmp_path):
    file, noise = tmp_path / "hall.toml", parse_wrapper("sensor_noise:sigma=0.1")
    file.write_text("[set]\nn_robots = 7\nnest_progress = 0.1\n[wrappers.sensor_noise]\nsigma = 0.1\n")
    plan = recipe("warehouse_small", n_robots=7, nest_progress=0.1, wrappers=[noise])
    assert plan == recipe(file) == recipe(str(file), n_robots=7)
    assert recipe(plan.world).world == plan.world


def test_where_deliveries_count_the_way_to_them_is_rewarded_and_short_at_first():
    plan = recipe("warehouse_small")
    assert plan.scenario == warehouse_small(nest_progress=0.05, first_pickup=1.0, interference=-0.002)
    assert plan.stages == (
        Stage(steps=1_133_333, scenario={**small_arena(plan.scenario), "horizon_s": 2800.0}),
        Stage(steps=1_133_334, scenario={"horizon_s": 2800.0}),
        Stage(steps=1_133_333, scenario={"horizon_s": 2800.0}, options=LATE_OPTIONS["ppo"]),
    )
    assert plan == recipe("warehouse_small", small_start=True, nest_progress=0.05, first_pickup=1.0)
    assert [len(recipe("warehouse_medium", small_start=start).stages) for start in (None, True)] == [2, 3]
    other = recipe("search_and_rescue", interference=0.0, delivery=0.0, nest_progress=0.0)
    assert other.scenario == scenario("search_and_rescue")
    assert [stage.steps for stage in other.stages] == [2_266_667, 1_133_333]
    counting = recipe("search_and_rescue", performance="collected", side_m=64.0)
    assert counting.scenario.reward.nest_progress == 0.05


def test_the_last_third_learns_more_slowly_unless_people_say_how_fast():
    assert [dict(stage.options) for stage in recipe().stages] == [{}, {}, {"learning_rate": 0.0003, "gamma": 0.995}]
    plan = recipe(options={"learning_rate": 0.01}, small_start=False)
    assert [dict(stage.options) for stage in plan.stages] == [{}, {"gamma": 0.995}]
    assert plan.options["learning_rate"] == 0.01
    assert [dict(stage.options) for stage in recipe(options=LATE_OPTIONS["ppo"]).stages] == [{}, {}]
    assert [dict(stage.options) for stage in recipe(algorithm="dqn").stages] == [{}, {}]


def test_the_page_shows_the_default_training_as_a_plan(tmp_path):
    page = (Path(__file__).parents[2] / "docs/training.md").read_text(encoding="utf-8")
    (tmp_path / "plan.toml").write_text(re.search(r"```toml\n(algorithm = .*?)```", page, re.DOTALL)[1])
    shown, default = read_plan(tmp_path / "plan.toml"), recipe()
    assert (shown.temperature, shown.in_runs) == (0.5, {"decision_ticks": 2, "frame_decisions": 500})
    assert [stage.steps for stage in shown.stages] == pytest.approx([stage.steps for stage in default.stages], rel=0.05)
    stages = [
        dataclasses.replace(one, steps=other.steps) for one, other in zip(shown.stages, default.stages, strict=True)
    ]
    shown = dataclasses.replace(shown, temperature=1.0, in_runs={}, stages=tuple(stages))
    settings = default.settings()
    assert shown.settings().keys() == settings.keys()
    assert {name: value for name, value in shown.settings().items() if value != pytest.approx(settings[name])} == {}


@pytest.mark.parametrize(
    ("algorithm", "actions", "draws"),
    [
        ("ppo", "discrete", True),
        ("a2c", "discrete", True),
        ("ppo", "continuous", False),
        ("dqn", "discrete", False),
        ("sac", "continuous", False),
    ],
)
def test_policies_draw_their_actions_where_they_have_probabilities(algorithm, actions, draws):
    assert recipe(algorithm=algorithm, interface={"actions": actions}).samples is draws
    assert not recipe(algorithm=algorithm, interface={"actions": actions}, samples=False).samples
    if not draws:
        reason = "a temperature for samples of dqn" if algorithm == "dqn" else "discrete actions, got continuous ones"
        with pytest.raises(ConfigError, match=reason):
            recipe(algorithm=algorithm, interface={"actions": actions}, samples=True)


def test_a_sampler_is_judged_in_the_largest_world_of_each_name():
    plan = recipe(sampler=sampler())
    assert [world.name for world in plan.evaluation.worlds] == ["warehouse_small_6", "search_and_rescue_4"]
    assert ([dict(stage.scenario) for stage in plan.stages], plan.n_arenas) == ([{}, {}], 8)
    with pytest.raises(ConfigError, match="either a sampler or n_robots"):
        recipe(sampler=sampler(), n_robots=3)
