"""The swarm as Gymnasium environments: one agent for all robots, or a vector environment of robots."""

import time
from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.contract.types import BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv, checked_seed
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.views.arenas import ArenaStep, open_arenas
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import constructor_takes, plan_arena
from swarm_forage_env.wrappers.base import WrapperConfig


class JointForageEnv(gymnasium.Env[ObsArray, np.ndarray]):
    """One agent that sees and steers every robot: the view of single-agent algorithms and of central control.

    Observations are (N, d) float32 in [-1, 1], row i = robot i; the columns are those of the parallel environment
    (`forage_env.layout`), or of the interface (`interface.layout`). Actions are (N, 3) or (N, 2) float32 in [-1, 1],
    with further columns where robots send messages, or (N,) whole numbers where the interface has discrete ones. With a
    sampler there are as many rows as the largest world has robots; those to spare are zeros, and their actions are
    ignored. The reward is the sum over robots and over the ticks of a decision. An episode terminates when every robot
    is dead and is truncated at the horizon.

    `info["active"]` is (N,) bool, the tasked swarm. With discrete actions, `info["action_mask"]` is (N, number of
    actions) int8, 1 = makes sense; `action_space.sample(mask=tuple(info["action_mask"]))` draws from these.
    """

    metadata = ForageEnv.metadata

    @constructor_takes(plan_arena)
    def __init__(self, *args: Any, **options: Any) -> None:
        """Create the environment."""
        plan = plan_arena(*args, **options)
        self._arena = LearnerArena(plan)
        self._is_discrete = plan.interface.actions == "discrete"
        self.render_mode = plan.render_mode
        self.observation_space = batch_space(self.interface.observation_space, self._arena.n_rows)
        self.action_space = batch_space(self.interface.action_space, self._arena.n_rows)

    @property
    def interface(self) -> LearnerInterface:
        """Spaces and layout of one robot's row; another object after a reset that changed the scenario."""
        return self._arena.interface

    @property
    def forage_env(self) -> ForageEnv:
        """The parallel environment at the bottom; another object after a reset that changed the scenario."""
        return self._arena.forage_env

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObsArray, dict[str, Any]]:
        """Start an episode; returns observations (N, d) and info.

        Args:
            seed: Seed of this episode and of the sequence of those after it.
            options: `{"scenario": {field: value}}` overrides scenario fields from now on; see `LearnerArena.reset`.
        """
        super().reset(seed=checked_seed(seed))
        self._arena.reset(seed, options)
        return self._arena.observe(), self._info()

    def step(self, action: np.ndarray) -> tuple[ObsArray, float, bool, bool, dict[str, Any]]:
        """Advance by one decision.

        Args:
            action: (N,) or (N, k), also for robots that are away (ignored).

        Raises:
            ActionError: wrong shape, numbers outside of `action_space`, or an active robot's action that is not finite.
        """
        n_robots, n_rows = self._arena.n_robots, self._arena.n_rows
        rewards = np.zeros(n_robots, np.float32)
        chosen = np.asarray(action)
        if n_robots < n_rows:
            if chosen.shape[:1] != (n_rows,):
                raise ActionError(f"Expected actions for {n_rows} rows, got shape {chosen.shape}.")
            chosen = chosen[:n_robots]
        self._arena.step(chosen, rewards)
        env = self.forage_env
        terminated, truncated = bool(env.terminated.all()), env.tick >= env.max_cycles
        return self._arena.observe(), float(rewards.sum(dtype=np.float64)), terminated, truncated, self._info()

    def render(self) -> np.ndarray | None:
        """Return a picture (height, width, 3) uint8 when created with render_mode="rgb_array", else None."""
        return self.forage_env.render()

    def close(self) -> None:
        """Close the wrapped stack."""
        self._arena.env.close()

    def _info(self) -> dict[str, Any]:
        info: dict[str, Any] = {"active": self._arena.active}
        if self._is_discrete:
            info["action_mask"] = self._arena.mask().astype(np.int8)
        return info


class SwarmVectorEnv(VectorEnv[ObsArray, np.ndarray, np.ndarray]):
    """Every robot of every arena as a sub-environment that one shared policy acts in.

    Sub-environment `a * N + i` is robot i of arena a. `views.arenas` describes how rows end, stay absent and start
    anew: an arena starts anew within the step that ends it (`AutoresetMode.SAME_STEP`), and `infos["final_obs"]` holds
    the last observations. A dead robot terminates once and is a row of zeros until its arena starts anew. With a
    sampler an arena has as many rows as the largest world has robots; those to spare in a run are absent all through.

    Infos are arrays over rows, with masks under the name with an underscore in front, as Gymnasium does it: `active`,
    and with discrete actions `action_mask` (num_envs, number of actions) int8. Rows that are done have `final_obs`
    (objects, None elsewhere) and `final_info` with, for rows whose episode ended, `episode`: its return "r", steps "l"
    and seconds since creation "t"; and, for all rows of an arena whose run ended, `run`: seed, simulated seconds,
    collected, first_picked and n_robots, and `state`: the last global view of the run (objects, None elsewhere), from
    which a central critic bootstraps. Gymnasium's `RecordEpisodeStatistics` works, and counts absent rows as episodes.

    `gymnasium.make_vec(id, vectorization_mode="sync")` makes something else: a sub-environment is then a whole swarm, a
    `JointForageEnv`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - declared like this by Gymnasium
        **ForageEnv.metadata,
        "render_modes": ["rgb_array"],  # a window shows one arena
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }
    autoreset_mode = AutoresetMode.SAME_STEP
    """As in `metadata`; some libraries ask for the attribute."""

    @constructor_takes(open_arenas)
    def __init__(self, *args: Any, **options: Any) -> None:
        """Create the environment."""
        self._arenas = open_arenas(*args, **options)
        self.interface = self._arenas.interface
        self.n_arenas, self.n_robots = self._arenas.n_arenas, self._arenas.n_robots
        self.num_envs = self._arenas.n_rows
        self.render_mode = self._arenas.render_mode
        self.single_observation_space = self.interface.observation_space
        self.single_action_space = self.interface.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._is_discrete = self.interface.config.actions == "discrete"
        self._everybody: BoolArray = np.ones(self.num_envs, np.bool_)
        self._started = time.perf_counter()

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[ObsArray, dict[str, Any]]:
        """Start an episode in every arena; returns observations (num_envs, d) and infos.

        Args:
            seed: Arena a runs seed + a; or one seed per arena.
            options: `{"scenario": {field: value}}` overrides scenario fields from now on; see `LearnerArena.reset`.

        Raises:
            ValueError: a list of seeds that is not as long as there are arenas.
        """
        if isinstance(seed, Sequence | np.ndarray):
            seeds = list(seed)
        else:
            first = checked_seed(seed)
            seeds = [None if first is None else first + arena for arena in range(self.n_arenas)]
        if len(seeds) != self.n_arenas:
            raise ValueError(f"Expected one seed per arena ({self.n_arenas}), got {len(seeds)}.")
        super().reset(seed=checked_seed(seeds[0]))
        obs, active = self._arenas.reset(seeds, [options] * self.n_arenas)
        return obs, self._now(active)

    def step(self, actions: np.ndarray) -> tuple[ObsArray, np.ndarray, BoolArray, BoolArray, dict[str, Any]]:
        """Step every arena by one decision.

        Args:
            actions: (num_envs,) or (num_envs, k); those of absent robots are ignored.

        Returns:
            Observations (num_envs, d), rewards, terminations, truncations (num_envs,) and infos, all new.
        """
        step = self._arenas.step(actions)
        return step.obs, step.rewards, step.terminated, step.truncated, self._infos(step)

    def _infos(self, step: ArenaStep) -> dict[str, Any]:
        infos = self._now(step.active)
        if len(step.ended) == 0:
            return infos
        is_done = np.zeros(self.num_envs, np.bool_)
        is_done[step.ended] = True
        final_obs = np.full(self.num_envs, None, object)
        for row, obs in zip(step.ended.tolist(), step.final_obs, strict=True):
            final_obs[row] = obs
        infos |= {"final_obs": final_obs, "_final_obs": is_done}
        infos |= {"final_info": self._final_info(step), "_final_info": is_done.copy()}
        return infos

    def _final_info(self, step: ArenaStep) -> dict[str, Any]:
        """Return what is told of episodes and runs that ended."""
        is_episode = np.zeros(self.num_envs, np.bool_)
        rows = step.ended[step.is_episode]
        is_episode[rows] = True
        returns, lengths = np.zeros(self.num_envs, np.float32), np.zeros(self.num_envs, np.int32)
        returns[rows], lengths[rows] = step.returns[step.is_episode], step.lengths[step.is_episode]
        seconds = np.where(is_episode, round(time.perf_counter() - self._started, 6), 0.0)
        told: dict[str, Any] = {"episode": {"r": returns, "l": lengths, "t": seconds}, "_episode": is_episode}
        if step.outcomes:
            of_run = dict[str, np.ndarray]()
            has_ended, states = np.zeros(self.num_envs, np.bool_), np.full(self.num_envs, None, object)
            for arena, outcome in step.outcomes.items():
                rows = slice(arena * self.n_robots, (arena + 1) * self.n_robots)
                has_ended[rows] = True
                for name, value in outcome.items():
                    if name != "scenario":
                        of_run.setdefault(name, np.zeros(self.num_envs, type(value)))[rows] = value
                for row in range(rows.start, rows.stop):
                    states[row] = step.final_states[arena]
            told |= {"run": of_run, "_run": has_ended, "state": states, "_state": has_ended.copy()}
        return told

    def _now(self, active: BoolArray) -> dict[str, Any]:
        """Return what is told of all rows in every step."""
        infos: dict[str, Any] = {"active": active, "_active": self._everybody.copy()}
        if self._is_discrete:
            infos |= {
                "action_mask": self._arenas.action_masks().astype(np.int8),
                "_action_mask": infos["_active"].copy(),
            }
        return infos

    def state(self) -> ObsArray:
        """Return the global view of each arena now, (n_arenas, S) float32, see `ForageEnv.state`; for central critics.

        The last views of runs that ended are in infos, as their arenas have started anew. With a sampler, views have
        zeros for robots and objects that a run does not have.
        """
        return self._arenas.states()

    def action_masks(self) -> BoolArray:
        """Return which discrete actions make sense now, (num_envs, number of actions)."""
        return self._arenas.action_masks()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return one picture (height, width, 3) per arena when created with render_mode="rgb_array", else None."""
        if self.render_mode is None:
            return None
        return tuple(picture for picture in self._arenas.render() if picture is not None)

    def close_extras(self, **kwargs: Any) -> None:
        """Close all arenas."""
        self._arenas.close()


def vector_env(*, swarm_wrappers: Iterable[WrapperConfig | str] = (), **options: Any) -> SwarmVectorEnv:
    """Create a `SwarmVectorEnv` for `gymnasium.make_vec`, which keeps the name `wrappers` for something else."""
    return SwarmVectorEnv(wrappers=swarm_wrappers, **options)
