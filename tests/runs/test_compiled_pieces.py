"""Runs without Python between ticks, in pieces: what is kept between two pieces changes nothing and is not copied."""

import pickle

import numpy as np
import pytest

from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_stack
from swarm_forage_env.scenarios.presets import scenario

WORLD = scenario("warehouse_small", n_robots=6, n_objects=20, horizon_s=200.0, physics="compiled")


def started(policy, seed: int = 3) -> LiveRun:
    return LiveRun(build_stack(WORLD, reads=policy.reads), policy, seed)


def test_the_compiled_policy_is_kept_for_one_run_only():
    policy = load_policy("dpo")
    run = started(policy)
    first = policy.compiled()
    run.advance(to_tick=10)
    assert policy.compiled() is first
    again = started(policy)
    assert policy.compiled() is not first
    again.advance(to_tick=200)
    fresh = started(load_policy("dpo"))
    fresh.advance(to_tick=200)
    assert np.array_equal(again.forage_env.swarm.position, fresh.forage_env.swarm.position)


@pytest.mark.parametrize("name", ["stochx", "generalist"])
def test_a_run_and_its_copy_go_on_alike(name):
    run = started(load_policy(name))
    run.advance(to_tick=103)  # between two decisions of the network
    copy = pickle.loads(pickle.dumps(run))  # noqa: S301 - our own bytes
    for one in (run, copy):
        one.advance(to_tick=400)
    for array in ("position", "heading", "carried_object"):
        assert np.array_equal(getattr(run.forage_env.swarm, array), getattr(copy.forage_env.swarm, array))
