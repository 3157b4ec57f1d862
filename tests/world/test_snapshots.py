"""Snapshots, copies and pickles of an environment: the run goes on from them bit for bit."""

import copy
import pickle

import numpy as np
import pytest

from swarm_forage_env import Snapshot, SnapshotError, parallel_env
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from tests.support.branches import Branch, pickled, whole_stack


def small(**options):
    return parallel_env("warehouse_small", **{"n_robots": 3, "n_objects": 9, "physics": "compiled", **options})


def test_a_snapshot_stays_as_it_is():
    env = small()
    run = Branch(env, load_policy("crw")).go_on(70)
    start = run.beside(env, run.obs)
    snapshot = env.snapshot()
    expected = run.go_on(20).seen[-20:]
    for given in (snapshot, snapshot, pickled(snapshot)):
        branch = start.beside(env, env.restore_batch(given))
        assert branch.go_on(20).seen == expected
    assert (snapshot.tick, snapshot.seed) == (70, 17)
    assert isinstance(snapshot, Snapshot)


NOISE = "sensor_noise:sigma=0.1"


@pytest.mark.parametrize("wrappers", [(), (NOISE,)], ids=["bare", "with noise"])
def test_agents_and_what_they_were_shown_come_back(wrappers):
    env, other = small(wrappers=wrappers), small(wrappers=wrappers)
    env.reset(seed=1)
    dead = np.array([False, True, False])
    env.unwrapped.set_population(active=~dead, present=~dead, terminated=dead)
    obs, *_ = env.step({agent: np.ones(3, np.float32) for agent in env.agents})
    snapshot, state = env.snapshot(), env.state()
    env.reset(seed=2)
    for target in (env, other):
        restored = target.restore(snapshot)
        assert target.agents == list(restored) == ["robot_0", "robot_2"]
        for agent, row in restored.items():
            np.testing.assert_array_equal(row, obs[agent])
        np.testing.assert_array_equal(target.state(), state)
        assert (target.unwrapped.tick, target.unwrapped.seed_value) == (1, 1)


def test_a_finished_run_is_finished_after_a_restore_and_can_be_left():
    env = small(max_cycles=3)
    env.reset(seed=1)
    beginning = env.snapshot()
    for _ in range(3):
        env.step({agent: np.ones(3, np.float32) for agent in env.agents})
    end = env.snapshot()
    assert list(env.restore(beginning)) == env.possible_agents
    assert env.restore(end) == {}
    assert env.step({}) == ({}, {}, {}, {}, {})
    env.restore(beginning)
    env.step({agent: np.ones(3, np.float32) for agent in env.agents})
    assert env.tick == 1


@pytest.mark.parametrize("way", [ForageEnv.snapshot, copy.deepcopy, pickle.dumps])
def test_chipmunk_says_what_a_copy_needs(way):
    env = small(physics="chipmunk")
    env.reset(seed=1)
    with pytest.raises(SnapshotError, match="Expected physics='compiled' for a snapshot, copy or pickle"):
        way(env)


@pytest.mark.parametrize(
    ("mine", "others"),
    [
        ({}, {"n_robots": 4}),
        ({}, {"max_cycles": 9}),
        ({}, {"wrappers": [NOISE]}),
        ({"wrappers": [NOISE]}, {}),
        ({"wrappers": [NOISE]}, {"wrappers": ["sensor_noise:sigma=0.2"]}),
    ],
)
def test_snapshots_of_others_are_refused(mine, others):
    env, other = small(**mine), small(**others)
    env.reset(seed=1)
    other.reset(seed=2)
    before = env.state()
    with pytest.raises(SnapshotError, match="scenario, length, reads and wrappers of this one, got another"):
        env.restore(other.snapshot())
    np.testing.assert_array_equal(env.state(), before)
    assert env.unwrapped.seed_value == 1


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
