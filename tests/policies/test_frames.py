"""Frames of their own: robots that see the world turned and mirrored, each in another way, and act accordingly."""

import copy
from itertools import groupby

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.frames import TURNS
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.kernels.frames import N_FRAMES, frame_of
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import plan_arena
from tests.reference import frames
from tests.support.busy import BusyPolicy

N_ROBOTS = 16
VIEWS = [{}, {"observation": "compact", "site_memory": True}]


def busy_world() -> ForageEnv:
    """Robots on their way, some of which carry something."""
    env, policy = ForageEnv(scenario("warehouse_small", n_robots=N_ROBOTS, n_objects=300)), BusyPolicy()
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    obs = env.reset_batch(1)
    for _ in range(100):
        obs, *_ = env.step_batch(policy.act(obs, env.active))
    return env


def interfaces(env: ForageEnv, length: int, **choices) -> tuple[LearnerInterface, LearnerInterface]:
    """Without frames, and with them."""
    plain, own = (InterfaceConfig(frame_decisions=each, **choices) for each in (0, length))
    return LearnerInterface(plain, env.swarm_spec), LearnerInterface(own, env.swarm_spec)


def test_robots_take_all_frames_alike_and_at_different_times():
    taken = np.array([[frame_of(robot, decision, 20) for decision in range(2000)] for robot in range(64)])
    counts = np.bincount(taken.ravel(), minlength=N_FRAMES)
    assert len(TURNS) == len(counts) == N_FRAMES
    assert counts.min() > 0.9 * counts.mean()
    changes = np.flatnonzero(np.diff(taken[0]))
    assert {(change + 1) % 20 for change in changes.tolist()} == {0}
    assert max(len(list(group)) for _, group in groupby(taken[1])) % 20 == 0
    assert len({tuple(row) for row in taken[:, ::20].tolist()}) == 64
    assert len({int(np.flatnonzero(np.diff(row))[0]) for row in taken}) > 10


def test_frames_are_those_of_the_slow_twin():
    for robot in (0, 1, 2, 511):
        for decision in (0, 1, 199, 200, 123_456_789):
            assert frame_of(robot, decision, 200) == frames.frame(robot, decision, 200)


@pytest.mark.parametrize("choices", VIEWS, ids=["full", "compact"])
def test_robots_see_the_world_as_their_slow_twins(choices):
    env = busy_world()
    plain, own = interfaces(env, 3, **choices)
    obs = env.arena.observe()
    for decision in (0, 1, 2, 50, 51):
        expected = frames.seen(plain.observe(obs), own.layout, decision, 3)
        np.testing.assert_array_equal(own.observe(obs, decision=decision), expected)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_robots_act_in_the_world_as_their_slow_twins(actions):
    env = busy_world()
    plain, own = interfaces(env, 5, actions=actions)
    obs = env.arena.observe()
    plain.observe(obs)
    wanted = (
        np.arange(N_ROBOTS) % 11 if actions == "discrete" else np.random.default_rng(1).uniform(-1, 1, (N_ROBOTS, 3))
    )
    for decision in (0, 9, 77):
        own.observe(obs, decision=decision)
        expected = frames.commands(plain.command(wanted, obs), decision, 5)
        np.testing.assert_array_equal(own.command(wanted, obs), expected)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_robots_of_an_arena_see_and_act_as_their_slow_twins(actions):
    world = scenario("warehouse_small", n_robots=6, n_objects=300, physics="compiled")
    choices = {"observation": "compact", "actions": actions, "site_memory": True, "decision_ticks": 2}
    arena = LearnerArena(plan_arena(world, interface={**choices, "frame_decisions": 3}))
    env, rng = ForageEnv(world), np.random.default_rng(0)
    plain = LearnerInterface(InterfaceConfig(**choices), env.swarm_spec)
    for seed in range(8):
        arena.reset(seed)
        obs = env.reset_batch(seed)
        plain.forget()
        for decision in range(5):
            seen = frames.seen(plain.observe(obs), plain.layout, decision, 3)
            np.testing.assert_array_equal(arena.observe(), seen)
            wanted = rng.integers(11, size=6) if actions == "discrete" else rng.uniform(-1, 1, (6, 3))
            arena.step(wanted, np.zeros(6))
            for _ in range(2):
                obs, *_ = env.step_batch(frames.commands(plain.command(wanted, obs), decision, 3))
        np.testing.assert_array_equal(arena.env.last_obs, obs)


def test_a_copy_of_an_arena_has_its_frames():
    plan = plan_arena(
        scenario("warehouse_small", n_robots=6, n_objects=60, physics="compiled"),
        interface={"observation": "compact", "actions": "discrete", "frame_decisions": 3, "decision_ticks": 2},
    )
    arena, rng = LearnerArena(plan), np.random.default_rng(0)
    arena.reset(3)
    arena.observe()

    def go_on() -> list[np.ndarray]:
        seen = []
        for _ in range(8):
            arena.step(rng.integers(6, size=6), np.zeros(6))
            seen.append(arena.observe())
        return seen

    go_on()
    kept, state = copy.deepcopy(arena), rng.bit_generator.state
    first = go_on()
    arena = kept
    rng.bit_generator.state = state
    np.testing.assert_array_equal(go_on(), first)


def test_a_decision_that_the_end_of_a_run_cuts_short_counts():
    assert [InterfaceConfig(decision_ticks=5).decisions_in(ticks) for ticks in (0, 4, 5, 6, 10)] == [0, 1, 1, 2, 2]


def test_each_robot_has_a_row():
    env = busy_world()
    _, own = interfaces(env, 3)
    with pytest.raises(ValueError, match="of 16 robots, each with its row, got 17 rows"):
        own.observe(np.zeros((N_ROBOTS + 1, env.layout.size), np.float32), decision=0)


def test_frames_need_the_number_of_the_decision():
    env = busy_world()
    plain, own = interfaces(env, 3)
    plain.observe(env.arena.observe())
    with pytest.raises(ValueError, match="got none; call observe"):
        own.observe(env.arena.observe())


def test_frames_need_a_length():
    with pytest.raises(ConfigError, match=r"interface\.frame_decisions"):
        InterfaceConfig(frame_decisions=-1)
