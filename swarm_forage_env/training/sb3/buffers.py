"""Buffers in which robots that cannot act do not teach."""

from collections.abc import Generator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer, RolloutBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples, RolloutBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from swarm_forage_env._internal.fields import ConfigError

SAMPLES = ("observations", "actions", "values", "log_probs", "advantages", "returns")
"""Arrays of a rollout that minibatches are taken from."""


class ActiveRolloutBuffer(RolloutBuffer):
    """Rollouts (PPO, A2C) from which only robots at work teach.

    A step whose observation says that the robot is not at work (dead, unborn, in repair) is in no minibatch. An absence
    between two steps at work is a wait without reward: it is bridged as one long transition, so that the step before
    it is credited with the discounted value of the state the robot comes back to, and the value of the absence itself
    is never asked of the network. (At the end of a rollout and at a time limit it is asked once, for robots that are
    away just then.)

    Give it to an algorithm by
    `rollout_buffer_class=ActiveRolloutBuffer, rollout_buffer_kwargs=env.rollout_buffer_kwargs`, with `env` the
    `SwarmVecEnv`. Numbers must reach it as the environment gave them: `VecNormalize(norm_obs=True)` is refused.
    """

    def __init__(self, *args: Any, active_column: int, **kwargs: Any) -> None:
        """Create the buffer; arguments as `RolloutBuffer`, and `active_column`, which is 1 for robots at work, else 0.

        Several observations in one (`VecFrameStack`) count by the newest, which stands last, if it is counted from the
        end: `env.rollout_buffer_kwargs` does so.
        """
        self._active_column = active_column
        super().__init__(*args, **kwargs)

    def at_work(self, observations: np.ndarray) -> np.ndarray:
        """Return which rows of observations (.., columns) are of robots at work, (..) bool."""
        return observations[..., self._active_column] == 1.0

    def compute_returns_and_advantage(self, last_values: torch.Tensor, dones: np.ndarray) -> None:
        """Compute GAE(lambda) advantages and lambda returns, bridging steps of robots that are not at work.

        On such a step the value is by definition what follows from it, r + gamma V', so its error is zero.

        Args:
            last_values: (n_envs,) values after the last step.
            dones: (n_envs,) whether an episode ended with the last step.

        Raises:
            ValueError: the active column holds something else than 0 and 1.
        """
        column = self.observations[..., self._active_column]
        is_active = self.at_work(self.observations)
        if not np.all(is_active | (column == 0.0)):
            raise ValueError(
                "Expected the active column of observations to be 0 or 1, got "
                f"{column.min():.3g} to {column.max():.3g}; do not normalize observations (they are in [-1, 1])."
            )
        next_values = last_values.clone().cpu().numpy().flatten()
        next_continues = 1.0 - dones.astype(np.float32)
        advantage = np.zeros(self.n_envs, np.float32)
        for step in reversed(range(self.buffer_size)):
            target = self.rewards[step] + self.gamma * next_values * next_continues
            self.values[step] = np.where(is_active[step], self.values[step], target)
            # One transition, however long the wait: lambda counts for the step before it alone.
            decay = self.gamma * np.where(is_active[step], self.gae_lambda, 1.0)
            advantage = target - self.values[step] + decay * next_continues * advantage
            self.advantages[step] = advantage
            next_values = self.values[step]
            next_continues = 1.0 - self.episode_starts[step]
        self.returns = self.advantages + self.values
        self._is_active = is_active

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yield minibatches of the steps at work in random order.

        Raises:
            ConfigError: nobody was at work in the whole rollout.
        """
        assert self.full
        if not self._is_active.any():
            raise ConfigError("Expected a robot at work in the rollout, got none to learn from; take more n_steps.")
        if not self.generator_ready:
            taught = self.swap_and_flatten(self._is_active).ravel()
            for name in SAMPLES:
                setattr(self, name, self.swap_and_flatten(getattr(self, name))[taught])
            self.generator_ready = True
        n_samples = len(self.returns)
        order = np.random.permutation(n_samples)  # noqa: NPY002 - the generator that stable-baselines3 seeds
        size = batch_size or n_samples
        for start in range(0, n_samples, size):
            yield self._get_samples(order[start : start + size])


class PresentReplayBuffer(ReplayBuffer):
    """Replay memory (DQN, SAC, TD3) that never samples steps of robots that are not in the world.

    Their observations are rows of zeros, which no robot in the world has. Steps of robots in repair stay: whatever
    they choose is ignored, which off-policy learning may know.

    Give it to an algorithm by `replay_buffer_class=PresentReplayBuffer`.
    """

    def __init__(self, *args: Any, optimize_memory_usage: bool = False, **kwargs: Any) -> None:
        """Create the buffer; arguments as `ReplayBuffer`.

        Raises:
            ValueError: optimize_memory_usage, which keeps no last observations of episodes.
        """
        if optimize_memory_usage:
            raise ValueError("Expected optimize_memory_usage=False: terminal observations have to be kept.")
        super().__init__(*args, **kwargs)
        self._is_present = np.zeros((self.buffer_size, self.n_envs), np.bool_)

    def add(self, obs: np.ndarray, *args: Any, **kwargs: Any) -> None:
        """Store one step of all rows; see `ReplayBuffer.add`."""
        self._is_present[self.pos] = np.any(obs, axis=-1)
        super().add(obs, *args, **kwargs)

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Draw steps uniformly from those of present robots.

        Raises:
            ValueError: none of the stored steps is of a present robot.
        """
        present = self._is_present[: self.size()]
        if not present.any():
            raise ValueError("Expected a stored step of a robot in the world, got none; collect more before learning.")
        drawn = np.zeros((0, 2), np.int64)
        while len(drawn) < batch_size:
            pairs = np.random.randint((len(present), self.n_envs), size=(batch_size, 2))  # noqa: NPY002 - seeded by SB3
            drawn = np.concatenate([drawn, pairs[present[pairs[:, 0], pairs[:, 1]]]])
        steps, rows = drawn[:batch_size].T
        done = self.dones[steps, rows] * (1.0 - self.timeouts[steps, rows])
        obs = self._normalize_obs(self.observations[steps, rows], env)
        next_obs = self._normalize_obs(self.next_observations[steps, rows], env)
        return ReplayBufferSamples(
            self.to_torch(obs),  # type: ignore[arg-type] - a dict only where the space is one
            self.to_torch(self.actions[steps, rows]),
            self.to_torch(next_obs),  # type: ignore[arg-type] - a dict only where the space is one
            self.to_torch(done.reshape(-1, 1)),
            self.to_torch(self._normalize_reward(self.rewards[steps, rows].reshape(-1, 1), env)),
        )
