"""ForageEnv: the arena as a PettingZoo environment. It works on arrays; see `layer` for the dict API."""

from collections.abc import Collection
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from swarm_forage_env._internal.fields import instance, whole
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.policy import ActionError, SwarmSpec, as_actions, refused_action, state_size
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.layer import BatchStep, SwarmLayer
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.arena import ForagingArena
from swarm_forage_env.world.rewards import RewardModel
from swarm_forage_env.world.sensors import global_state
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState

if TYPE_CHECKING:
    from swarm_forage_env.rendering.window import Window


class NotResetError(RuntimeError, AttributeError):
    """There is no world yet; an AttributeError, too, so that `hasattr(env, "active")` is False before a reset."""


class ForageEnv(SwarmLayer, ParallelEnv[str, np.ndarray, np.ndarray]):
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
            max_cycles = whole("max_cycles (or None)", max_cycles, at_least=1)
        self.scenario = scenario
        self.render_mode = render_mode
        self._window = _new_window() if render_mode == "human" else None
        self.max_cycles = scenario.horizon_ticks if max_cycles is None else max_cycles
        self.arena = ForagingArena(scenario, reads=reads)
        self.reads = ("all",) if reads is None else tuple(sorted(set(reads)))
        n_robots = scenario.robots.n_robots
        self._terminated = np.zeros(n_robots, np.bool_)
        self.possible_agents = [f"robot_{row}" for row in range(n_robots)]
        self.agents: list[str] = []
        self._seeds: np.random.Generator | None = None  # not before it is used: copies draw runs of their own
        self.seed_value: int | None = None
        self._is_half_done = False

    # Spaces and constants

    @property
    def unwrapped(self) -> "ForageEnv":
        """The environment itself, at the bottom of every stack."""
        return self

    @property
    def stack(self) -> tuple[()]:
        """No wrappers are inside of the environment."""
        return ()

    @property
    def layout(self) -> ObservationLayout:
        """Named slices of an observation row."""
        return self.arena.layout

    def observation_space(self, agent: str) -> spaces.Box:
        """(D,) float32 in [-1, 1]; one space object per agent."""
        return self._spaces[agent][0]

    def action_space(self, agent: str) -> spaces.Box:
        """(A,) float32 in [-1, 1]: left wheel, right wheel, gripper, message; one space object per agent."""
        return self._spaces[agent][1]

    @cached_property  # made when asked for: runs of a policy never look, and there may be a million robots
    def _spaces(self) -> dict[str, tuple[spaces.Box, spaces.Box]]:
        seen, done = (self.layout.size,), (self.swarm_spec.action_size,)
        return {
            agent: (spaces.Box(-1.0, 1.0, seen, np.float32), spaces.Box(-1.0, 1.0, done, np.float32))
            for agent in self.possible_agents
        }

    @cached_property
    def state_space(self) -> spaces.Box:
        """Space of `state()`: (6 N + 3 M,) float32 in [-1, 1]."""
        return spaces.Box(-1.0, 1.0, (state_size(self.swarm_spec.n_robots, self.swarm_spec.n_objects),), np.float32)

    @cached_property
    def swarm_spec(self) -> SwarmSpec:
        """What every policy may know before a run."""
        return SwarmSpec.of(self.scenario, horizon_s=self.max_cycles * self.scenario.dt_s)

    @property
    def np_random(self) -> np.random.Generator:
        """Generator for wrappers of other libraries; a seed given to a reset starts it. Runs themselves draw elsewhere.

        It is that of the sequence of seeds: what is drawn from it changes the seeds of later resets without one.
        """
        if self._seeds is None:
            self._seeds = np.random.default_rng()
        return self._seeds

    # True state, for wrappers, recorders and pictures

    @property
    def _world(self) -> ForagingArena:
        """The arena; raises RuntimeError before the first reset."""
        self._require_reset()
        return self.arena

    def _require_reset(self) -> None:
        if self.seed_value is None:
            raise NotResetError(
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
        """Refuse every step and snapshot until a reset or a restore; the state can be read as it is.

        That is so from the begin of a tick to its end: whatever fails in between, Ctrl-C included, leaves it half done.
        """
        self._is_half_done = True

    def make_whole(self) -> None:
        """Take `break_off` back, at the end of a tick."""
        self._is_half_done = False

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
        return read_only(self._world.swarm.active)

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
        return read_only(self._terminated)

    @property
    def is_over(self) -> bool:
        """Whether the horizon is reached, or all robots are dead."""
        return self.arena.tick >= self.max_cycles or np.count_nonzero(self._terminated) == len(self._terminated)

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
        seed = checked_seed(seed)
        if seed is None:
            seed = int(self.np_random.integers(2**31))
        else:
            self._seeds = np.random.default_rng(seed)
        self.break_off()  # should the reset fail
        obs = self.arena.reset(seed)
        self._rewards = RewardModel(
            self.scenario.reward, self.scenario.arena.nest_centres_m, self.arena.swarm, self.arena.events
        )
        self.seed_value = seed
        self._terminated[:] = False
        self.agents = list(self.possible_agents)
        self.make_whole()
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
        return as_actions(actions, len(self._terminated), self.scenario.robots.message_size)

    def refuse_bad_step(self, actions: ActionArray, wheel_gain: FloatArray | None) -> None:
        """Refuse what the arena would refuse, for those who have to know it before they do anything.

        Args:
            actions: (N, A) as `checked_actions` returns them.
            wheel_gain: As in `step_batch`.

        Raises:
            ActionError: an action or gain of an active robot that is not finite.
        """
        # A sum of squares is finite only if all its numbers are; where it is not, which is rare, one looks at each.
        if isfinite(np.vdot(actions, actions)) and (wheel_gain is None or isfinite(np.vdot(wheel_gain, wheel_gain))):
            return
        gain = np.ones((len(actions), 2)) if wheel_gain is None else wheel_gain
        bad = self.active & ~(np.isfinite(actions).all(axis=1) & np.isfinite(gain).all(axis=1))
        if bad.any():
            row = int(np.argmax(bad))
            raise refused_action(row, actions[row], gain[row])

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
                finite; the world was not stepped.
            RuntimeError: before the first reset, or after a step that failed half done.
        """
        actions = self.checked_actions(actions)
        wheel_gain = checked_gain(wheel_gain, len(actions))
        self.break_off()
        try:
            step = self.advance(actions, wheel_gain, tasks)
        except ActionError:
            self.make_whole()
            raise
        self.make_whole()
        return step

    def advance(self, actions: ActionArray, wheel_gain: FloatArray | None, tasks: CodeArray | None) -> BatchStep:
        """Do what `step_batch` does with arguments that are checked; for whoever has begun a tick by `break_off`."""
        self._rewards.remember()
        obs = self.arena.step(actions, wheel_gain=wheel_gain, tasks=tasks)
        if self._window is not None:
            self.render()
        return obs, self._rewards.reward(), self._terminated, self.arena.tick >= self.max_cycles

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


def read_only(array: np.ndarray) -> np.ndarray:
    """Return a view of an array that nobody writes into by mistake."""
    view = array.view()
    view.flags.writeable = False
    return view


def checked_seed(seed: Any) -> int | None:
    """Return the seed of a run, None for none; raises ConfigError unless it is a whole number of at least 0."""
    return None if seed is None else whole("seed (or None)", seed, at_least=0)


def checked_gain(wheel_gain: FloatArray | None, n_robots: int) -> FloatArray | None:
    """Return factors on the wheel speeds, (N, 2) float64 or None; raises ActionError for what are none."""
    if wheel_gain is None:
        return None
    try:
        gain = np.ascontiguousarray(wheel_gain, np.float64)
    except (TypeError, ValueError) as error:
        raise ActionError(f"Expected wheel_gain as numbers, got {wheel_gain!r:.80}.") from error
    if np.shape(wheel_gain) != (n_robots, 2):
        raise ActionError(
            f"Expected wheel_gain with shape (n_robots, 2) = {(n_robots, 2)}, got {np.shape(wheel_gain)}."
        )
    return gain
