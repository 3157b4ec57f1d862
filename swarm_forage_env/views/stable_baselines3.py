"""SwarmVecEnv: robots times arenas as the sub-environments of one stable-baselines3 vector environment."""

import time
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from swarm_forage_env.contract.types import BoolArray
from swarm_forage_env.views.arenas import ArenaStep, open_arenas
from swarm_forage_env.views.plans import constructor_takes


class SwarmVecEnv(VecEnv):
    """Every robot of every arena as a sub-environment that one shared policy acts in.

    Sub-environment `a * N + i` is robot i of arena a. It passes arrays on and makes no per-agent dicts. `views.arenas`
    describes how rows end, stay absent and start anew. With a sampler an arena has as many rows as the largest world
    has robots; those to spare in a run are absent all through. In terms of stable-baselines3:

    * `dones` is true when the observation returned is the first of a new episode, and when a robot dies.
    * `infos[row]["terminal_observation"]` is there whenever `dones[row]` is true; `"TimeLimit.truncated"` is true if
      the robot could have gone on. Only then the value of the terminal observation is bootstrapped.
    * `infos[row]["episode"]` (return "r", steps "l", seconds since creation "t") is there when an episode ended, also
      by death; no `VecMonitor` is needed, and one would count absent rows as episodes.
    * `infos[row]["run"]`, on the first row of an arena that ended: seed, simulated seconds, collected, first_picked,
      and of which world: scenario (its name), n_robots.
    * Learners must leave out robots that are absent or in repair: build the algorithm with `ActiveRolloutBuffer`
      (on-policy) or `PresentReplayBuffer` (off-policy).

    Attributes:
        n_arenas, n_robots: num_envs = n_arenas * n_robots; with a sampler, n_robots is that of its largest world.
        interface: What a learner sees and does.
        active: (num_envs,) bool, robots at work in the last observation.
    """

    @constructor_takes(open_arenas)
    def __init__(self, *args: Any, **options: Any) -> None:
        """Create the environment."""
        self._arenas = open_arenas(*args, **options)
        self.n_arenas, self.n_robots = self._arenas.n_arenas, self._arenas.n_robots
        self.interface = self._arenas.interface
        self._started = time.perf_counter()
        self._actions: np.ndarray | None = None
        super().__init__(self._arenas.n_rows, self.interface.observation_space, self.interface.action_space)
        self.active: BoolArray = np.zeros(self.num_envs, np.bool_)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seeds of the next reset: arena a runs seed + a, and later runs follow the arena's own sequence.

        As with every vector environment of that library, seeds nearer to each other than `n_arenas` share runs.

        Returns:
            One seed per row, that of its arena.
        """
        if seed is None:
            seed = int(np.random.default_rng().integers(2**31))
        self._seeds = [seed + row // self.n_robots for row in range(self.num_envs)]
        return self._seeds

    def reset(self) -> VecEnvObs:
        """Start a run in every arena; returns observations (num_envs, d).

        Options that were set by `set_options` are taken from the first row of each arena; see `LearnerArena.reset`.
        """
        first_rows = range(0, self.num_envs, self.n_robots)
        obs, self.active = self._arenas.reset(
            [self._seeds[row] for row in first_rows], [self._options[row] for row in first_rows]
        )
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return obs

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions, (num_envs,) or (num_envs, k), for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step every arena by one decision; returns observations, rewards, dones and infos, all new."""
        assert self._actions is not None, "step_async comes before step_wait"
        step = self._arenas.step(self._actions)
        self.active = step.active
        return step.obs, step.rewards, step.terminated | step.truncated, self._infos(step)

    def _infos(self, step: ArenaStep) -> list[dict[str, Any]]:
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if len(step.ended):
            seconds = round(time.perf_counter() - self._started, 6)
            for k, row in enumerate(step.ended.tolist()):
                info = infos[row]
                info["terminal_observation"] = step.final_obs[k]
                info["TimeLimit.truncated"] = bool(step.truncated[row])
                if step.is_episode[k]:
                    info["episode"] = {"r": float(step.returns[k]), "l": int(step.lengths[k]), "t": seconds}
            for arena, outcome in step.outcomes.items():
                infos[arena * self.n_robots]["run"] = outcome
        return infos

    @property
    def rollout_buffer_kwargs(self) -> dict[str, Any]:
        """Arguments of `ActiveRolloutBuffer`; the column is counted from the end, see there."""
        return {"active_column": self.interface.active_column - self.interface.layout.size}

    def action_masks(self) -> BoolArray:
        """Return which discrete actions make sense now, (num_envs, number of actions); see `LearnerInterface.mask`."""
        return self._arenas.action_masks()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return one picture per arena."""
        return self._arenas.render()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the environment that each row is a part of, one value per row."""
        envs = self._arenas.envs
        if attr_name == "action_masks":  # the name under which algorithms with masks look for them
            if self.interface.config.actions != "discrete":
                raise AttributeError("Continuous actions have no masks.")
            return [self.action_masks for _ in self._get_indices(indices)]
        return [getattr(envs[row // self.n_robots], attr_name) for row in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the outermost wrappers, or environments, that the rows are parts of."""
        for arena in {row // self.n_robots for row in self._get_indices(indices)}:
            setattr(self._arenas.envs[arena], attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the environments, once per arena; returns its arena's result for each row.

        `action_masks` is answered row by row, as algorithms with masks expect.
        """
        rows = [*self._get_indices(indices)]
        if method_name == "action_masks":
            return list(self.action_masks()[rows])
        arenas = [row // self.n_robots for row in rows]
        told = {
            arena: getattr(self._arenas.envs[arena], method_name)(*method_args, **method_kwargs)
            for arena in sorted({*arenas})
        }
        return [told[arena] for arena in arenas]

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """Return False for each row, but True for `Monitor`, because rows report their episodes in the same way.

        `evaluate_policy` and `EvalCallback` ask for it. They then count episodes and not dones, which absent rows have,
        too.
        """
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]

    def close(self) -> None:
        """Close all arenas."""
        self._arenas.close()
