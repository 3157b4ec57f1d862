"""Buffers leave out robots that are not at work: checked against returns worked out by hand."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecFrameStack

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, PresentReplayBuffer, SwarmVecEnv
from tests.support import lives

VALUE = 4.0
"""What the network of these tests thinks of every state."""
GAMMA = 0.5
RETURNS = {
    # lambda = 1: discounted rewards to the end of the episode, plus gamma VALUE where it was cut off.
    1.0: [
        [2.0625, 1.5, 1.3125],
        [2.125, 1.0, 0.625],
        [2.25, 0.0, np.nan],
        [2.5, np.nan, np.nan],
        [3.0, np.nan, 3.0],
        [3.0, 3.0, 3.0],
    ],
    # lambda = 0: reward plus gamma times the next value. Robot 2 waits from tick 3 on and is next judged before tick
    # 5, so that what follows tick 2 is worth gamma (0 + gamma (1 + gamma VALUE)) = 0.75.
    0.0: [
        [3.0, 3.0, 3.0],
        [3.0, 3.0, 0.75],
        [3.0, 0.0, np.nan],
        [3.0, np.nan, np.nan],
        [3.0, np.nan, 3.0],
        [3.0, 3.0, 3.0],
    ],
}
"""lambda -> return per tick and robot of the story in `lives`; nan = does not teach."""


class _Story(BaseCallback):
    """Changes the population between the steps of a rollout."""

    def _on_rollout_start(self) -> None:
        self._change(0)

    def _on_step(self) -> bool:
        self._change(self.n_calls)
        return True

    def _change(self, done: int) -> None:
        if done in lives.CHANGES:
            self.training_env.env_method("set_population", **lives.CHANGES[done])


def constant_value_ppo(env: SwarmVecEnv, gae_lambda: float) -> PPO:
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=lives.N_TICKS,
        batch_size=6,
        gamma=GAMMA,
        gae_lambda=gae_lambda,
        policy_kwargs={"net_arch": [4]},
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        seed=0,
        device="cpu",
    )
    with torch.no_grad():
        model.policy.value_net.weight.zero_()
        model.policy.value_net.bias.fill_(VALUE)
    return model


@pytest.mark.parametrize("gae_lambda", sorted(RETURNS))
def test_a_rollout_of_ppo_with_a_death_a_repair_and_a_time_limit_by_hand(gae_lambda):
    env = SwarmVecEnv(**lives.WORLD, interface=InterfaceConfig(observation="compact"))
    model = constant_value_ppo(env, gae_lambda)
    _, callback = model._setup_learn(lives.N_TICKS * lives.N_ROBOTS, _Story())
    model.collect_rollouts(env, callback, model.rollout_buffer, lives.N_TICKS)
    expected = np.array(RETURNS[gae_lambda])
    taught = lives.ACTIVE_BEFORE
    np.testing.assert_array_equal(np.isnan(expected), ~taught)
    np.testing.assert_allclose(model.rollout_buffer.returns[taught], expected[taught], rtol=1e-6)
    batches = list(model.rollout_buffer.get(4))
    assert [len(batch.returns) for batch in batches] == [4, 4, 4, 2]
    drawn = torch.cat([batch.returns for batch in batches]).numpy()
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected[taught]), rtol=1e-6)
    seen = torch.cat([batch.observations for batch in batches]).numpy()
    assert np.all(seen[:, env.active_column] == 1.0)
    assert len(next(model.rollout_buffer.get()).returns) == 14


def test_normalized_observations_are_refused():
    buffer = ActiveRolloutBuffer(1, spaces.Box(-9, 9, (2,)), spaces.Box(-1, 1, (1,)), active_column=1)
    one = torch.ones(1)
    buffer.add(np.array([[0.0, 1.3]]), np.zeros((1, 1)), np.zeros(1), np.ones(1), one, one)
    with pytest.raises(ValueError, match="do not normalize"):
        buffer.compute_returns_and_advantage(one, np.zeros(1))


def filled_replay(present: list[list[bool]]) -> PresentReplayBuffer:
    """A memory whose observations count steps and rows from 1, zeros where nobody is present."""
    shape = np.shape(present)
    buffer = PresentReplayBuffer(shape[0] * shape[1], spaces.Box(-1, 99, (2,)), spaces.Discrete(3), n_envs=shape[1])
    for step, row in enumerate(present):
        obs = np.array([[step + 1, robot + 1] if there else [0, 0] for robot, there in enumerate(row)], np.float32)
        done = np.full(shape[1], step == 1)
        infos = [{"TimeLimit.truncated": step == 1 and robot == 0} for robot in range(shape[1])]
        buffer.add(obs, obs + 0.5, np.zeros(shape[1], np.int64), np.full(shape[1], float(step)), done, infos)
    return buffer


def test_replay_draws_every_present_step_and_no_other():
    present = [[True, False, True], [True, True, False], [False, False, True]]
    samples = filled_replay(present).sample(400)
    drawn = {tuple(pair) for pair in samples.observations.numpy().astype(int).tolist()}
    assert drawn == {(1, 1), (1, 3), (2, 1), (2, 2), (3, 3)}
    steps, robots = samples.observations.numpy().astype(int).T - 1
    np.testing.assert_array_equal(samples.rewards.numpy().ravel(), steps)
    np.testing.assert_array_equal(samples.next_observations.numpy(), samples.observations.numpy() + 0.5)
    # Step 1 ends episodes: by time for robot 0, which is bootstrapped, by death for the others.
    np.testing.assert_array_equal(samples.dones.numpy().ravel(), (steps == 1) & (robots != 0))


def test_a_wait_is_one_transition_for_lambda_too():
    # One robot, at work in steps 0 and 3 and away between; values 4, rewards 1 at work, gamma = lambda = 1/2.
    buffer = ActiveRolloutBuffer(
        4, spaces.Box(0, 1, (1,)), spaces.Box(-1, 1, (1,)), gamma=0.5, gae_lambda=0.5, active_column=0
    )
    for active in (1.0, 0.0, 0.0, 1.0):
        there, value = np.full(1, active), torch.full((1,), VALUE)
        buffer.add(there[None], np.zeros((1, 1)), there, np.zeros(1), value, torch.zeros(1))
    buffer.compute_returns_and_advantage(torch.full((1,), VALUE), np.zeros(1))
    # Step 3: 1 + 4/2 - 4 = -1. Step 0: 1 + 4/8 - 4 = -2.5, and lambda gamma^3 = 1/16 of the -1 after the wait.
    np.testing.assert_allclose(buffer.advantages[[0, 3], 0], [-2.5625, -1.0])


def test_behind_stacked_frames_the_newest_one_counts():
    """Robot 1 is in repair in the ticks 2 and 3; an older frame would show it at work, or not, too late."""
    env = SwarmVecEnv(**lives.WORLD, interface=InterfaceConfig(observation="compact"))
    stacked = VecFrameStack(env, 3)
    model = PPO(
        "MlpPolicy",
        stacked,
        n_steps=lives.N_TICKS,
        batch_size=6,
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        device="cpu",
    )
    _, callback = model._setup_learn(lives.N_TICKS * lives.N_ROBOTS, _Story())
    model.collect_rollouts(stacked, callback, model.rollout_buffer, lives.N_TICKS)
    assert len(next(model.rollout_buffer.get()).returns) == lives.ACTIVE_BEFORE.sum()
    np.testing.assert_array_equal(model.rollout_buffer._is_active, lives.ACTIVE_BEFORE)
