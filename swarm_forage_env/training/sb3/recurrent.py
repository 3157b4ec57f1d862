"""SwarmRecurrentPPO: RecurrentPPO of sb3-contrib for swarms, whose robots come, go and are repaired.

It needs sb3_contrib; the classes that need none are in other files.
"""

from collections.abc import Generator
from typing import Any

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RecurrentRolloutBufferSamples, RNNStates
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import GymEnv
from stable_baselines3.common.vec_env import VecEnv

from swarm_forage_env.contract.types import BoolArray
from swarm_forage_env.training.sb3.buffers import SAMPLES, ActiveRolloutBuffer, EmptyRolloutError
from swarm_forage_env.training.sb3.rollouts import ActiveRollouts, Rows


class ActiveRecurrentBuffer(ActiveRolloutBuffer):
    """Rollouts of a network that remembers; only robots at work teach, as in `ActiveRolloutBuffer`.

    Minibatches consist of sequences. A sequence is what a robot sees from the beginning of the rollout, of an episode
    or of its life to the end of one of these. It begins with what the robot remembers then. A robot in repair goes on
    remembering, but does not teach. Sequences without a step at work are in no minibatch.

    Attributes:
        memories: What robots remembered before the first step of the rollout, each (layers, rows, cells).
    """

    memories: RNNStates

    def to_ask(self, observations: np.ndarray) -> np.ndarray:
        """Return for which rows of observations (.., columns) a network is asked: robots in repair remember, too."""
        return self.present(observations)

    def get(self, batch_size: int | None = None) -> Generator[RecurrentRolloutBufferSamples, None, None]:  # type: ignore[override] - samples with memories
        """Yield minibatches of whole sequences in random order.

        Args:
            batch_size: Least number of steps that teach in a minibatch; None = all. A rest of up to half of it is added
                to the minibatch before, because the deviation of advantages needs two steps.

        Raises:
            EmptyRolloutError: fewer than two steps of robots at work in the whole rollout.
        """
        assert self.full
        n_samples = int(self._is_active.sum())
        if n_samples < 2:
            raise EmptyRolloutError(
                f"Expected two steps of robots at work in the rollout, got {n_samples} to learn from; "
                "take more n_steps."
            )
        if not self.generator_ready:
            self._cut()
            self.generator_ready = True
        order = np.random.permutation(len(self._first))  # noqa: NPY002 - the generator that stable-baselines3 seeds
        start = 0
        for end in batch_ends(self._n_taught[order], max(2, batch_size or n_samples)):
            yield self._minibatch(order[start:end])
            start = end

    def _cut(self) -> None:
        """Find the sequences: where each begins among the steps of all rows, row by row, and how long it is."""
        present = self.present(self.observations)
        begins = present & (self.episode_starts == 1.0)
        begins[0] |= present[0]
        begins[1:] |= present[1:] & ~present[:-1]
        ends = present.copy()
        ends[:-1] &= ~present[1:] | begins[1:]
        first, last = (np.flatnonzero(self.swap_and_flatten(each)) for each in (begins, ends))
        self._teaches = self.swap_and_flatten(self._is_active).ravel()
        taught = np.append(0, np.cumsum(self._teaches))
        n_taught = taught[last + 1] - taught[first]
        used = n_taught > 0
        self._first, self._n_taught, self._length = first[used], n_taught[used], (last - first + 1)[used]
        step, self._row = self._first % self.buffer_size, self._first // self.buffer_size
        self._remembers = (step == 0) & (self.episode_starts[step, self._row] == 0.0)
        self._numbers = {name: self.swap_and_flatten(getattr(self, name)) for name in SAMPLES}
        self.values, self.returns = (self._numbers[name][self._teaches] for name in ("values", "returns"))

    def _minibatch(self, chosen: np.ndarray) -> RecurrentRolloutBufferSamples:
        """Return sequences side by side, (sequences x longest, ..), zeros behind the shorter ones."""
        steps = np.arange(self._length[chosen].max())
        is_step = (steps < self._length[chosen, None]).ravel()
        places = np.where(is_step, (self._first[chosen, None] + steps).ravel(), 0)

        def padded(name: str) -> torch.Tensor:
            numbers = self._numbers[name][places]
            numbers[~is_step] = 0.0
            return self.to_torch(numbers)

        def begun(memories: tuple[torch.Tensor, ...]) -> tuple[torch.Tensor, ...]:
            rows, remembers = torch.from_numpy(self._row[chosen]), torch.from_numpy(self._remembers[chosen])
            return tuple(memory[:, rows] * remembers.to(memory)[:, None] for memory in memories)

        return RecurrentRolloutBufferSamples(
            observations=padded("observations"),
            actions=padded("actions"),
            old_values=padded("values").flatten(),
            old_log_prob=padded("log_probs").flatten(),
            advantages=padded("advantages").flatten(),
            returns=padded("returns").flatten(),
            lstm_states=RNNStates(begun(self.memories.pi), begun(self.memories.vf)),
            # No episode starts within a sequence; where one starts at its beginning, the memory says so.
            episode_starts=torch.zeros(len(places), device=self.device),
            mask=self.to_torch((is_step & self._teaches[places]).astype(np.float32)),
        )


def batch_ends(sizes: np.ndarray, least: int) -> list[int]:
    """Return where minibatches of sequences in this order end, (batches,).

    Args:
        sizes: (sequences,) steps that teach.
        least: How many a minibatch has at least. A rest of up to half of it belongs to the last one.
    """
    ends: list[int] = []
    filled = 0
    for k, size in enumerate(sizes.tolist(), 1):
        filled += size
        if filled >= least:
            ends.append(k)
            filled = 0
    if not ends or 2 * filled > least:
        return [*ends, len(sizes)]
    return [*ends[:-1], len(sizes)]


class SwarmRecurrentPPO(ActiveRollouts, RecurrentPPO):
    """RecurrentPPO that learns from robots at work only, and whose robots remember as in runs.

    A robot in repair goes on remembering. One that is not in the world is not asked, and forgets. It writes files that
    run as policies, as those of `RecurrentPPO`.
    """

    policy: RecurrentActorCriticPolicy  # type: ignore[assignment] - as the library has it

    def __init__(
        self,
        policy: str | type[RecurrentActorCriticPolicy],
        env: GymEnv | str,
        *,
        rollout_buffer_kwargs: dict[str, Any] | None = None,
        use_sde: bool = False,
        _init_setup_model: bool = True,
        **options: Any,
    ) -> None:
        """Make the model.

        Args:
            policy: "MlpLstmPolicy", or a class of such policies.
            env: Vector environment of robots.
            rollout_buffer_kwargs: Arguments of `ActiveRolloutBuffer` about observations
                (`SwarmVecEnv.rollout_buffer_kwargs`).
            use_sde: False; noise that depends on the state is one of all rows, and robots come and go.
            options: Other arguments of `RecurrentPPO`.

        Raises:
            ValueError: use_sde.
        """
        if use_sde:
            raise ValueError("Expected use_sde=False with an LSTM; draw actions without it.")
        super().__init__(policy, env, _init_setup_model=False, **options)
        self.rollout_buffer_kwargs = rollout_buffer_kwargs or {}
        if _init_setup_model:
            self._setup_model()

    def _setup_model(self) -> None:
        super()._setup_model()
        self.rollout_buffer = ActiveRecurrentBuffer(
            self.n_steps,
            self.observation_space,
            self.action_space,
            self.device,
            gamma=self.gamma,
            gae_lambda=self.gae_lambda,
            n_envs=self.n_envs,
            **self.rollout_buffer_kwargs,
        )

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Fill the buffer; see `OnPolicyAlgorithm.collect_rollouts`."""
        assert isinstance(rollout_buffer, ActiveRecurrentBuffer)
        actor, critic = ((hidden.clone(), cells.clone()) for hidden, cells in self._memories)
        rollout_buffer.memories = RNNStates(actor, critic)
        return super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)

    @property
    def _memories(self) -> RNNStates:
        """What robots remember, (layers, rows, cells) each."""
        assert self._last_lstm_states is not None, "made with the model"
        return self._last_lstm_states

    def _chosen(self, obs: np.ndarray, asked: BoolArray) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
        """Do what `ActiveRollouts` does; who is not in the world, and who begins an episode, remembers nothing."""
        forgets = torch.from_numpy(~asked | np.asarray(self._last_episode_starts, np.bool_))
        for memory in (*self._memories.pi, *self._memories.vf):
            memory[:, forgets] = 0.0
        return super()._chosen(obs, asked)

    def _answers(self, obs: torch.Tensor, rows: Rows) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Ask the network, and keep what the rows remember of it."""
        before = self._memories
        some = RNNStates(*(tuple(memory[:, rows] for memory in memories) for memories in before))
        actions, values, log_probs, after = self.policy(obs, some, torch.zeros(len(obs), device=self.device))
        for memory, new in zip((*before.pi, *before.vf), (*after.pi, *after.vf), strict=True):
            memory[:, rows] = new
        return actions, values, log_probs

    def _values(self, obs: np.ndarray, rows: Rows) -> torch.Tensor:
        """Return the values (n, 1) of observations that rows see next."""
        hidden, cells = (memory[:, rows] for memory in self._memories.vf)
        with torch.no_grad():
            seen, no_start = torch.as_tensor(obs, device=self.device), torch.zeros(len(obs), device=self.device)
            return self.policy.predict_values(seen, (hidden, cells), no_start)
