"""Frames of their own: robots that see the world turned and mirrored, each in another way, and act accordingly."""

from itertools import groupby

import numpy as np
import pytest

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.frames import TURNS
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.kernels.frames import N_FRAMES, frame_of
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import plan_arena
from tests.reference import frames


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


def test_frames_need_a_row_for_each_robot_and_the_number_of_the_decision():
    spec = SwarmSpec.of(scenario("warehouse_small", n_robots=6))
    own = LearnerInterface(InterfaceConfig(frame_decisions=3), spec)
    rows = np.zeros((7, spec.layout.size), np.float32)
    with pytest.raises(ValueError, match="of 6 robots, each with its row, got 7 rows"):
        own.observe(rows, decision=0)
    with pytest.raises(ValueError, match="got none; call observe"):
        own.observe(rows[:6])


def test_a_decision_that_the_end_of_a_run_cuts_short_counts():
    assert [InterfaceConfig(decision_ticks=5).decisions_in(ticks) for ticks in (0, 4, 5, 6, 10)] == [0, 1, 1, 2, 2]
