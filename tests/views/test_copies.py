"""Copies of what learners use: dictionaries, one agent for all, agent by agent."""

import copy

import numpy as np
import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import scenario
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
def test_a_copy_of_a_learners_environment_goes_on_as_the_original(make, go_on):
    learner = make()
    learner.reset(seed=3, options={"scenario": {"n_objects": 7}})
    go_on(learner, 20)
    twins = [copy.deepcopy(learner), pickled(learner)]
    for _ in range(2):
        expected = go_on(learner, 8)
        for twin in twins:
            assert go_on(twin, 8) == expected
        for one in (learner, *twins):
            one.reset()
    assert {one.forage_env.seed_value for one in twins} == {learner.forage_env.seed_value}


@pytest.mark.parametrize("make", [joint, parallel, lambda: ForageEnv(scenario("classroom", n_robots=2))])
def test_copies_before_the_first_reset_draw_worlds_of_their_own(make):
    original = make()
    twins = original, copy.deepcopy(original), pickled(original)
    for twin in twins:
        twin.reset()
    assert len({getattr(twin, "forage_env", twin).state().tobytes() for twin in twins}) == 3


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
