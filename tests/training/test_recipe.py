"""The recipe for a training: its defaults, what overrides them, and the smaller arena it begins in."""

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.config import RewardConfig, with_overrides
from swarm_forage_env.scenarios.presets import scenario, warehouse_small
from swarm_forage_env.training.plan import EvaluationPlan, Stage
from swarm_forage_env.training.recipe import recipe, small_arena


def test_defaults_are_what_a_driver_needs():
    plan = recipe()
    assert plan.interface == InterfaceConfig(
        observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5
    )
    assert (plan.algorithm, plan.n_arenas, plan.hidden, plan.seed) == ("ppo", 8, (64, 64), 0)
    assert plan.options == {
        "n_steps": 128,
        "batch_size": 3200,
        "n_epochs": 4,
        "gamma": 0.99,
        "gae_lambda": 0.98,
        "learning_rate": 0.001,
        "ent_coef": 0.003,
    }
    assert plan.evaluation == EvaluationPlan()
    assert recipe(algorithm="sac").interface.actions == "continuous"


def test_where_deliveries_count_the_way_to_them_is_rewarded_and_short_at_first():
    plan = recipe("warehouse_small")
    assert plan.scenario == warehouse_small(horizon_s=1000.0, nest_progress=0.05, first_pickup=1.0)
    assert plan.stages == (Stage(steps=1_666_666, scenario=small_arena(plan.scenario)), Stage(steps=3_333_334))
    assert plan == recipe("warehouse_small", small_start=True, nest_progress=0.05, first_pickup=1.0)


def test_where_deliveries_do_not_count_the_scenario_says_the_rewards():
    plan = recipe("search_and_rescue")
    assert plan.scenario == scenario("search_and_rescue", horizon_s=1000.0)
    assert plan.stages == (Stage(steps=5_000_000),)
    counting = recipe("search_and_rescue", performance="collected", side_m=64.0)
    assert counting.scenario.reward.nest_progress == 0.05


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ({"nest_progress": 0.0}, RewardConfig(nest_progress=0.0, first_pickup=1.0)),
        ({"first_pickup": 0.5, "tick": -0.1}, RewardConfig(nest_progress=0.05, first_pickup=0.5, tick=-0.1)),
        ({"reward": RewardConfig(delivery=3.0)}, RewardConfig(delivery=3.0)),
    ],
)
def test_rewards_that_are_given_go_before_those_of_the_recipe(overrides, expected):
    plan = recipe("warehouse_small", horizon_s=400.0, **overrides)
    assert plan.scenario.reward == expected
    assert plan.scenario.horizon_s == 400.0


def test_a_complete_configuration_is_taken_as_it_is():
    config = warehouse_small(n_robots=7, interference=-0.1)
    assert recipe(config).scenario == config
    assert recipe(config, n_objects=30).scenario == with_overrides(config, n_objects=30)


def test_an_interface_is_given_whole_or_by_what_differs():
    assert recipe(interface={"decision_ticks": 2}).interface == InterfaceConfig(
        observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=2
    )
    numbered = InterfaceConfig(actions="discrete")
    assert recipe(interface=numbered).interface is numbered
    with pytest.raises(ConfigError, match="Did you mean 'decision_ticks'"):
        recipe(interface={"decision_tick": 2})


def test_the_other_arguments_reach_the_plan():
    evaluation = EvaluationPlan(every_steps=50)
    plan = recipe(
        algorithm="dqn",
        steps=300,
        n_arenas=3,
        wrappers=["sensor_noise:sigma=0.02"],
        hidden=(8,),
        options={"gamma": 0.9},
        small_start=False,
        evaluation=evaluation,
        seed=3,
    )
    assert (plan.algorithm, plan.n_arenas, plan.hidden, plan.seed) == ("dqn", 3, (8,), 3)
    assert (plan.stages, plan.evaluation) == ((Stage(steps=300),), evaluation)
    assert [config.name for config in plan.wrappers] == ["sensor_noise"]
    assert (plan.options["gamma"], plan.options["train_freq"]) == (0.9, 4)


@pytest.mark.parametrize(
    ("n_robots", "n_arenas", "options", "expected"),
    [
        (4, 2, {}, 1024),  # all of 128 * 8
        (50, 1, {}, 3200),
        (7, 5, {}, 2240),  # half of 128 * 35
        (1, 1, {"n_steps": 9739}, 3200),  # a prime
        (1, 1, {"n_steps": 1}, 3200),
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
        ("warehouse_medium", (19.2, 19.2, (9.6, 9.6), (3.84, 3.84))),
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
    assert len(recipe("warehouse_small", n_objects=800, small_start=False).stages) == 1
