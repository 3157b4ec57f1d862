"""The recipe for a training: its defaults, what overrides them, and the smaller arena it begins in."""

import dataclasses
import re
from pathlib import Path

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import scenario, warehouse_small
from swarm_forage_env.training.evaluation import EVALUATE_EVERY, EvaluationPlan
from swarm_forage_env.training.plan import Stage, read_plan
from swarm_forage_env.training.recipe import LATE_OPTIONS, recipe, small_arena
from tests.support.sampled import sampler


def test_defaults_of_other_algorithms_and_worlds():
    assert recipe(algorithm="sac").interface.actions == "continuous"
    assert recipe(message_size=2, interface={"actions": "continuous"}).interface.frame_decisions == 0
    assert {stage.scenario["horizon_s"] for stage in recipe("classroom").stages} == {scenario("classroom").horizon_s}
    assert {world.scenario.horizon_s for world in recipe().judging_worlds} == {10_000.0}
    with pytest.raises(ConfigError, match="Expected steps to be a whole number"):
        recipe(steps=0)


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


@pytest.mark.parametrize(("n_robots", "n_arenas"), [(4, 8), (50, 8), (51, 7), (115, 3), (200, 2), (1000, 1)])
def test_large_swarms_have_fewer_arenas(n_robots, n_arenas):
    assert recipe("warehouse_medium", n_robots=n_robots).n_arenas == n_arenas
    assert recipe("warehouse_medium", n_robots=n_robots, n_arenas=5).n_arenas == 5


@pytest.mark.parametrize("name", ["warehouse_medium", "search_and_rescue"])
def test_what_was_measured_for_a_scenario_goes_before_the_general_recipe(name):
    plan = recipe(name)
    assert plan.scenario.reward.interference == -0.002
    assert plan.options["ent_coef"] == 0.01
    assert len({stage.scenario["horizon_s"] for stage in plan.stages}) == 1
    other = recipe(name, interference=-0.1, horizon_s=500.0, options={"ent_coef": 0.02})
    assert (other.scenario.reward.interference, other.options["ent_coef"]) == (-0.1, 0.02)
    assert {stage.scenario["horizon_s"] for stage in other.stages} == {500.0}
    assert "ent_coef" not in recipe(name, algorithm="dqn").options
    assert recipe(scenario(name)).scenario == scenario(name)


def test_large_swarms_are_evaluated_less_often():
    assert recipe("warehouse_medium").evaluation.every_steps == 4_000_000
    assert recipe("warehouse_medium", evaluation={"horizon_s": 2000.0}).evaluation.every_steps == EVALUATE_EVERY
    assert recipe("warehouse_medium", evaluation={"every_steps": 7}).evaluation == EvaluationPlan(every_steps=7)
    with pytest.raises(ConfigError, match=r"evaluation\.every_step'.*Did you mean"):
        recipe(evaluation={"every_step": 7})


@pytest.mark.parametrize(
    ("n_robots", "n_arenas", "options", "expected"),
    [
        (4, 2, {}, 1024),  # all of 128 * 8
        (50, 1, {}, 3200),
        (7, 5, {}, 2240),  # half of 128 * 35
        (1, 1, {"n_steps": 9739}, 3200),  # a prime
        (7, 5, {"batch_size": 1000}, 1000),
    ],
)
def test_the_default_minibatch_fits_the_rollout(n_robots, n_arenas, options, expected):
    plan = recipe("warehouse_small", n_robots=n_robots, n_arenas=n_arenas, options=options)
    assert plan.options["batch_size"] == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("warehouse_small", (12.8, 16.0, (1.28, 8.0), (1.28, 12.8))),
        ("warehouse_dual", (12.8, 16.0, (6.4, 8.0), (1.28, 12.8))),
        ("warehouse_quad", (19.2, 19.2, (9.6, 9.6), (3.84, 3.84))),
    ],
)
def test_a_small_start_keeps_proportions(name, expected):
    config = scenario(name)
    small = with_overrides(config, **small_arena(config)).arena
    width, height, centre, size = expected
    assert (small.width_m, small.height_m) == pytest.approx((width, height))
    assert small.nest_centre_m == pytest.approx(centre)
    assert small.nest_size_m == pytest.approx(size)


def test_a_small_start_that_cannot_hold_the_objects_is_refused():
    with pytest.raises(ConfigError, match=r"objects for placement .* small_start=False"):
        recipe("warehouse_small", n_objects=800, small_start=True)
    assert len(recipe("warehouse_small", n_objects=800, small_start=False).stages) == 2


def test_a_sampler_is_judged_in_the_largest_world_of_each_name():
    plan = recipe(sampler=sampler())
    assert [world.name for world in plan.evaluation.worlds] == ["warehouse_small_6", "search_and_rescue_4"]
    assert ([dict(stage.scenario) for stage in plan.stages], plan.n_arenas) == ([{}, {}], 8)
    with pytest.raises(ConfigError, match="either a sampler or n_robots"):
        recipe(sampler=sampler(), n_robots=3)
