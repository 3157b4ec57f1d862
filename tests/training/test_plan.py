"""Training plans: from TOML, to JSON and back, and what is refused."""

from dataclasses import replace

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training.evaluation import EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.plan import Stage, TrainingPlan, named_plan, read_plan
from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.wrappers.world import World
from tests.support.sampled import TWO_WORLDS

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
        ("n_arenas = 2", "n_arenas = 0", "n_arenas to be a whole number from 1 to 10,000"),
        ("n_arenas = 2", "arenas = 2", "Did you mean 'n_arenas'"),
        ("sigma = 0.02", "sigma = -1.0", "sigma"),
        ("width_m = 20.0", "n_robots = 5", "n_robots to stay 6"),
        ("steps = 100", "", r"Missing key 'stages\[0\].steps'"),
        ("horizon_s = 400.0", "horizont_s = 400.0", r"evaluation.horizont_s'. Did you mean 'horizon_s'"),
        ("n_arenas = 2", "n_arenas = 2\ntemperature = 0.0", "temperature to be a number from 0.0001 to 100"),
        ("n_arenas = 2", "n_arenas = 2\ntemperature = 0.5", "only with samples, got 0.5; set samples = true"),
        ("n_arenas = 2", "n_arenas = 2\nsamples = true", "a temperature for samples of dqn"),
        ("decision_ticks = 1", "decision_tick = 1", r"in_runs.decision_tick'. Did you mean"),
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
        ({}, "Expected scenario to be a table"),
        ({**PRESET, "stages": []}, "stages to have at least 1"),
        ({**PRESET, "stages": {"steps": 100}}, r"stages to be a list of tables, \[\[stages\]\]"),
        ({"sampler": TWO_WORLDS}, r"evaluation\.worlds beside a sampler"),
        ({"sampler": TWO_WORLDS, **PRESET}, "either sampler or scenario"),
        ({"sampler": TWO_WORLDS, "evaluation": {"worlds": [PRESET] * 2}}, "different names"),
        ({**PRESET, "evaluation": {"worlds": [{**PRESET, "nam": "a"}]}}, "Did you mean 'name'"),
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


def test_a_plan_is_named_or_a_file(tmp_path):
    with pytest.raises(ConfigError, match="Cannot read the plan"):
        named_plan(str(tmp_path / "nothing.toml"))
    with pytest.raises(ConfigError, match=r"\(generalist, .*got 'generalst', which is neither. Did you mean"):
        named_plan("generalst")


def test_fields_are_set_by_name(plan):
    changed = plan.with_settings({"n_arenas": 3, "options.tau": 0.5, "scenario.robots.n_robots": 7})
    assert (changed.n_arenas, changed.options, changed.scenario.robots.n_robots) == (3, {"gamma": 0.9, "tau": 0.5}, 7)
    with pytest.raises(ConfigError, match=r"Did you mean 'interface\.observation'"):
        plan.with_settings({"interfac.observation": "full"})


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


def test_numbers_that_no_file_holds_are_refused_before_a_training(tmp_path):
    plan = recipe("warehouse_small", steps=1000, options={"max_grad_norm": float("inf")})
    with pytest.raises(ValueError, match="the plan to be plain JSON values"):
        plan.write(tmp_path / "plan.json")
    assert not [*tmp_path.iterdir()]
