"""SwarmPPO: PPO of stable-baselines3 without work on rows where no robot is at work, and without loops over rows."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from swarm_forage_env.contract.types import BoolArray
from swarm_forage_env.training.sb3.buffers import ActiveRolloutBuffer


class SwarmPPO(PPO):
    """PPO with another way to fill its rollouts; it takes the arguments of `PPO` and learns as it does.

    The network is asked for robots at work only, where the buffer is an `ActiveRolloutBuffer`: the actions of others
    are ignored by the environment, and are zeros here. It writes files that `PPO.load` opens, too.
    """

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Fill the buffer; see `OnPolicyAlgorithm.collect_rollouts`."""
        if self.use_sde or not isinstance(rollout_buffer, ActiveRolloutBuffer):
            return super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        dones = np.zeros(env.num_envs, np.bool_)
        for _ in range(n_rollout_steps):
            last_obs = self._last_obs
            assert isinstance(last_obs, np.ndarray), "No previous observation was provided"
            actions, values, log_probs = self._chosen(last_obs, rollout_buffer.at_work(last_obs))
            clipped_actions = self._fitting(actions)  # callbacks may look for it under this name
            new_obs, rewards, dones, infos = env.step(clipped_actions)
            assert isinstance(new_obs, np.ndarray), "the buffer takes single rows"
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            done = np.flatnonzero(dones)
            self._update_info_buffer([infos[row] for row in done], dones[done])
            self._add_values_at_time_limits(rewards, done.tolist(), infos)
            if isinstance(self.action_space, spaces.Discrete):
                actions = actions.reshape(-1, 1)
            rollout_buffer.add(last_obs, actions, rewards, self._last_episode_starts, values, log_probs)  # type: ignore[arg-type] - set with the observations
            self._last_obs, self._last_episode_starts = new_obs, dones
        rollout_buffer.compute_returns_and_advantage(self._values(self._last_obs), dones)  # type: ignore[arg-type] - as above
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def _chosen(self, obs: np.ndarray, asked: BoolArray) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
        """Return actions, values and log probabilities of all rows (R, ..), zeros for those that are not asked."""
        with torch.no_grad():
            if asked.all():
                actions, values, log_probs = self.policy(torch.as_tensor(obs, device=self.device))
                return actions.cpu().numpy(), values, log_probs
            rows = torch.from_numpy(np.flatnonzero(asked))
            chosen = self.policy(torch.as_tensor(obs[asked], device=self.device)) if len(rows) else ()
            shape, dtype = self.action_space.shape or (), torch.float32
            if isinstance(self.action_space, spaces.Discrete):
                dtype = torch.int64
            every = torch.zeros((len(obs), *shape), dtype=dtype), torch.zeros(len(obs), 1), torch.zeros(len(obs))
            for all_rows, some in zip(every, chosen, strict=False):
                all_rows[rows] = some.cpu()
        return every[0].numpy(), every[1], every[2]

    def _fitting(self, actions: np.ndarray) -> np.ndarray:
        """Return actions as the environment takes them."""
        if not isinstance(self.action_space, spaces.Box):
            return actions
        if self.policy.squash_output:
            return self.policy.unscale_action(actions)
        return np.clip(actions, self.action_space.low, self.action_space.high)

    def _values(self, obs: np.ndarray) -> torch.Tensor:
        """Return the values (n, 1) of observations."""
        with torch.no_grad():
            return self.policy.predict_values(torch.as_tensor(obs, device=self.device))

    def _add_values_at_time_limits(
        self, rewards: np.ndarray, done: Sequence[int], infos: Sequence[dict[str, Any]]
    ) -> None:
        """Add to the rewards (R,) of rows that were cut off what would have followed."""
        cut = [row for row in done if infos[row].get("TimeLimit.truncated")]
        if cut:
            values = self._values(np.stack([infos[row]["terminal_observation"] for row in cut]))
            rewards[cut] += self.gamma * values.cpu().numpy().ravel()
