"""Whole runs of 50,000 ticks: robots stay in the arena, objects stay in the world, numbers stay finite."""

from itertools import pairwise

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.presets import scenario
from tests.support.crowded_runs import BusyPolicy, change_population, made_for
from tests.support.stage import assert_conserved

TICKS = 50_000
RADIUS_M = 0.085036758
TOLERATED_M = 0.05 * 2 * RADIUS_M

pytestmark = pytest.mark.slow


def assert_inside(env: ForageEnv) -> None:
    """Nobody has left the free floor by more than the tolerated overlap."""
    x_low, y_low, x_high, y_high = env.scenario.arena.interior_m
    position = env.swarm.position[env.swarm.present]
    low = np.array([x_low, y_low]) + RADIUS_M - TOLERATED_M
    high = np.array([x_high, y_high]) - RADIUS_M + TOLERATED_M
    assert np.all(np.isfinite(position))
    assert np.all((position >= low) & (position <= high)), "a robot left the arena"


def run(env: ForageEnv, policy, seed: int, *, ticks: int = TICKS, population: bool = False) -> list[np.ndarray]:
    """Run to the end with looks at the world on the way; returns the counters at each look."""
    policy.reset(env.swarm_spec, stream_rng(seed, Stream.POLICY))
    obs = env.reset_batch(seed)
    crowd = np.random.default_rng(seed)
    counters = []
    for tick in range(1, ticks + 1):
        if population and tick % 50 == 0:
            change_population(env, crowd)
        obs = env.step_batch(policy.act(obs, env.active), tasks=getattr(policy, "task", None))[0]
        if tick % 20 == 0 and not population:  # a robot may be born on top of another or on a wall
            assert_inside(env)
        if tick % 500 == 0:
            assert_conserved(env)
            assert np.abs(obs).max() <= 1.0
            counters.append(env.events.counters.copy())
    return counters


@pytest.mark.parametrize("policy", ["random", "crw"])
def test_nobody_leaves_the_arena(policy):
    env = ForageEnv(scenario("warehouse_medium", n_robots=200))
    counters = run(env, load_policy(policy), 1)
    assert counters[-1][Counter.PRESENT] == counters[-1][Counter.ACTIVE] == 200 * TICKS
    assert all(np.all(later >= earlier) for earlier, later in pairwise(counters)), "counters never fall"
    assert 0.0 <= env.events.interference_sum[0] <= TICKS
    if policy == "crw":
        assert counters[-1][Counter.COLLECTED] > 500


@pytest.mark.parametrize("caches", ["none", "static", "dynamic"])
@pytest.mark.parametrize("name", ["warehouse_small", "search_and_rescue"])
def test_objects_survive_long_runs_with_robots_that_come_and_go(name, caches):
    env = ForageEnv(scenario(name, caches=caches, side_share=0.05))
    run(env, BusyPolicy(), 3, ticks=10_000, population=True)
    assert env.events.counters[Counter.FREE_PICKUPS] > 50


@pytest.mark.parametrize("policy", ["crw", "dpo", "cpfa", "stochm", "stochx"])
def test_controllers_deliver_over_a_whole_run(policy):
    for caches in made_for(policy)[:1]:
        env = ForageEnv(scenario("warehouse_small", caches=caches))
        counters = run(env, load_policy(policy), 4)
        collected = np.array([row[Counter.COLLECTED] for row in counters])
        assert collected[-1] > 50
        halves = collected[len(collected) // 2], collected[-1] - collected[len(collected) // 2]
        assert min(halves) > 10, "the flow of objects does not dry up"


def test_stochx_uses_caches_among_clusters():
    used = 0
    for seed in range(10):
        env = ForageEnv(scenario("search_and_rescue", caches="dynamic"))
        run(env, load_policy("stochx"), seed, ticks=10_000)
        used += env.events.counters[Counter.CACHE_PICKUPS] > 0
    assert used >= 9
