"""Snapshots, copies and pickles of an environment: the run goes on from them bit for bit."""

import copy
import pickle

import numpy as np
import pytest

from swarm_forage_env import Snapshot, SnapshotError, parallel_env, scenario
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from tests.support.branches import Branch, pickled


def small(**options) -> ForageEnv:
    return parallel_env("warehouse_small", **{"n_robots": 3, "n_objects": 9, "physics": "compiled", **options})


def test_a_heap_of_robots_goes_on_from_a_snapshot():
    """All push into one corner, so that what an engine remembers of contacts matters."""
    world = scenario("warehouse_small", n_robots=60, width_m=8.0, height_m=8.0, nest_centre_m=(2.0, 4.0),
                     nest_size_m=(1.0, 2.0), n_objects=5, physics="compiled")  # fmt: skip
    env = ForageEnv(world)
    env.reset_batch(3)
    swarm = env.swarm

    def towards_the_corner(target: ForageEnv, ticks: int) -> bytes:
        seen = b""
        for _ in range(ticks):
            position, heading = target.swarm.position, target.swarm.heading
            turn = np.sin(np.arctan2(-position[:, 1], -position[:, 0]) - heading) * 0.5
            actions = np.column_stack((0.5 - turn, 0.5 + turn, np.zeros(60))).astype(np.float32)
            target.step_batch(actions)
            seen += target.swarm.position.tobytes() + target.swarm.heading.tobytes()
        return seen

    towards_the_corner(env, 400)
    distance = np.hypot(*(swarm.position[:, None] - swarm.position[None]).T) + np.eye(60)
    assert (distance < 2.01 * world.robots.radius_m).sum() > 60, "they touch"
    snapshot, other = env.snapshot(), ForageEnv(world)
    expected = towards_the_corner(env, 60)
    other.restore(snapshot)
    assert towards_the_corner(other, 60) == expected
    env.restore(snapshot)
    assert towards_the_corner(env, 60) == expected


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


def test_agents_and_observations_come_back():
    env = small()
    env.reset(seed=1)
    dead = np.array([False, True, False])
    env.set_population(active=~dead, present=~dead, terminated=dead)
    obs, *_ = env.step({agent: np.ones(3, np.float32) for agent in env.agents})
    snapshot, state = env.snapshot(), env.state()
    env.reset(seed=2)
    other = small()
    for target in (env, other):
        restored = target.restore(snapshot)
        assert target.agents == list(restored) == ["robot_0", "robot_2"]
        for agent, row in restored.items():
            np.testing.assert_array_equal(row, obs[agent])
        np.testing.assert_array_equal(target.state(), state)
        assert (target.tick, target.seed_value) == (1, 1)


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
    "options", [{"n_robots": 4}, {"max_cycles": 9}, {"wrappers": ["throttle:waveform=constant,amplitude=0.1"]}]
)
def test_snapshots_of_others_are_refused(options):
    env, other = small(), small(**options)
    env.reset(seed=1)
    other.reset(seed=2)
    before = env.state()
    with pytest.raises(SnapshotError, match="scenario, length, reads and wrappers of this one, got another"):
        env.restore(other.snapshot())
    np.testing.assert_array_equal(env.state(), before)
    assert env.seed_value == 1
