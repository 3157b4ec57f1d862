"""Nobody stands for ever: no robot at work stays within 5 cm for ten minutes without a reason."""

import numpy as np
import pytest

from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from swarm_forage_env.wrappers.registry import parse_wrapper

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
