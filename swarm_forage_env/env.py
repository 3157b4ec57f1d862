"""ForageEnv: the arena as a PettingZoo environment. It works on arrays; only `reset` and `step` make dicts."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from swarm_forage_env._internal.fields import as_whole, instance
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.policy import COMMANDS, ActionError, SwarmSpec
from swarm_forage_env.contract.reset_and_step import as_actions, checked_gain, is_over, no_options, refuse_not_finite
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.arena import ForagingArena
from swarm_forage_env.world.rewards import RewardModel
from swarm_forage_env.world.sensors import global_state
from swarm_forage_env.world.snapshots import Origin, Snapshot, read, take
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState

if TYPE_CHECKING:
    from swarm_forage_env.rendering.window import Window

BatchStep: TypeAlias = tuple[ObsArray, np.ndarray, BoolArray, bool]
"""Observations (N, D), rewards (N,) float32, terminated (N,), truncated."""

_STATE = ("_rewards", "_seeds", "_terminated", "agents", "seed_value")
"""Attributes of a ForageEnv that are state; the arena holds the rest."""


class ForageEnv(ParallelEnv[str, np.ndarray, np.ndarray]):
    """A swarm that forages: one agent per robot, named robot_0, robot_1, ...

    Observations are flat float32 rows in named slices (`env.layout`, printed by `env.layout.describe()`); actions are
    (left wheel, right wheel, gripper) in [-1, 1], and the numbers of a message where robots can send messages; values
    outside are clipped. Robots in repair stay in `agents`; their
    observation column `active` is 0. Only permanent death terminates, only the horizon truncates.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - PettingZoo types it as an attribute of instances
        "name": "swarm_forage_v0",
        "render_modes": ["rgb_array", "human"],
        "render_fps": 5,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        scenario: ScenarioConfig,
        *,
        max_cycles: int | None = None,
        render_mode: str | None = None,
        reads: Collection[str] | None = None,
    ) -> None:
        """Create the environment of one scenario.

        Args:
            scenario: The configuration.
            max_cycles: Steps until truncation; default the scenario's horizon.
            render_mode: None, "rgb_array", or "human": every reset and step is shown in a window, without waiting.
            reads: Observation slices that will be used; others may stay zero, which is faster. Default: all.

        Raises:
            ConfigError: `scenario` is no ScenarioConfig, or an unknown slice in `reads`.
            ValueError: max_cycles is no whole number >= 1, or an unknown render mode.
            ImportError: render_mode is "human" and pygame is not installed.
        """
        instance("scenario", scenario, ScenarioConfig, hint="; `parallel_env` takes names of presets, too")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"Expected render_mode None, 'rgb_array' or 'human', got {render_mode!r}.")
        if max_cycles is not None:
            max_cycles = as_whole("max_cycles", max_cycles, at_least=1, or_none=True)
        self.scenario = scenario
        self.render_mode = render_mode
        self._window = _new_window() if render_mode == "human" else None
        self.max_cycles = scenario.horizon_ticks if max_cycles is None else max_cycles
        self.arena = ForagingArena(scenario, reads=reads)
        self._reads = ("all",) if reads is None else tuple(sorted(set(reads)))
        n_robots = scenario.robots.n_robots
        self._terminated = np.zeros(n_robots, np.bool_)
        self.possible_agents = [f"robot_{row}" for row in range(n_robots)]
        self.agents: list[str] = []
        self._actions = np.zeros((n_robots, COMMANDS + scenario.robots.message_size), np.float32)
        self._seeds = np.random.default_rng()
        self.seed_value: int | None = None
        self._is_half_done = False

    # Spaces and constants

    @property
    def unwrapped(self) -> "ForageEnv":
        """The environment itself, at the bottom of every stack."""
        return self

    @property
    def layout(self) -> ObservationLayout:
        """Named slices of an observation row."""
        return self.arena.layout

    def observation_space(self, agent: str) -> spaces.Box:
        """(D,) float32 in [-1, 1]; one space object per agent."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        """(A,) float32 in [-1, 1]: left wheel, right wheel, gripper, message; one space object per agent."""
        return self._action_spaces[agent]

    @cached_property  # like the spaces made when asked for: runs of a policy never look, and there may be a million
    def _row_of(self) -> dict[str, int]:
        return {agent: row for row, agent in enumerate(self.possible_agents)}

    @cached_property
    def _observation_spaces(self) -> dict[str, spaces.Box]:
        columns = self.layout.size
        return {agent: spaces.Box(-1.0, 1.0, (columns,), np.float32) for agent in self.possible_agents}

    @cached_property
    def _action_spaces(self) -> dict[str, spaces.Box]:
        return {agent: spaces.Box(-1.0, 1.0, self._actions.shape[1:], np.float32) for agent in self.possible_agents}

    @cached_property
    def state_space(self) -> spaces.Box:
        """Space of `state()`: (6 N + 3 M,) float32 in [-1, 1]."""
        return spaces.Box(-1.0, 1.0, (self.swarm_spec.state_size,), np.float32)

    @cached_property
    def swarm_spec(self) -> SwarmSpec:
        """What every policy may know before a run."""
        return SwarmSpec.of(self.scenario, horizon_s=self.max_cycles * self.scenario.dt_s)

    @property
    def np_random(self) -> np.random.Generator:
        """Generator for wrappers of other libraries; a seed given to a reset starts it. Runs themselves draw elsewhere.

        It is that of the sequence of seeds: what is drawn from it changes the seeds of later resets without one.
        """
        return self._seeds

    # True state, for wrappers, recorders and pictures

    @property
    def _world(self) -> ForagingArena:
        """The arena; raises RuntimeError before the first reset."""
        self._require_reset()
        return self.arena

    def _require_reset(self) -> None:
        if self.seed_value is None:
            raise RuntimeError(
                "There is no world before the first reset. Call reset before step, state, render or snapshot."
            )

    def require_whole(self) -> None:
        """Refuse to go on with a tick that is half done; RuntimeError. See `break_off`."""
        if self._is_half_done:
            raise RuntimeError(
                "A tick is half done: something failed in it, and going on would shift all that is counted by a tick. "
                "Reset, or restore a snapshot, before the next step or snapshot."
            )

    def break_off(self) -> None:
        """Refuse every step and snapshot until a reset or a restore, because something failed in the middle of a tick.

        A sensor, a reward, a wrapper or a compiled policy of the user may. The state can be read as it is.
        """
        self._is_half_done = True

    @property
    def swarm(self) -> SwarmState:
        """Robots; read only."""
        return self._world.swarm

    @property
    def objects(self) -> ObjectState:
        """Objects and the floor; read only."""
        return self._world.objects

    @property
    def caches(self) -> CacheState:
        """Caches; read only."""
        return self._world.caches

    @property
    def events(self) -> StepEvents:
        """This tick's events and the cumulative counters; read only."""
        return self._world.events

    @property
    def active(self) -> BoolArray:
        """(N,) robots of the tasked swarm; read only."""
        return self._world.swarm.active

    @property
    def tick(self) -> int:
        """Ticks done since reset."""
        return self.arena.tick

    @property
    def last_obs(self) -> ObsArray:
        """(N, D) observations as they are since the last reset, step or restore; another buffer after a restore."""
        return self._world.obs

    @property
    def terminated(self) -> BoolArray:
        """(N,) robots that are dead for good; read only."""
        return self._terminated

    @property
    def reward_model(self) -> RewardModel:
        """What makes the rewards of this run; another object after a reset."""
        self._require_reset()
        return self._rewards

    def set_population(self, *, active: BoolArray, present: BoolArray, terminated: BoolArray | None = None) -> None:
        """Set which robots are at work and which are in the world; see `ForagingArena.set_population`.

        `terminated` (N,) marks robots that count as terminated from the next step on.

        Raises:
            ValueError: wrong shapes, or a robot that is active but not present.
        """
        if terminated is not None and terminated.shape != self._terminated.shape:
            raise ValueError(f"Expected terminated with shape {self._terminated.shape}, got {terminated.shape}.")
        self._world.set_population(active=active, present=present)
        if terminated is not None:
            self._terminated[:] = terminated

    def set_handling_ticks(self, *, pickup: int, drop: int) -> None:
        """Set how many ticks pick-ups and drops take; see `ForagingArena.set_handling_ticks`."""
        self._world.set_handling_ticks(pickup=pickup, drop=drop)

    # Array level

    def reset_batch(self, seed: int | None = None) -> ObsArray:
        """Start a run and return observations (N, D).

        Args:
            seed: Non-negative integer. None takes the next of a sequence of seeds, which the last given seed (or the
                operating system) started.
        """
        if seed is None:
            seed = int(self._seeds.integers(2**31))
        else:
            seed = as_whole("seed", seed, at_least=0, or_none=True)
            self._seeds = np.random.default_rng(seed)
        self.break_off()  # should the reset fail
        obs = self.arena.reset(seed)
        self._rewards = RewardModel(
            self.scenario.reward, self.scenario.arena.nest_centres_m, self.arena.swarm, self.arena.events
        )
        self.seed_value = seed
        self._terminated[:] = False
        self.agents = list(self.possible_agents)
        self._is_half_done = False
        if self._window is not None:
            self.render()
        return obs

    def checked_actions(self, actions: ActionArray) -> ActionArray:
        """Return `actions` as a contiguous (N, A) float32 array, the same array if it is one; values are not checked.

        Raises:
            ActionError: values that are not numbers, or another shape.
            RuntimeError: before the first reset, or after a step that failed half done.
        """
        self._require_reset()
        self.require_whole()
        return as_actions(actions, len(self._actions), self.scenario.robots.message_size)

    def refuse_bad_step(self, actions: ActionArray, wheel_gain: FloatArray | None) -> None:
        """Refuse what the arena would refuse, for wrappers, which have to know it before they do anything.

        Args:
            actions: (N, A) as `checked_actions` returns them.
            wheel_gain: As in `step_batch`.

        Raises:
            ActionError: a gain of the wrong shape, or an action or gain of an active robot that is not finite.
        """
        refuse_not_finite(self.active, actions, checked_gain(wheel_gain, len(self._actions)))

    def step_batch(
        self,
        actions: ActionArray,
        *,
        wheel_gain: FloatArray | None = None,
        tasks: CodeArray | None = None,
    ) -> BatchStep:
        """Advance one tick at array level.

        Args:
            actions: (N, 3) float32, also for robots that are away (ignored); other number types are converted. Where
                robots can send messages, (N, 3 + message_size); (N, 3) says zeros.
            wheel_gain: (N, 2) factor per wheel on the limited speed: the product of the wrappers' gains.
            tasks: (N,) int8 `Task` codes, if the policy has tasks.

        Returns:
            Observations (N, D) and rewards (N,) in reused buffers, terminated (N,) for the dead, truncated.

        Raises:
            ActionError: values that are not numbers, a wrong shape, or an action or gain of an active robot that is not
                finite.
            RuntimeError: before the first reset, or after a step that failed half done.
        """
        actions, wheel_gain = self.begin_step(actions, wheel_gain)
        self.arena.step(actions, wheel_gain=wheel_gain, tasks=tasks)
        return self.end_step(tasks)

    def begin_step(
        self, actions: ActionArray, wheel_gain: FloatArray | None = None
    ) -> tuple[ActionArray, FloatArray | None]:
        """Do what comes before the arena's step, and return what the arena is to be stepped with.

        `begin_step`, the arena's step and `end_step` are `step_batch`.
        """
        actions = self.checked_actions(actions)
        wheel_gain = checked_gain(wheel_gain, len(actions))
        self._rewards.remember()
        return actions, wheel_gain

    def end_step(self, tasks: CodeArray | None = None) -> BatchStep:
        """Return the result of a step, after the arena's; see `step_batch`. `tasks` is for wrappers."""
        if self._window is not None:
            self.render()
        return self.arena.obs, self._rewards.reward(), self._terminated, self.arena.tick >= self.max_cycles

    # Snapshots

    def snapshot(self) -> Snapshot:
        """Return the state of the run as a value, which does not change when the run goes on; it can be pickled.

        Random generators of the spaces are no part of it, nor attributes that a subclass adds.

        Raises:
            RuntimeError: before the first reset, or after a step that failed half done.
            SnapshotError: physics is "chipmunk", whose bodies cannot be copied.
        """
        return self.snapshot_through(())

    def restore(self, snapshot: Snapshot) -> dict[str, np.ndarray]:
        """Go back to a snapshot, of this environment or of one that was made alike; returns observations per agent.

        From here on the run goes on as it did from the snapshot, bit for bit, with the same actions. No reset is needed
        before. Arrays that were taken from the environment earlier, such as `env.swarm.position`, are not updated.

        Raises:
            SnapshotError: not a snapshot, or one of another scenario or stack of wrappers; nothing changes.
        """
        return self.per_agent(self.restore_batch(snapshot))

    def restore_batch(self, snapshot: Snapshot) -> ObsArray:
        """Restore at array level: as `restore`, but returns observations (N, D), a buffer that the next step reuses."""
        self.restore_through(snapshot, ())
        return self.last_obs

    def snapshot_through(self, wrappers: Sequence[Any]) -> Snapshot:
        """Return a snapshot of a stack: this environment and the wrappers around it, outermost first."""
        self.require_whole()
        arena, seed = self._world, self.seed_value
        assert seed is not None, "there is a world"
        own = {name: getattr(self, name) for name in _STATE}
        states = [own, dict(vars(arena)), *(wrapper.__getstate__() for wrapper in wrappers)]
        return take(self._origin(wrappers), seed, self.tick, states, self._parts(wrappers))

    def restore_through(self, snapshot: Snapshot, wrappers: Sequence[Any]) -> None:
        """Restore a stack: this environment and the wrappers around it, outermost first."""
        own, of_arena, *of_wrappers = read(snapshot, self._origin(wrappers), self._parts(wrappers))
        vars(self).update(own)
        self._is_half_done = False
        vars(self.arena).update(of_arena)
        for wrapper, state in zip(wrappers, of_wrappers, strict=True):
            wrapper.__setstate__(state)

    def _origin(self, wrappers: Sequence[Any]) -> Origin:
        return Origin(
            scenario=self.scenario,
            max_cycles=self.max_cycles,
            reads=self._reads,
            wrappers=tuple((type(wrapper).__qualname__, wrapper.made_from) for wrapper in wrappers),
        )

    def _parts(self, wrappers: Sequence[Any]) -> list[object]:
        """What a stack is made of, state aside."""
        configs = (wrapper.made_from for wrapper in wrappers if wrapper.made_from is not None)
        return [self, self.arena, self.scenario, self.layout, *wrappers, *configs]

    # Dict level

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Start a run; returns observations and infos per agent.

        Raises:
            ConfigError: there are `options`; this environment takes none.
        """
        no_options(options)
        return self.reset_through(self.reset_batch, seed)

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Advance one tick with one action per agent in `agents`; without agents and actions nothing happens."""
        return self.step_through(self.step_batch, actions)

    def reset_through(
        self, reset_batch: Callable[[int | None], ObsArray], seed: int | None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Reset by `reset_batch` (a wrapper's or our own) and unpack per agent."""
        return self.per_agent(reset_batch(seed)), self._infos(self.agents)

    def per_agent(self, obs: ObsArray) -> dict[str, np.ndarray]:
        """Return copies of the rows of observations (N, D) by agent, of those in `agents`."""
        rows = dict(zip(self.possible_agents, obs.copy(), strict=True))
        return {agent: rows[agent] for agent in self.agents}

    def step_through(
        self, step_batch: Callable[[ActionArray], BatchStep], actions: dict[str, np.ndarray]
    ) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Pack actions, step by `step_batch` (a wrapper's or our own) and unpack per agent."""
        agents = self.agents
        if is_over(agents, actions, is_reset=self.seed_value is not None):
            return {}, {}, {}, {}, {}
        obs, reward, terminated, truncated = step_batch(self._pack(actions))
        # One copy of the whole batch; the agents' rows are views of it and stay valid.
        rows = dict(zip(self.possible_agents, obs.copy(), strict=True))
        rewards = dict(zip(self.possible_agents, reward.tolist(), strict=True))
        terminations = dict(zip(self.possible_agents, terminated.tolist(), strict=True))
        if len(agents) < len(self.possible_agents):
            rows = {agent: rows[agent] for agent in agents}
            rewards = {agent: rewards[agent] for agent in agents}
            terminations = {agent: terminations[agent] for agent in agents}
        truncations = dict.fromkeys(agents, truncated)
        infos = self._infos(agents)
        if truncated:
            self.agents = []
        elif terminated.any():
            self.agents = [agent for agent in agents if not terminations[agent]]
        return rows, rewards, terminations, truncations, infos

    def _pack(self, actions: dict[str, np.ndarray]) -> ActionArray:
        agents = self.agents
        if not isinstance(actions, Mapping):
            raise ActionError(f"Expected actions as a dict by agent, got {type(actions).__name__}.")
        if actions.keys() != self._row_of.keys() and set(actions) != set(agents):
            missing = [agent for agent in agents if agent not in actions]
            foreign = [agent for agent in actions if agent not in agents]
            raise ActionError(
                f"Expected one action for each of the {len(agents)} agents in env.agents, "
                f"missing {missing[:3] or 'none'}, not in env.agents {foreign[:3] or 'none'}."
            )
        packed = self._actions
        complete = len(agents) == len(self.possible_agents)
        size = packed.shape[1]
        rows = packed if complete else np.empty((len(agents), size), np.float32)
        try:
            given = np.array([actions[agent] for agent in agents])  # a third of the time of numpy.stack
            if given.shape != rows.shape:  # copying would spread single numbers
                raise ValueError("another shape")
            np.copyto(rows, given, casting="same_kind")
        except (TypeError, ValueError) as error:
            shapes = {np.shape(actions[agent]) for agent in agents}
            raise ActionError(
                f"Expected each action as {size} numbers, shape ({size},), got shapes {sorted(shapes)}: {error}."
            ) from error
        if not complete:
            packed[:] = 0.0
            packed[[self._row_of[agent] for agent in agents]] = rows
        return packed

    def _infos(self, agents: list[str]) -> dict[str, dict[str, Any]]:
        active = dict(zip(self.possible_agents, self.active.tolist(), strict=True))
        return {agent: {"active": active[agent]} for agent in agents}

    def state(self) -> np.ndarray:
        """Global view of fixed size, (6 N + 3 M,) float32 in [-1, 1]; see `world.sensors`.

        Raises:
            RuntimeError: before the first reset.
        """
        return global_state(self.scenario.arena, self.swarm, self.objects)

    def render(self) -> np.ndarray | None:
        """Return a picture (height, width, 3) uint8 when created with render_mode="rgb_array", else None.

        With "human" the picture is shown in a window. When the user closes it, the run goes on unseen.
        """
        if self.render_mode is None:
            return None
        from swarm_forage_env.rendering.frame import render_frame  # an optional extra, imported only for a picture

        picture = render_frame(self.scenario, self.swarm, self.objects, self.caches, self.events, tick=self.tick)
        if self._window is None:
            return picture
        self._window.show(picture, title=self.scenario.name.replace("_", " "))
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()


def _new_window() -> "Window":
    from swarm_forage_env.rendering.window import Window  # an optional extra, imported only for a window

    return Window()
