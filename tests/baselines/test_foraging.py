"""The scripted controllers in whole runs: they forage, at the rate that geometry allows."""

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.registry import parse_wrapper


def counts(scenario_name: str, policy_name: str, ticks: int, seed: int, **overrides) -> np.ndarray:
    """Cumulative counters after a run."""
    env = ForageEnv(scenario(scenario_name, **overrides))
    obs = env.reset_batch(seed)
    policy = load_policy(policy_name)
    policy.reset(env.swarm_spec, stream_rng(seed, Stream.POLICY))
    for _ in range(ticks):
        obs, *_ = env.step_batch(policy.act(obs, env.active))
    return env.events.counters.copy()


@pytest.mark.parametrize("policy_name", ["crw", "dpo", "cpfa"])
@pytest.mark.parametrize(
    ("scenario_name", "ticks", "deliveries", "first_pickups"),
    [("warehouse_medium", 1500, 40, 80), ("search_and_rescue", 2500, 15, 30)],
)
def test_swarms_pick_up_and_deliver(scenario_name, policy_name, ticks, deliveries, first_pickups):
    counters = counts(scenario_name, policy_name, ticks, seed=1)
    assert counters[Counter.COLLECTED] >= deliveries
    assert counters[Counter.FIRST_PICKED] >= first_pickups
    carried = counters[Counter.FREE_PICKUPS] - counters[Counter.COLLECTED]
    assert 0 <= carried <= scenario(scenario_name).robots.n_robots


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario_name", "n_objects", "low", "high"), [("warehouse_medium", 800, 31, 47), ("warehouse_small", 177, 11, 17)]
)
def test_one_robot_with_a_memory_delivers_as_a_simple_model_predicts(scenario_name, n_objects, low, high):
    """A model with perfect homing and nobody and nothing in the way gives 31 to 47 and 14 to 17 deliveries in 10,000 s.

    The lower end for the small warehouse is what we observe, not the model's: 13.6 on average over 12 seeds (8 to 17).
    """
    runs = [
        counts(scenario_name, "dpo", 50_000, seed, n_robots=1, n_objects=n_objects)[Counter.COLLECTED]
        for seed in range(8)
    ]
    assert low <= np.mean(runs) <= high


@pytest.mark.parametrize("physics", PHYSICS_ENGINES)
def test_cpfa_forages_in_either_engine_while_robots_die(physics):
    world = scenario("warehouse_medium", n_robots=50, horizon_s=400.0, physics=physics)
    spec = plan_run(world, "cpfa", wrappers=[parse_wrapper("population:death_per_tick=0.0005")], seed=1)
    one, again = run_one(spec).columns, run_one(spec).columns
    assert one["n_active"][-1] < 50
    assert one["collected"].sum() > 20
    for name, values in one.items():
        np.testing.assert_array_equal(again[name], values, err_msg=name)
