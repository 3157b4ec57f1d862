"""check_env, check_policy, check_determinism: correct subjects pass, and each fault is noticed."""

import numpy as np
import pytest
from pettingzoo.utils import BaseParallelWrapper

from swarm_forage_env import CheckError, World, check_determinism, check_env, check_policy
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import POLICIES
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv
from swarm_forage_env.wrappers.base import SwarmWrapper
from tests.support.crowded_runs import BusyPolicy

SMALL = scenario("warehouse_small", n_robots=5, n_objects=80)


# Environments


def test_views_for_learners_pass():
    """Wrapped stacks do so in tests/promises/test_random_worlds.py."""
    check_env(ParallelLearnerEnv(SMALL, interface={"observation": "compact", "actions": "discrete"}), ticks=20)


class BeyondTheSpace(BaseParallelWrapper):
    def step(self, actions):
        obs, *rest = super().step(actions)
        return {agent: 2.0 * row for agent, row in obs.items()}, *rest


class RewardsNobody(BaseParallelWrapper):
    def step(self, actions):
        obs, _, *rest = super().step(actions)
        return obs, {}, *rest


class Unseeded(SwarmWrapper):
    """Draws from a generator of its own."""

    stack_position = 1
    rng = np.random.default_rng(0)

    def observe(self, obs):
        obs[:, 0] = self.rng.random(len(obs))
        return obs


class DictsOnly(SwarmWrapper):
    """Changes what `step` returns and forgets `step_batch`."""

    stack_position = 1

    def step(self, actions):
        obs, rewards, *rest = super().step(actions)
        return obs, {agent: reward - 0.5 for agent, reward in rewards.items()}, *rest


class SometimesFour(ForageEnv):
    """Leaves one robot out after every other reset."""

    resets = 0

    def reset(self, seed=None, options=None):
        obs, infos = super().reset(seed, options)
        self.resets += 1
        if seed == 1 and self.resets % 2:
            self.agents = self.agents[1:]
            del obs["robot_0"], infos["robot_0"]
        return obs, infos


class Impatient(ForageEnv):
    """Ends earlier after every reset."""

    def reset_batch(self, seed=None):
        self.max_cycles -= 1
        return super().reset_batch(seed)


class BadState(ForageEnv):
    def state(self):
        return super().state() + 2.0


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (lambda: BeyondTheSpace(ForageEnv(SMALL)), r"Expected the observation of robot_0 in its space .* at tick 1"),
        (lambda: RewardsNobody(ForageEnv(SMALL)), "parallel_api_test, got: Live agent was not given reward"),
        (lambda: Unseeded(ForageEnv(SMALL)), "equal seeds and actions to give equal runs, got another observation"),
        (lambda: DictsOnly(ForageEnv(SMALL)), "Expected step_batch to give what step gives, got another reward"),
        (lambda: SometimesFour(SMALL), r"give equal runs, got other agents at tick 0: \['robot_0'\]"),
        (lambda: Impatient(SMALL, max_cycles=20), "give equal runs, got another truncation of robot_0 at tick 18"),
        (lambda: BadState(SMALL), r"Expected state\(\) in state_space"),
        (lambda: "warehouse_small", "Expected a parallel environment of PettingZoo, got 'warehouse_small'"),
    ],
    ids=["space", "reward", "seeds", "batch", "agents", "horizon", "state", "text"],
)
def test_each_fault_of_an_environment_is_found(make, fault):
    with pytest.raises(CheckError, match=fault):
        check_env(make())


# Policies


@pytest.mark.parametrize("name", sorted({*POLICIES} - {"oracle"}))
def test_shipped_policies_pass(name):
    check_policy(name, scenario("warehouse_small", n_robots=20, n_objects=300))
    check_determinism(name, scenario("warehouse_small", n_robots=20, n_objects=300), seeds=[3], seconds=30.0)


def drive(obs):
    return np.full((len(obs), 3), 0.5, np.float32)


def test_policies_may_be_classes_objects_and_functions():
    for given in (BusyPolicy, BusyPolicy(), drive):
        check_policy(given, SMALL)
    check_determinism(drive, World(SMALL, ("sensor_noise:sigma=0.1",)), seconds=10.0)
    check_policy(BusyPolicy, scenario("warehouse_small", n_robots=1))


class Sound:
    """Base of the faulty policies: all robots stand still."""

    def reset(self, task, rng):
        self.n_robots, self.layout, self.rng = task.n_robots, task.layout, rng

    def act(self, obs, active):
        return np.zeros((len(obs), 3), np.float32)


class NoAct:
    def reset(self, task, rng):
        pass


def still(obs):
    return np.zeros((len(obs), 3), np.float32)


def not_a_number(self, obs, active):
    actions = still(obs)
    actions[2, 1] = np.nan
    return actions


def writes_into_observations(self, obs, active):
    obs[:, 0] = 0.25
    return still(obs)


def writes_into_active(self, obs, active):
    active[0] = False
    return still(obs)


@pytest.mark.parametrize(
    ("act", "fault"),
    [
        (
            lambda self, obs, active: still(obs) * np.float32(np.flatnonzero(active)[0]),
            "got IndexError at tick 75, with 0",
        ),
        (
            lambda self, obs, active: still(obs)[active],
            r"got float32 of shape \(3, 3\) .*at tick 37; return one row per",
        ),
        (lambda self, obs, active: still(obs).tolist(), "got list at tick 0; return one row"),
        (lambda self, obs, active: still(obs).astype(np.float64), "got float64 of shape .* at tick 0"),
        (lambda self, obs, active: still(obs) + np.float32(1.5), r"in \[-1, 1\], got \[1.5, 1.5, 1.5\] for robot 0"),
        (not_a_number, r"got \[0.0, nan, 0.0\] for robot 2"),
        (writes_into_observations, "leave obs and active as they are"),
        (writes_into_active, "leave obs and active as they are"),
    ],
)
def test_each_fault_of_an_act_is_found(act, fault):
    with pytest.raises(CheckError, match=fault):
        check_policy(type("Faulty", (Sound,), {"act": act}), SMALL)


class UnknownSlice(Sound):
    reads = ("proximty",)


class ReadsMore(Sound):
    """Looks at a slice that is often zero anyway."""

    reads = ("proximity",)

    def act(self, obs, active):
        actions = super().act(obs, active)
        actions[:, 0] = (obs[:, self.layout["event_cache"]] != 0.0).any(axis=1)
        return actions


class Remembers(Sound):
    """Does not forget the last run."""

    ticks = 0

    def act(self, obs, active):
        self.ticks += 1
        return super().act(obs, active) + np.float32(min(1.0, self.ticks / 1000))


class RandomNumbersOfItsOwn(Sound):
    own = np.random.default_rng(0)

    def act(self, obs, active):
        return self.own.uniform(-1.0, 1.0, (len(obs), 3)).astype(np.float32)


class KeepsAReference(Sound):
    def reset(self, task, rng):
        super().reset(task, rng)
        self.before = None

    def act(self, obs, active):
        actions = super().act(obs, active)
        if self.before is not None:
            actions[:, 0] = (obs != self.before).any(axis=1)
        actions[:, 1] = 0.5
        self.before = obs
        return actions


class AwayAreNotNumbers(Sound):
    """Whoever comes back in the tick would end the run."""

    def act(self, obs, active):
        return np.where(active[:, None], super().act(obs, active), np.float32(np.nan))


class FollowsTheAway(Sound):
    def act(self, obs, active):
        return super().act(obs, active) + obs[:, self.layout["heading"]][:, :1].mean()


class OneSize(Sound):
    def reset(self, task, rng):
        if task.n_robots != 5:
            raise ValueError("I steer five robots")
        super().reset(task, rng)


class UnknownTask(Sound):
    def reset(self, task, rng):
        super().reset(task, rng)
        self.task = np.full(task.n_robots, len(Task), np.int8)


@pytest.mark.parametrize(
    ("policy", "fault"),
    [
        (NoAct, "got one without act"),
        (UnknownSlice, "got 'proximty'. Did you mean 'proximity'"),
        (ReadsMore, r"not in reads = \('proximity',\) hold other numbers, got other actions at tick 0"),
        (Remembers, "Expected reset to begin a new run, got other actions at tick 0"),
        (RandomNumbersOfItsOwn, "Expected reset to begin a new run"),
        (KeepsAReference, "keeps no reference to the observation array, got other actions at tick 1"),
        (AwayAreNotNumbers, r"got \[nan, nan, nan\] for robot 1 at tick 37, which is away, but may come back in this"),
        (FollowsTheAway, "when the observations of robots that are away are others, got other actions at tick 37"),
        (OneSize, "a swarm of 2 robots, got ValueError: I steer five robots"),
        (UnknownTask, r"codes of Task \(0 to 7\), got codes \[8\]"),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
def test_each_fault_of_a_policy_is_found(policy, fault):
    with pytest.raises(CheckError, match=fault):
        check_policy(policy, SMALL)


# Determinism


def test_runs_that_share_random_numbers_are_found():
    with pytest.raises(CheckError, match="two runs with seed 4 to be equal, got another position of the robots"):
        check_determinism(RandomNumbersOfItsOwn, SMALL, seeds=[4], seconds=10.0)


def test_a_difference_in_the_record_alone_is_found():
    class Tasked(Sound):
        """Counts its runs, and tells other tasks in each of them."""

        runs = 0

        def reset(self, task, rng):
            super().reset(task, rng)
            type(self).runs += 1
            self.task = np.full(task.n_robots, type(self).runs % len(Task), np.int8)

    with pytest.raises(CheckError, match="got another task_share_generalist"):
        check_determinism(Tasked, SMALL, seeds=[0], seconds=10.0)
