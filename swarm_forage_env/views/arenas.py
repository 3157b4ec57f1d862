"""Many arenas stepped as one batch of rows, one row per robot: what vector environments are made of.

Row `a * N + i` is always robot i of arena a. Where a sampler draws the worlds, N is the most robots of all, and spare
rows (`LearnerArena`) are absent from the first step of the run to the last. The life of a row:

* While its robot is in the world, or not yet born, the row is part of an episode.
* When the robot dies, the row terminates once, with its last observation (zeros: it has left the world). Until its
  arena starts anew the row is absent: an observation of zeros, no reward, actions ignored.
* When the arena ends, at its horizon or when its last robot dies, it starts anew within the same step and every row is
  done. Rows of robots that could have gone on are truncated. Rows whose robots die in this step terminate. Absent rows
  terminate once more, because their next observation belongs to a new episode; no episode of theirs ends, so
  `ArenaStep.is_episode` is false for them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import whole
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.contract.types import BoolArray, IntArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import ArenaPlan, plan_arena, takes
from swarm_forage_env.wrappers.base import SwarmWrapper

_NOBODY = np.zeros(0, np.int32)


def _nobody() -> Any:
    return _NOBODY


@dataclass(kw_only=True, slots=True)
class ArenaStep:
    """Result of one step of R rows. Arrays that are not empty are new and belong to the caller."""

    obs: ObsArray
    """(R, d) observations to act on next; rows of arenas that ended already show the new run."""
    rewards: np.ndarray
    """(R,) float32."""
    terminated: BoolArray
    """(R,) robots that died in this step, and absent rows whose arena ended."""
    truncated: BoolArray
    """(R,) rows whose arena reached its horizon while their robot could have gone on."""
    active: BoolArray
    """(R,) rows whose robot is at work in `obs`."""
    ended: IntArray = field(default_factory=_nobody)
    """(E,) rows that are done, ascending."""
    final_obs: ObsArray = field(default_factory=_nobody)
    """(E, d) their last observations, where E > 0."""
    is_episode: BoolArray = field(default_factory=_nobody)
    """(E,) True where an episode ended, False where the row was absent."""
    returns: np.ndarray = field(default_factory=_nobody)
    """(E,) float64, sums of rewards; float32 would lose the small ones of long runs."""
    lengths: IntArray = field(default_factory=_nobody)
    """(E,) steps that began with the robot in the world."""
    outcomes: dict[int, dict[str, Any]] = field(default_factory=dict)
    """Arenas whose run ended -> its seed, simulated seconds, objects collected and first_picked, scenario (its name),
    and n_robots."""
    final_states: dict[int, ObsArray] = field(default_factory=dict)
    """Their last global views, see `LearnerArena.state`."""


class ArenaBatch:
    """Arenas of one kind in this process, stepped together.

    Attributes:
        n_arenas, n_robots, n_rows: Sizes; n_rows = n_arenas * n_robots, the rows of an arena.
        render_mode: What pictures are drawn for.
        arenas: The arenas.
        interface: Spaces and layout of what learners see and do.
    """

    def __init__(self, plan: ArenaPlan, n_arenas: int) -> None:
        """Build the arenas; `reset` must be called before `step`.

        Where a sampler draws the worlds, each arena keeps to one of its kinds, see `ScenarioSampler.shares`.

        Args:
            plan: What every arena is made from.
            n_arenas: How many.

        Raises:
            ConfigError: n_arenas below 1, or a plan that cannot be built.
        """
        n_arenas = whole("n_arenas", n_arenas, at_least=1)
        shares = [None] * n_arenas if plan.sampler is None else plan.sampler.shares(n_arenas)
        self.arenas = [LearnerArena(plan, share) for share in shares]
        self.interface = self.arenas[0].interface
        self.n_arenas, self.n_robots = n_arenas, plan.world.n_robots
        self.n_rows = n_arenas * self.n_robots
        self.render_mode = plan.render_mode
        self._is_reset = False
        shape = self._shape = n_arenas, self.n_robots
        self._absent, self._present, self._dead, self._active = np.zeros((4, *shape), np.bool_)
        self._returns, self._lengths = np.zeros(shape), np.zeros(shape, np.int32)
        self._told: list[tuple[BoolArray, ...]] = [()] * n_arenas
        """Of each arena, those rows of present, active and dead that are its robots."""

    def reset(
        self, seeds: Sequence[int | None], options: Sequence[Mapping[str, Any] | None]
    ) -> tuple[ObsArray, BoolArray]:
        """Start a run in every arena; returns observations (R, d) and which rows are at work (R,).

        Args:
            seeds: One per arena; see `LearnerArena.reset`.
            options: One per arena; see `LearnerArena.reset`.
        """
        self._is_reset = False  # and stays False if a seed or an option is refused before every arena has started
        obs = np.empty((*self._shape, self.interface.layout.size), np.float32)
        for number, (seed, option) in enumerate(zip(seeds, options, strict=True)):
            self._start(number, obs[number], seed, option)
        self._is_reset = True
        return obs.reshape(self.n_rows, -1), self._active.flatten()

    def _start(
        self, number: int, out: ObsArray, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> None:
        """Start a run in one arena; writes the learner's observations to `out`."""
        arena = self.arenas[number]
        arena.reset(seed, options)
        for rows in (self._present, self._active, self._returns, self._lengths):
            rows[number] = 0
        self._absent[number] = np.arange(self.n_robots) >= arena.n_robots
        told = self._present, self._active, self._dead
        self._told[number] = tuple(rows[number, : arena.n_robots] for rows in told)
        self._look(number, out)

    def _look(self, number: int, out: ObsArray) -> None:
        """Note which robots of an arena are there, at work and dead, and write what they see to `out`."""
        arena, (present, active, dead) = self.arenas[number], self._told[number]
        swarm = arena.forage_env.arena.swarm
        present[:], active[:], dead[:] = swarm.present, swarm.active, arena.forage_env.terminated
        arena.observe(out)

    def step(self, actions: np.ndarray) -> ArenaStep:
        """Step every arena by one decision.

        Args:
            actions: (R,) or (R, k), one action of the interface per row; those of absent rows are ignored.

        Raises:
            RuntimeError: not reset yet, or a step before this one failed half done.
            ValueError: wrong shape, or actions that the interface or the drive refuses. A note names the arena.
        """
        self._require_reset("step")
        actions = np.asarray(actions)
        if actions.ndim == 0 or len(actions) != self.n_rows:
            raise ValueError(
                f"Expected actions for {self.n_rows} rows ({self.n_arenas} arenas of {self.n_robots} robots), "
                f"got shape {actions.shape}."
            )
        obs = np.empty((*self._shape, self.interface.layout.size), np.float32)
        rewards = np.zeros(self._shape, np.float32)
        present = self._present.copy()
        by_arena = actions.reshape(*self._shape, *actions.shape[1:])
        for number, arena in enumerate(self.arenas):
            try:
                n_robots = len(self._told[number][0])
                arena.step(by_arena[number, :n_robots], rewards[number, :n_robots])
                self._look(number, obs[number])
            except BaseException as error:
                # Where the first arena refuses its actions, nothing has happened.
                self._is_reset = number == 0 and isinstance(error, ActionError)
                error.add_note(f"This was in arena {number}{'' if self._is_reset else '; reset before going on'}.")
                raise
        self._lengths += present
        self._returns += rewards
        terminated, truncated = self._dead & ~self._absent, np.zeros(self._shape, np.bool_)
        over = [number for number, arena in enumerate(self.arenas) if arena.forage_env.is_over]
        if over:  # to index by an empty list takes longer than a small swarm's tick
            terminated[over] |= self._absent[over]
            truncated[over] = ~terminated[over]
        obs = obs.reshape(self.n_rows, -1)
        step = ArenaStep(
            obs=obs,
            rewards=rewards.ravel(),
            terminated=terminated.ravel(),
            truncated=truncated.ravel(),
            active=self._active.flatten(),
        )
        ended = np.flatnonzero(terminated | truncated).astype(np.int32)
        if len(ended):
            step.ended, step.final_obs, step.is_episode = ended, obs[ended], ~self._absent.ravel()[ended]
            step.returns, step.lengths = self._returns.ravel()[ended], self._lengths.ravel()[ended]
        self._absent |= self._dead
        for number in over:
            step.outcomes[number], step.final_states[number] = self._outcome(number), self.arenas[number].state()
            self._start(number, obs.reshape(*self._shape, -1)[number])
            step.active.reshape(self._shape)[number] = self._active[number]
        return step

    def _outcome(self, number: int) -> dict[str, Any]:
        """Return what an `ArenaStep` says of a run that ended."""
        env = self.arenas[number].forage_env
        return {
            "seed": env.seed_value,
            "seconds": env.tick * env.scenario.dt_s,
            "collected": int(env.events.counters[Counter.COLLECTED]),
            "first_picked": int(env.events.counters[Counter.FIRST_PICKED]),
            "scenario": env.scenario.name,
            "n_robots": env.scenario.robots.n_robots,
        }

    def states(self) -> ObsArray:
        """Return the global view of each arena, (n_arenas, S) float32, see `LearnerArena.state`."""
        return np.stack([arena.state() for arena in self.arenas])

    def action_masks(self) -> BoolArray:
        """Return which discrete actions make sense now, (R, number of actions); spare rows can only stand.

        Raises:
            RuntimeError: not reset yet.
            ValueError: the actions are continuous.
        """
        self._require_reset("action_masks")
        return np.concatenate([arena.mask() for arena in self.arenas])

    def _require_reset(self, what: str) -> None:
        if not self._is_reset:
            raise RuntimeError(f"Call reset before {what}; after a step that failed half done, too.")

    @property
    def envs(self) -> list[ForageEnv | SwarmWrapper]:
        """The environments of the arenas with their wrappers; others after a reset that drew other worlds."""
        return [arena.env for arena in self.arenas]

    def render(self) -> list[np.ndarray | None]:
        """Return one picture per arena."""
        return [arena.forage_env.render() for arena in self.arenas]

    def close(self) -> None:
        """Close all environments."""
        for arena in self.arenas:
            arena.env.close()


@takes(plan_arena)
def open_arenas(*args: Any, num_envs: int = 1, n_arenas: int | None = None, **options: Any) -> ArenaBatch:
    """Build arenas.

    `num_envs` are the robots in all arenas together, a multiple of the scenario's number; 1, the default of
    `gymnasium.make_vec`, leaves the choice to `n_arenas`, the arenas that run side by side, default one. A ValueError
    tells where they do not fit together, or of a window.
    """
    plan = plan_arena(*args, **options)
    if plan.render_mode == "human":
        raise ValueError(
            "Expected render_mode None or 'rgb_array' for a vector environment, got 'human'; a window shows one arena, "
            "of parallel_env or JointForageEnv."
        )
    n_robots = plan.world.n_robots
    if num_envs == 1:
        return ArenaBatch(plan, 1 if n_arenas is None else n_arenas)
    if num_envs < 1 or num_envs % n_robots or n_arenas not in (None, num_envs // n_robots):
        raise ValueError(
            f"Expected num_envs to be n_arenas times n_robots = {n_robots} (one sub-environment per robot), got "
            f"num_envs = {num_envs} and n_arenas = {n_arenas}; give one of both."
        )
    return ArenaBatch(plan, num_envs // n_robots)
