"""Snapshots and copies of what learners use: dictionaries, one agent for all, agent by agent."""

import copy

import numpy as np
import pytest

from swarm_forage_env import SnapshotError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv, env, parallel_env
from tests.support.branches import pickled

NUMBERED = InterfaceConfig(observation="compact", actions="discrete", decision_ticks=3)
DEATHS = ("population:death_per_tick=0.05", "sensor_noise:sigma=0.05")


def parallel(**options) -> ParallelLearnerEnv:
    made = parallel_env("warehouse_small", n_robots=6, n_objects=20, physics="compiled", wrappers=DEATHS,
                        **{"interface": NUMBERED, **options})  # fmt: skip
    assert isinstance(made, ParallelLearnerEnv)
    return made


def joint(**options) -> JointForageEnv:
    return JointForageEnv(n_robots=6, n_objects=20, physics="compiled", wrappers=DEATHS,
                          **{"interface": NUMBERED, **options})  # fmt: skip


def decisions(target: ParallelLearnerEnv, n: int) -> list:
    """What agents see and earn who choose by their number and the tick."""
    seen = []
    for _ in range(n):
        tick = target.forage_env.tick
        observations, *rest = target.step({agent: (int(agent[-1]) + tick) % 11 for agent in target.agents})
        seen.append(({agent: row.tolist() for agent, row in observations.items()}, repr(rest)))
    return seen


def together(target: JointForageEnv, n: int) -> list:
    """The same, one agent for all."""
    seen = []
    for _ in range(n):
        obs, *rest = target.step((np.arange(6) + target.forage_env.tick) % 11)
        seen.append((obs.tolist(), repr(rest)))
    return seen


@pytest.mark.parametrize(("make", "go_on"), [(parallel, decisions), (joint, together)])
def test_a_learner_goes_on_from_a_snapshot(make, go_on):
    learner = make()
    learner.reset(seed=3)
    go_on(learner, 8)
    snapshot = learner.snapshot()
    twins = [copy.deepcopy(learner), pickled(learner), make()]
    shown = twins[-1].restore(pickled(snapshot))
    expected = go_on(learner, 8)
    for twin in twins:
        assert go_on(twin, 8) == expected
    np.testing.assert_equal(learner.restore(snapshot), shown)
    assert go_on(learner, 8) == expected
    for target in (learner, twins[-1]):
        target.restore(snapshot)
        target.reset()
    assert learner.forage_env.seed_value == twins[-1].forage_env.seed_value


def test_agents_that_are_left_come_back():
    learner = parallel()
    learner.reset(seed=3)
    decisions(learner, 20)
    agents, snapshot = list(learner.agents), learner.snapshot()
    assert 0 < len(agents) < 6
    learner.reset(seed=4)
    assert list(learner.restore(snapshot)) == learner.agents == agents


def test_a_snapshot_brings_the_overridden_scenario_with_it():
    learner, other = joint(), joint()
    learner.reset(seed=3, options={"scenario": {"n_objects": 7}})
    snapshot = learner.snapshot()
    expected = together(learner, 5)
    other.reset(seed=1)
    other.restore(snapshot)
    assert len(other.forage_env.objects.status) == 7
    assert together(other, 5) == expected
    other.reset()
    assert len(other.forage_env.objects.status) == 7
    other.reset(options={"scenario": {}})
    other.restore(snapshot)
    assert together(other, 5) == expected


def test_snapshots_of_others_are_refused():
    learner = joint()
    with pytest.raises(SnapshotError, match=r"LearnerSnapshot, as .* got Snapshot"):
        learner.restore(started(parallel_env("warehouse_small", physics="compiled")).snapshot())
    with pytest.raises(SnapshotError, match=r"ticks=3, .*extra_columns=0\), got one with InterfaceConfig\("):
        learner.restore(started(joint(interface=None)).snapshot())
    with pytest.raises(SnapshotError, match="scenario, length, reads and wrappers of this one"):
        learner.restore(started(joint(max_cycles=9)).snapshot())


def started(target):
    target.reset(seed=1)
    return target


def test_agent_by_agent_is_copied():
    one = env("warehouse_small", n_robots=3, n_objects=5, physics="compiled", wrappers=DEATHS[1:])
    one.reset(seed=1)
    for _ in range(4):
        one.step(np.ones(3, np.float32))
    other = copy.deepcopy(one)
    for _ in range(7):
        assert other.agent_selection == one.agent_selection
        np.testing.assert_array_equal(other.last()[0], one.last()[0])
        one.step(np.ones(3, np.float32))
        other.step(np.ones(3, np.float32))
