"""Whole runs: no robot at work stays within 5 cm for ten minutes, walls hold, objects stay, deliveries go on."""

from itertools import pairwise

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env, run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from swarm_forage_env.scenarios.presets import scenario, warehouse_medium
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from swarm_forage_env.wrappers.base import wrap_in_order
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support.crowded_runs import BusyPolicy, change_population, made_for
from tests.support.foraging import mild_wrappers
from tests.support.stage import assert_conserved

pytestmark = pytest.mark.slow

CONTROLLERS = ["crw", "dpo", "cpfa", "stochm", "stochx"]
SMALL = ("warehouse_small", {"horizon_s": 4000.0})
CROWDED = ("warehouse_small", {"horizon_s": 2000.0, "n_robots": 128})
MEDIUM = ("warehouse_medium", {"horizon_s": 2000.0})
RESCUE = ("search_and_rescue", {"horizon_s": 3000.0, "side_m": 32.0})
NEAR_M, LONG_S, SAMPLE_S = 0.05, 600.0, 5.0

under_both_readings = pytest.mark.parametrize(
    "quirks", [Quirks(), AUTHORS_PROGRAM], ids=["as described", "authors' program"]
)


def longest_stand_s(world, policy, seed, *, quirks=None, wrappers=()) -> float:
    """The longest time that a robot at work, whom no pick-up or drop keeps waiting, stayed near one place."""
    name, fields = world
    spec = plan_run(scenario(name, quirks=quirks or Quirks(), **fields), policy, seed=seed, wrappers=wrappers)
    chosen = load_policy(policy)
    run = LiveRun(build_env(spec.scenario, wrappers, reads=getattr(chosen, "reads", None)), chosen, seed)
    env, every = run.forage_env, round(SAMPLE_S / spec.scenario.dt_s)
    place, since, longest = env.swarm.position.copy(), np.zeros(spec.scenario.robots.n_robots), 0.0
    while not run.over:
        run.advance(to_tick=env.tick + every)
        gone = np.linalg.norm(env.swarm.position - place, axis=1) > NEAR_M
        gone |= ~(env.active & (env.swarm.pending_kind == 0))
        place[gone], since[gone] = env.swarm.position[gone], env.tick * spec.scenario.dt_s
        longest = max(longest, float((env.tick * spec.scenario.dt_s - since).max()))
    return longest


@under_both_readings
@pytest.mark.parametrize("policy", CONTROLLERS)
@pytest.mark.parametrize("world", [SMALL, RESCUE], ids=["small", "rescue"])
def test_nobody_stands_in_calm(world, policy, quirks):
    assert longest_stand_s(world, policy, 2, quirks=quirks) < LONG_S


@pytest.mark.parametrize("policy", CONTROLLERS)
def test_nobody_stands_under_noise_on_wheels(policy):
    noise = (parse_wrapper("actuator_noise:sigma=0.03"),)
    assert longest_stand_s(SMALL, policy, 8, wrappers=noise) < LONG_S


@under_both_readings
def test_nobody_stands_among_two_hundred(quirks):
    assert longest_stand_s(MEDIUM, "dpo", 5, quirks=quirks) < LONG_S


@pytest.mark.parametrize("policy", CONTROLLERS)
def test_nobody_stands_in_a_crowd(policy):
    assert longest_stand_s(CROWDED, policy, 6) < LONG_S


@under_both_readings
def test_cache_starters_move_on_from_places_that_are_refused(quirks):
    """They stood for up to 4,300 s in this run."""
    assert longest_stand_s(("warehouse_small", {}), "stochx", 1, quirks=quirks) < LONG_S


def test_carriers_side_by_side_part():
    """Two of them turned to and fro for 1,080 s in this run, from 555 s on."""
    fields = {"n_robots": 200, "horizon_s": 1400.0}
    assert longest_stand_s(("warehouse_medium", fields), "dpo", 6, quirks=AUTHORS_PROGRAM) < LONG_S


@pytest.mark.parametrize("seed", [1, 2])
def test_dpo_delivers_as_much_in_the_second_half_of_a_run(seed):
    collected = run_one(plan_run(warehouse_medium(), "dpo", seed=seed))["collected"]
    half = len(collected) // 2
    first, second = np.mean(collected[1:half]), np.mean(collected[half:])  # nobody delivers in the first minutes
    print(f"\nseed {seed}: deliveries per interval {first:.1f}, then {second:.1f}")  # noqa: T201 - the finding
    assert second > 0.9 * first


TICKS = 3000
WAYS = {"E": (1, 0), "W": (-1, 0), "N": (0, 1), "S": (0, -1)}
WAYS |= {"NE": (1, 1), "NW": (-1, 1), "SE": (1, -1), "SW": (-1, -1)}
"""Directions of walls and corners."""
PLACES = (*WAYS, "random")
CASES = [(n, place, wrapped) for n in (50, 128) for place in PLACES for wrapped in (False, True)]
CASES += [(200, "NE", True), (200, "S", False), (512, "SW", False), (512, "NE", True), (512, "random", True)]


def actions_towards(env: ForageEnv, place: str, rng: np.random.Generator) -> np.ndarray:
    """Full speed towards a wall or a corner, turning on the spot to face it, or at random; (N, 3)."""
    swarm, arena = env.swarm, env.scenario.arena
    if place == "random":
        return rng.uniform(-1, 1, (len(env.active), 3)).astype(np.float32)
    actions, way = np.zeros((len(swarm.active), 3), np.float32), np.array(WAYS[place])
    to = np.where(way == 0, 0.0, np.where(way > 0, (arena.width_m, arena.height_m), 0.0) - swarm.position)
    turn = np.angle(np.exp(1j * (np.arctan2(to[:, 1], to[:, 0]) - swarm.heading)))
    actions[:, 0] = np.where(np.abs(turn) < 0.3, 1.0, -np.sign(turn))
    actions[:, 1] = np.where(np.abs(turn) < 0.3, 1.0, np.sign(turn))
    return actions


@pytest.mark.parametrize("physics", PHYSICS_ENGINES)
@pytest.mark.parametrize(("n_robots", "place", "wrapped"), CASES)
def test_nobody_is_outside(n_robots, place, wrapped, physics):
    env = ForageEnv(scenario("warehouse_small", n_robots=n_robots, n_objects=5, physics=physics))
    stack = wrap_in_order(env, mild_wrappers()) if wrapped else env
    stack.reset_batch(n_robots)
    x_low, y_low, x_high, y_high = env.scenario.arena.interior_m
    radius, rng = env.scenario.robots.radius_m, np.random.default_rng(1)
    arrived = 0.0
    for _ in range(TICKS):
        stack.step_batch(actions_towards(env, place, rng))
        x, y = env.swarm.position[env.swarm.present].T
        low, high = min((x - x_low).min(), (y - y_low).min()), min((x_high - x).min(), (y_high - y).min())
        assert min(low, high) >= radius - 1e-9
        arrived += min(low, high) < radius + 0.01
    assert place == "random" or arrived > TICKS / 3, "they push"


# Objects stay in the world, and deliveries go on


def conserved_run(env: ForageEnv, policy, seed: int, *, ticks: int, population: bool = False) -> list[np.ndarray]:
    """Run with looks at the world on the way; returns the counters at each look, which never fall."""
    policy.reset(env.swarm_spec, stream_rng(seed, Stream.POLICY))
    obs = env.reset_batch(seed)
    crowd = np.random.default_rng(seed)
    counters = []
    for tick in range(1, ticks + 1):
        if population and tick % 50 == 0:
            change_population(env, crowd)
        obs = env.step_batch(policy.act(obs, env.active), tasks=getattr(policy, "task", None))[0]
        if tick % 500 == 0:
            assert_conserved(env)
            assert np.abs(obs).max() <= 1.0
            counters.append(env.events.counters.copy())
    assert all(np.all(later >= earlier) for earlier, later in pairwise(counters))
    return counters


@pytest.mark.parametrize("caches", ["none", "static", "dynamic"])
@pytest.mark.parametrize("name", ["warehouse_small", "search_and_rescue"])
def test_objects_survive_long_runs_with_robots_that_come_and_go(name, caches):
    env = ForageEnv(scenario(name, caches=caches, side_share=0.05))
    conserved_run(env, BusyPolicy(), 3, ticks=10_000, population=True)
    assert env.events.counters[Counter.FREE_PICKUPS] > 50


@pytest.mark.parametrize("policy", ["crw", "dpo", "cpfa", "stochm", "stochx"])
def test_controllers_deliver_over_a_whole_run(policy):
    for caches in made_for(policy)[:1]:
        env = ForageEnv(scenario("warehouse_small", caches=caches))
        counters = conserved_run(env, load_policy(policy), 4, ticks=50_000)
        collected = np.array([row[Counter.COLLECTED] for row in counters])
        assert collected[-1] > 50
        halves = collected[len(collected) // 2], collected[-1] - collected[len(collected) // 2]
        assert min(halves) > 10, "the flow of objects does not dry up"


def test_stochx_uses_caches_among_clusters():
    used = 0
    for seed in range(10):
        env = ForageEnv(scenario("search_and_rescue", caches="dynamic"))
        conserved_run(env, load_policy("stochx"), seed, ticks=10_000)
        used += env.events.counters[Counter.CACHE_PICKUPS] > 0
    assert used >= 9
