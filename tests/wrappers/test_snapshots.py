"""Snapshots of a whole stack: every wrapper goes on as it would have, and so does the record."""

import copy

import numpy as np
import pytest

from swarm_forage_env import SnapshotError, load_policy
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support.branches import Branch, pickled, whole_stack
from tests.support.fake_arena import small_scenario

POLICY_OF = {"none": "dpo", "static": "stochm", "dynamic": "stochx"}
RUNS = [("warehouse_small", "none"), ("warehouse_medium", "static"), ("warehouse_dual", "dynamic")]


@pytest.mark.parametrize(("name", "caches"), RUNS)
def test_a_stack_goes_on_from_a_snapshot_to_the_same_record(name, caches):
    stack = whole_stack(name, "compiled", caches)
    run = Branch(stack, load_policy(POLICY_OF[caches])).go_on(300)
    snapshot = stack.snapshot()
    fresh = whole_stack(name, "compiled", caches)
    branches = [run.beside(env, env.restore_batch(snapshot)) for env in (fresh,)]
    branches += [run.beside(env, run.obs) for env in (copy.deepcopy(stack), pickled(stack))]
    expected = run.beside(stack, run.obs).go_on(200)
    columns = expected.columns()
    assert sum(columns["deaths"]) > 0
    assert sum(columns["repairs"]) > 0
    branches.append(run.beside(stack, stack.restore_batch(snapshot)))  # after the end of the run
    for branch in branches:
        assert branch.go_on(200).seen == expected.seen
        assert branch.columns() == columns


@pytest.mark.parametrize("words", [["sensor_noise:sigma=0.2"], []], ids=["other", "none"])
def test_snapshots_of_other_stacks_are_refused(words):
    world = small_scenario(physics="compiled")
    env = build_env(world, [parse_wrapper("sensor_noise:sigma=0.1")])
    env.reset_batch(1)
    other = build_env(world, [parse_wrapper(word) for word in words])
    for refusing in (other, env.unwrapped):
        with pytest.raises(SnapshotError, match="wrappers of this one, got another"):
            refusing.restore(env.snapshot())


def test_observations_per_agent_are_those_that_the_wrappers_showed():
    env = build_env(small_scenario(physics="compiled"), [parse_wrapper("sensor_noise:sigma=0.1")])
    env.reset(seed=1)
    obs, *_ = env.step({agent: np.ones(3, np.float32) for agent in env.agents})
    snapshot = env.snapshot()
    env.step({agent: np.ones(3, np.float32) for agent in env.agents})
    restored = env.restore(snapshot)
    assert list(restored) == list(obs)
    for agent, row in restored.items():
        np.testing.assert_array_equal(row, obs[agent])
