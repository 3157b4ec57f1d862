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

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, cast

import numpy as np

from swarm_forage_env._internal.fields import as_whole
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.types import BoolArray, IntArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.extras import ExtraFunction, ExtraFunctionError
from swarm_forage_env.policies.interface import GivenInterface
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import ArenaPlan, plan_arena
from swarm_forage_env.views.sampler import ScenarioSampler
from swarm_forage_env.world.kernels.reward import book_rows
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class RunOutcome:
    """How a run of one arena ended."""

    arena: int
    seed: int
    seconds: float
    """Simulated time, s."""
    collected: int
    """Objects delivered."""
    first_picked: int
    """Objects picked up for the first time."""
    scenario: str
    """Name of the scenario."""
    n_robots: int
    """Robots of this run."""


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
    ended: IntArray
    """(E,) rows that are done, ascending."""
    final_obs: ObsArray
    """(E, d) their last observations."""
    is_episode: BoolArray
    """(E,) True where an episode ended, False where the row was absent."""
    returns: np.ndarray
    """(E,) float64, sums of rewards; float32 would lose the small ones of long runs."""
    lengths: IntArray
    """(E,) steps that began with the robot in the world."""
    outcomes: tuple[RunOutcome, ...] = ()
    """Runs that ended."""


class Rows(Protocol):
    """Sizes of a batch."""

    n_arenas: int
    n_robots: int
    n_rows: int


def checked_rows(actions: Any, batch: Rows) -> np.ndarray:
    """Return actions as an array; raises ValueError unless there is one per row of the batch."""
    actions = np.asarray(actions)
    if actions.ndim == 0 or len(actions) != batch.n_rows:
        raise ValueError(
            f"Expected actions for {batch.n_rows} rows ({batch.n_arenas} arenas of {batch.n_robots} robots), "
            f"got shape {actions.shape}."
        )
    return actions


def closed_error() -> RuntimeError:
    """Return the error for a call of closed arenas."""
    return RuntimeError("Expected open arenas, but they were closed.")


def _owner(env: ForageEnv | SwarmWrapper, name: str) -> ForageEnv | SwarmWrapper:
    """Return the wrapper or environment of a stack that has the attribute itself and does not only pass it on."""
    while isinstance(env, SwarmWrapper) and name not in vars(env) and not hasattr(type(env), name):
        env = cast("ForageEnv | SwarmWrapper", env.env)  # checked by its constructor
    return env


@dataclass(slots=True)
class _Endings:
    """What ended in a step, arena by arena."""

    rows: list[IntArray] = field(default_factory=list)
    final_obs: list[ObsArray] = field(default_factory=list)
    is_episode: list[BoolArray] = field(default_factory=list)
    returns: list[np.ndarray] = field(default_factory=list)
    lengths: list[IntArray] = field(default_factory=list)
    outcomes: list[RunOutcome] = field(default_factory=list)

    def joined(self, columns: int) -> dict[str, Any]:
        """Return the fields of an `ArenaStep` with the same names; `columns` = columns of an observation."""
        return {
            "ended": _joined(self.rows, np.zeros(0, np.int32)),
            "final_obs": _joined(self.final_obs, np.zeros((0, columns), np.float32)),
            "is_episode": _joined(self.is_episode, np.zeros(0, np.bool_)),
            "returns": _joined(self.returns, np.zeros(0, np.float64)),
            "lengths": _joined(self.lengths, np.zeros(0, np.int32)),
            "outcomes": tuple(self.outcomes),
        }


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
        n_arenas = as_whole("n_arenas", n_arenas, at_least=1)
        shares: list[float | None] = [None] * n_arenas
        if plan.sampler is not None:
            shares = plan.sampler.shares(n_arenas)
        self.arenas = [LearnerArena(plan, share) for share in shares]
        self.interface = self.arenas[0].interface
        self.n_arenas = n_arenas
        self.n_robots = plan.world.n_robots
        self.n_rows = n_arenas * self.n_robots
        self.render_mode = plan.render_mode
        self._is_reset = self._is_closed = False
        self._absent = np.zeros((n_arenas, self.n_robots), np.bool_)
        self._present = np.zeros((n_arenas, self.n_robots), np.bool_)
        self._returns = np.zeros((n_arenas, self.n_robots), np.float64)
        self._lengths = np.zeros((n_arenas, self.n_robots), np.int32)
        self._n_columns = self.interface.layout.size
        self._rows = self._absent, self._present, self._returns, self._lengths
        self._no_endings = _Endings().joined(self._n_columns)

    def reset(
        self, seeds: Sequence[int | None], options: Sequence[Mapping[str, Any] | None]
    ) -> tuple[ObsArray, BoolArray]:
        """Start a run in every arena; returns observations (R, d) and which rows are at work (R,).

        Args:
            seeds: One per arena; see `LearnerArena.reset`.
            options: One per arena; see `LearnerArena.reset`.

        Raises:
            RuntimeError: closed.
        """
        if self._is_closed:
            raise closed_error()
        obs = np.empty((self.n_arenas, self.n_robots, self._n_columns), np.float32)
        self._is_reset = False  # and stays False if a seed or an option is refused before every arena has started
        for number, (seed, option) in enumerate(zip(seeds, options, strict=True)):
            self._start(number, obs[number], seed, option)
        self._is_reset = True
        return obs.reshape(self.n_rows, -1), np.concatenate([arena.active for arena in self.arenas])

    def _start(
        self, number: int, out: ObsArray, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> None:
        """Start a run in one arena; writes the learner's observations to `out`."""
        arena = self.arenas[number]
        arena.reset(seed, options)
        n_robots = arena.n_robots
        self._present[number, :n_robots] = arena.forage_env.swarm.present
        self._present[number, n_robots:] = False
        self._absent[number, :n_robots] = False
        self._absent[number, n_robots:] = True
        self._returns[number] = 0.0
        self._lengths[number] = 0
        arena.observe(out)

    def step(self, actions: np.ndarray) -> ArenaStep:
        """Step every arena by one decision.

        Args:
            actions: (R,) or (R, k), one action of the interface per row; those of absent rows are ignored.

        Raises:
            RuntimeError: not reset yet, or closed.
            ValueError: wrong shape, or actions that the interface or the drive refuses. A note names the arena.
        """
        self._require_reset("step")
        actions = checked_rows(actions, self)
        shape, columns = (self.n_arenas, self.n_robots), self._n_columns
        obs = np.empty((*shape, columns), np.float32)
        rewards = np.zeros(shape, np.float32)
        flags = np.zeros((3, *shape), np.bool_)
        actions = actions.reshape(*shape, *actions.shape[1:])
        try:
            ticks = [self._alone(number, actions[number], rewards[number]) for number in range(self.n_arenas)]
            for arena, out in zip(self.arenas, obs, strict=True):
                arena.observe(out)
        except ExtraFunctionError:
            self._is_reset = False
            for arena in self.arenas:  # some have been stepped and some not
                arena.forage_env.break_off()
            raise
        endings: _Endings | None = None
        for number, (dead, all_dead, at_horizon) in enumerate(ticks):
            n_robots = self.arenas[number].n_robots
            booked: Any = (rewards, *self._rows, flags[0], flags[2])
            n_terminated = book_rows(
                self.arenas[number].forage_env.swarm, dead, *(rows[number, :n_robots] for rows in booked)
            )
            if n_terminated or all_dead or at_horizon:
                endings = endings or _Endings()
                out = obs[number], *flags[:, number]
                self._conclude(number, dead, all_dead or at_horizon, out, endings)
        obs = obs.reshape(self.n_rows, columns)
        rows = flags.reshape(3, self.n_rows)
        ended = endings.joined(columns) if endings else self._no_endings
        return ArenaStep(
            obs=obs, rewards=rewards.ravel(), terminated=rows[0], truncated=rows[1], active=rows[2], **ended
        )

    def _alone(self, number: int, actions: np.ndarray, rewards: np.ndarray) -> tuple[BoolArray, bool, bool]:
        arena = self.arenas[number]
        try:
            return arena.step(actions[: arena.n_robots], rewards[: arena.n_robots])
        except ValueError as error:
            self._note(error, number)
            raise

    def _note(self, error: ValueError, number: int) -> None:
        """Add to a refusal of actions in which arena it was."""
        error.add_note(
            f"This was in arena {number}, which was not stepped. Other arenas may have been "
            "stepped already; where there are others, reset before going on."
        )

    def _conclude(
        self,
        number: int,
        dead: BoolArray,
        over: bool,
        out: tuple[ObsArray, BoolArray, BoolArray, BoolArray],
        endings: _Endings,
    ) -> None:
        """Conclude episodes of one arena; rewrites its rows of what `step` returns and appends to `endings`.

        `out` is its observations, terminated, truncated, active.
        """
        obs, terminated, truncated, active = out
        absent = self._absent[number]
        if over:
            terminated |= absent
            np.logical_not(terminated, out=truncated)
            self._note_endings(number, np.arange(self.n_robots), obs, endings)
            endings.outcomes.append(self._outcome(number))
            self._start(number, obs)
            active[:] = self.arenas[number].active
        else:
            self._note_endings(number, np.flatnonzero(terminated), obs, endings)
            absent[: len(dead)] |= dead

    def _note_endings(self, number: int, robots: np.ndarray, obs: ObsArray, endings: _Endings) -> None:
        endings.rows.append((robots + number * self.n_robots).astype(np.int32))
        endings.final_obs.append(obs[robots])
        endings.is_episode.append(~self._absent[number, robots])
        endings.returns.append(self._returns[number, robots])
        endings.lengths.append(self._lengths[number, robots])

    def _outcome(self, number: int) -> RunOutcome:
        env = self.arenas[number].forage_env
        assert env.seed_value is not None, "an environment that was stepped has a seed"
        return RunOutcome(
            arena=number,
            seed=env.seed_value,
            seconds=env.tick * env.scenario.dt_s,
            collected=int(env.events.counters[Counter.COLLECTED]),
            first_picked=int(env.events.counters[Counter.FIRST_PICKED]),
            scenario=env.scenario.name,
            n_robots=env.scenario.robots.n_robots,
        )

    def action_masks(self) -> BoolArray:
        """Return which discrete actions make sense now, (R, number of actions); spare rows can only stand.

        Raises:
            RuntimeError: not reset yet, or closed.
            ValueError: the actions are continuous.
        """
        self._require_reset("action_masks")
        return np.concatenate([arena.mask() for arena in self.arenas])

    def _require_reset(self, what: str) -> None:
        if self._is_closed:
            raise closed_error()
        if not self._is_reset:
            for arena in self.arenas:
                arena.forage_env.require_whole()
            raise RuntimeError(f"Call reset before {what}.")

    def render(self) -> list[np.ndarray | None]:
        """Return one picture per arena."""
        return [arena.forage_env.render() for arena in self.arenas]

    def get_attribute(self, name: str, arenas: Sequence[int]) -> list[Any]:
        """Return an attribute of the environments of some arenas; raises AttributeError for unknown names."""
        return [getattr(self.arenas[number].env, name) for number in arenas]

    def set_attribute(self, name: str, value: Any, arenas: Sequence[int]) -> None:
        """Set an attribute of the environments of some arenas, in the wrapper or environment that has it."""
        for number in arenas:
            setattr(_owner(self.arenas[number].env, name), name, value)

    def call_method(self, name: str, arenas: Sequence[int], *args: Any, **kwargs: Any) -> list[Any]:
        """Call a method of the environments of some arenas, once each; returns what they return.

        An attribute that cannot be called is returned as it is.
        """
        found = self.get_attribute(name, arenas)
        return [member(*args, **kwargs) if callable(member) else member for member in found]

    def close(self) -> None:
        """Close all environments; afterwards `reset` and `step` raise errors."""
        self._is_closed = True
        for arena in self.arenas:
            arena.env.close()


def _joined(parts: list[np.ndarray], nothing: np.ndarray) -> np.ndarray:
    return np.concatenate(parts) if parts else nothing


def open_arenas(
    scenario: str | ScenarioConfig | None = None,
    *,
    num_envs: int = 1,
    n_arenas: int | None = None,
    sampler: ScenarioSampler | None = None,
    interface: GivenInterface = None,
    wrappers: Iterable[WrapperConfig | str] = (),
    max_cycles: int | None = None,
    render_mode: str | None = None,
    extra_reward: ExtraFunction | None = None,
    extra_observation: ExtraFunction | None = None,
    **overrides: Any,
) -> ArenaBatch:
    """Build arenas.

    Args:
        scenario: Name of a preset, or a complete configuration; default warehouse_small.
        num_envs: Robots in all arenas together, a multiple of the scenario's number. 1, the default of
            `gymnasium.make_vec`, leaves the choice to `n_arenas`.
        n_arenas: Arenas that run side by side; default as many as `num_envs` needs, at least one.
        sampler: Draws the world of each run, instead of `scenario`, `wrappers` and `overrides`.
        interface: What a learner sees and does, an `InterfaceConfig` or its fields by name; default full observations
            and continuous actions.
        wrappers: What disturbs the swarm, in any order: configurations, or words as on the command line
            ("population:death_per_tick=0.01").
        max_cycles: Ticks until truncation; default the scenario's horizon.
        render_mode: None or "rgb_array".
        extra_reward: See `plan_arena`.
        extra_observation: See `plan_arena`.
        overrides: Scenario fields by name (`n_robots=20`, `nest_progress=0.1`).

    Raises:
        ConfigError: as `plan_arena`, or n_arenas below 1.
        ValueError: num_envs and n_arenas that do not fit together, or a window.
    """
    plan = plan_arena(
        scenario,
        sampler=sampler,
        interface=interface,
        wrappers=wrappers,
        max_cycles=max_cycles,
        render_mode=render_mode,
        extra_reward=extra_reward,
        extra_observation=extra_observation,
        **overrides,
    )
    if render_mode == "human":
        raise ValueError(
            "Expected render_mode None or 'rgb_array' for a vector environment, got 'human'; a window shows one arena, "
            "of parallel_env or JointForageEnv."
        )
    return ArenaBatch(plan, _number_of_arenas(num_envs, n_arenas, plan.world.n_robots))


def _number_of_arenas(num_envs: int, n_arenas: int | None, n_robots: int) -> int:
    if n_arenas is not None and num_envs not in (1, n_arenas * n_robots):
        raise ValueError(
            f"Expected num_envs = {n_arenas * n_robots} for n_arenas = {n_arenas} of n_robots = {n_robots} (one "
            f"sub-environment per robot), got {num_envs}; leave num_envs or n_arenas away."
        )
    if n_arenas is not None:
        return n_arenas
    if num_envs == 1:
        return 1
    if num_envs < 1 or num_envs % n_robots:
        raise ValueError(
            f"Expected num_envs to be a multiple of n_robots = {n_robots} (one sub-environment per robot), got "
            f"{num_envs}; choose another n_robots, or give n_arenas instead."
        )
    return num_envs // n_robots
