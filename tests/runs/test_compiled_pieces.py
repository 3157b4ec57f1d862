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


@pytest.mark.parametrize("policy", ["dpo", "generalist"])
def test_pieces_make_one_run(policy):
    whole, pieces = started(load_policy(policy)), started(load_policy(policy))
    assert pieces.compiled_policy is not None
    by_ticks = LiveRun(build_stack(WORLD, reads=load_policy(policy).reads), load_policy(policy), 3, by_ticks=True)
    whole.advance(to_tick=600)
    for tick in (1, 2, 7, 300, 301, 600):
        for run in (pieces, by_ticks):
            run.advance(to_tick=tick)
        assert pieces.forage_env.last_obs.tobytes() == by_ticks.forage_env.last_obs.tobytes()
    for name in ("position", "heading", "carried_object"):
        assert np.array_equal(getattr(whole.forage_env.swarm, name), getattr(pieces.forage_env.swarm, name))


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


@pytest.mark.parametrize("name", ["dpo", "generalist"])
def test_copies_in_the_middle_leave_compiled_functions_out(name):
    policy = load_policy(name)
    run = started(policy)
    run.advance(to_tick=100)
    copy = pickle.loads(pickle.dumps(policy))  # noqa: S301 - our own bytes
    assert copy.compiled() is not policy.compiled()
    snapshot = run.forage_env.snapshot()
    assert pickle.loads(pickle.dumps(snapshot)).seed == 3  # noqa: S301 - our own bytes


@pytest.mark.parametrize("name", ["stochx", "generalist"])
def test_a_run_and_its_copy_go_on_alike(name):
    run = started(load_policy(name))
    run.advance(to_tick=103)  # between two decisions of the network
    copy = pickle.loads(pickle.dumps(run))  # noqa: S301 - our own bytes
    for one in (run, copy):
        one.advance(to_tick=400)
    for array in ("position", "heading", "carried_object"):
        assert np.array_equal(getattr(run.forage_env.swarm, array), getattr(copy.forage_env.swarm, array))
