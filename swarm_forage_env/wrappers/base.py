"""SwarmWrapper: PettingZoo wrappers that work on arrays inside.

The dict API packs actions once, the whole stack runs on arrays, and observations are unpacked once, so a further
wrapper costs microseconds, not a pass over all agents.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pettingzoo.utils import BaseParallelWrapper

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.reset_and_step import no_options
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.env import BatchStep, ForageEnv
from swarm_forage_env.scenarios import config as configs
from swarm_forage_env.world.arena import UNDISTURBED
from swarm_forage_env.world.kernels.disturbances import Disturbances
from swarm_forage_env.world.snapshots import Snapshot
from swarm_forage_env.wrappers.waveform import gather_waveform

STACK_ORDER = (
    "RunRecorder",
    "SensorNoise",
    "PopulationDynamics",
    "Throttle",
    "ActuatorNoise",
    "HandlingCost",
    "ForageEnv",
)
"""The documented stack, outermost first; `SwarmWrapper.stack_position` counts along it."""
_STEPS = ("step", "step_batch", "begin_step", "end_step")
"""Methods of a wrapper that are called on the outermost one only."""
_HOOKS = ("before_step", "gain", "observe", "after_step")
"""Methods that are called on every wrapper in each step."""

_NO_REWARDS: ObsArray = np.zeros(0, np.float32)


def _refuse_unreadable(told: Disturbances, n_ticks: int) -> None:
    """Refuse what compiled code would read wrongly, or beyond its end; ValueError."""
    per_tick = {"throttles"} if len(told.throttles) else set[str]()
    per_tick |= {"wheel_factors"} if len(told.wheel_lanes) else set[str]()
    for name, expected in UNDISTURBED._asdict().items():
        value = getattr(told, name)
        if not isinstance(expected, np.ndarray):
            continue
        n_rows = n_ticks if name in per_tick else 0
        if (
            not isinstance(value, np.ndarray)
            or (value.dtype, value.ndim) != (expected.dtype, expected.ndim)
            or not value.flags.c_contiguous
            or len(value) < n_rows
        ):
            raise ValueError(
                f"Expected `ahead` to tell {name} as a contiguous array of {expected.dtype} with {expected.ndim} "
                f"dimensions and at least {n_rows} rows, got {np.shape(value)} of "
                f"{getattr(value, 'dtype', type(value))}."
            )


class SwarmWrapper(BaseParallelWrapper):
    """Base of all wrappers of this package; a subclass sets `stack_position` and overrides the hooks it needs.

    Hooks of one step, each called once per tick: `before_step` and `gain` from the outermost wrapper inwards, then
    the environment steps, then `observe` and `after_step` from the innermost wrapper outwards. A reset calls
    `on_reset` and `observe` from the innermost wrapper outwards. The wrapper that is stepped calls the hooks of all
    wrappers inside of it; their own `step_batch` is not called, so a wrapper that overrides it cannot be inside of
    another one. Wrappers never rewrite actions. They read the true
    state from `self.unwrapped` (`swarm`, `events`, `tick` ...) and change the world only by `set_population` and
    `set_handling_ticks` of `self.unwrapped`.

    A wrapper that can tell what its hooks will do may spare them in runs without Python between the ticks; see `ahead`.

    Snapshots, copies and pickles hold all attributes of a wrapper. One that has something which cannot be pickled, or
    should not go back to what it was, leaves it out by `__getstate__`.

    Attributes:
        env: The wrapped environment.
        made_from: Configuration of the wrapper, None for one without.
    """

    stack_position: ClassVar[int]
    """Place in `STACK_ORDER`; each place is taken at most once."""

    def __init__(self, env: "ForageEnv | SwarmWrapper", config: "WrapperConfig | None" = None) -> None:
        """Wrap `env`. Snapshots tell wrappers with different configurations apart.

        Raises:
            TypeError: `env` is neither a ForageEnv nor a SwarmWrapper. A wrapper from another library in between would
                be skipped without notice; wrap it around the whole stack instead. Or `env` is a SwarmWrapper that
                overrides `step_batch` or another method that would not be called.
            ConfigError: the stack would not be in the documented order.
        """
        if not isinstance(env, ForageEnv | SwarmWrapper):
            raise TypeError(
                f"Expected {type(self).__name__} to wrap a ForageEnv or a SwarmWrapper, got {type(env).__name__}; "
                "put other wrappers outside of the swarm wrappers."
            )
        if isinstance(env, SwarmWrapper):
            self._check_hooks_only(type(env))
        if isinstance(env, SwarmWrapper) and self.stack_position >= env.stack_position:
            raise ConfigError(
                f"Expected {type(env).__name__} not inside of {type(self).__name__}; the order, outermost first and "
                f"each at most once, is {', '.join(STACK_ORDER)}."
            )
        super().__init__(env)
        self.made_from = config
        self._inner = env
        self._unwrapped: ForageEnv = env.unwrapped
        self._inside: tuple[SwarmWrapper, ...] = env.stack if isinstance(env, SwarmWrapper) else ()
        hooks = SwarmWrapper.before_step, SwarmWrapper.gain
        self._acts_first = any((type(each).before_step, type(each).gain) != hooks for each in self.stack)

    def _check_hooks_only(self, inner: "type[SwarmWrapper]") -> None:
        replaced = [name for name in _STEPS if getattr(inner, name) is not getattr(SwarmWrapper, name)]
        if replaced:
            raise TypeError(
                f"Expected {inner.__name__} inside of {type(self).__name__} to override hooks only, got its own "
                f"{' and '.join(replaced)}, which would never be called; override {', '.join(_HOOKS)} instead."
            )

    @property
    def unwrapped(self) -> ForageEnv:
        """The ForageEnv at the bottom of the stack."""
        return self._unwrapped  # stored, because every hook of every tick needs it

    @property
    def stack(self) -> "tuple[SwarmWrapper, ...]":
        """All wrappers from this one inwards."""
        return (self, *self._inside)

    @property
    def last_obs(self) -> ObsArray:
        """(N, D) what the wrappers outside see since the last reset, step or restore; see `ForageEnv.last_obs`.

        Raises:
            RuntimeError: before the first reset of this wrapper.
        """
        self._require_reset()
        return self._last_obs

    def _require_reset(self) -> None:
        if not hasattr(self, "_last_obs"):
            raise RuntimeError(
                f"Expected a reset of the outermost wrapper first, got none, or one of what is inside of "
                f"{type(self).__name__} alone; call reset of what you step."
            )

    def on_reset(self, seed: int) -> None:
        """Prepare for a new run, after the environment was reset.

        Args:
            seed: Seed of the run, for `_internal.rng.stream_rng`.
        """

    def before_step(self) -> None:
        """Act on the environment before it steps."""

    def gain(self, actions: ActionArray, wheel_gain: FloatArray | None) -> FloatArray | None:
        """Return the wheel gain handed to the next wrapper inwards.

        Args:
            actions: (N, A) float32, the actions of this step, commands in the first three columns; read only.
            wheel_gain: (N, 2) factors on the left and right wheel speed from the wrappers outside, None = all 1.
                Write the product into your own array; never change this one.
        """
        return wheel_gain

    def observe(self, obs: ObsArray) -> ObsArray:
        """Return what the wrappers outside see instead of `obs`.

        Args:
            obs: (N, D) float32, rewritten by the environment in every step; may be changed in place.
        """
        return obs

    def after_step(self, tasks: CodeArray | None, terminated: BoolArray, truncated: bool) -> None:
        """Read the environment after its step.

        Args:
            tasks: (N,) `contract.codes.Task` codes as handed to `step_batch`, or None.
            terminated: (N,) bool, robots that are dead for good.
            truncated: Whether the horizon is reached.
        """

    def ahead(self, n_ticks: int) -> tuple[int, dict[str, Any]]:
        """Return for how many of the coming ticks, at most `n_ticks`, the hooks of a tick need not be called.

        And what is done in these ticks instead, as fields of `world.kernels.disturbances.Disturbances`, of its types;
        compiled code reads them unchecked but for type, order and number of ticks. With 0 the hooks are called in the
        coming tick. A wrapper without this method, and one whose hooks were replaced, has them
        called in all ticks.
        """
        return n_ticks, {}

    def count_ticks(self, n_ticks: int) -> None:
        """Note that ticks have passed as `ahead` said.

        For the last of them `observe` and `after_step` may yet be called, where Python had to end it.
        """

    @property
    def tells_ahead(self) -> bool:
        """Whether `ahead` speaks for the hooks: for those of the class that has it, none of them replaced."""
        teller = next(kind for kind in type(self).__mro__ if "ahead" in vars(kind))
        return not any(
            name in vars(self) or getattr(type(self), name) is not getattr(teller, name) for name in (*_HOOKS, "ahead")
        )

    def told_ahead(self, n_ticks: int) -> tuple[int, Disturbances]:
        """Return in how many ticks, at most `n_ticks`, no hook is needed from here inwards, and what happens in them.

        Raises:
            ValueError: a wrapper tells what compiled code cannot read.
        """
        fields: dict[str, Any] = {}
        for wrapper in self.stack:
            n_ticks, told = wrapper.ahead(n_ticks)
            if fields.keys() & told.keys() - {"gain"}:  # two of a kind: the compiled loop has place for one
                n_ticks = 0
            fields |= told
        # The last death may have come between two ticks; then the coming one ends the run.
        n_ticks = 0 if self._unwrapped.terminated.all() else max(0, n_ticks)
        disturbances = Disturbances(**fields)
        _refuse_unreadable(disturbances, n_ticks)
        return n_ticks, disturbances

    def pass_ticks(self, n_ticks: int, n_observed: int, tasks: CodeArray | None = None) -> None:
        """Note, from here inwards, that ticks have passed as `told_ahead` said.

        Args:
            n_ticks: How many.
            n_observed: After how many of them robots saw what wrappers let them see; Python has ended a further one.
            tasks: (N,) as in `step_batch`.
        """
        for wrapper in self.stack:
            wrapper.count_ticks(n_ticks)
        if n_observed < n_ticks:
            self._after(self.stepped(), tasks)

    def stepped(self) -> BatchStep:
        """Return the result of the environment's last step, without rewards."""
        env = self._unwrapped
        return env.arena.obs, _NO_REWARDS, env.terminated, env.tick >= env.max_cycles

    def interval_columns(self) -> dict[str, float]:
        """Return this wrapper's own columns of the run record for the recording interval that ends now.

        Called once at the end of each interval, after `after_step` of every wrapper inside the recorder; a mean
        over the interval starts anew with the call. The names must be the same at each call; their meanings are
        listed in `scenarios.columns.CONTRIBUTED_COLUMNS`.
        """
        return {}

    def reset_batch(self, seed: int | None = None) -> ObsArray:
        """Reset the stack and return the first observations, (N, D) float32; see `ForageEnv.reset_batch`."""
        obs = self._inner.reset_batch(seed)
        drawn = self.unwrapped.seed_value
        assert drawn is not None, "an environment that was reset has a seed"
        self.on_reset(drawn)
        self._last_obs = self.observe(obs)
        return self._last_obs

    def step_batch(
        self, actions: ActionArray, *, wheel_gain: FloatArray | None = None, tasks: CodeArray | None = None
    ) -> BatchStep:
        """Advance the stack by one tick; see `ForageEnv.step_batch`.

        Args:
            actions: (N, A) float32 in [-1, 1].
            wheel_gain: (N, 2) factors on the wheel speeds, None = all 1.
            tasks: (N,) int8 `contract.codes.Task` codes, None = the policy has no tasks.

        Raises:
            ActionError: as `ForageEnv.step_batch`, before any wrapper has done anything. Only a robot that comes back
                to work in this very tick is looked at later.
        """
        actions, wheel_gain = self._before(actions, wheel_gain)
        return self._after(self._unwrapped.step_batch(actions, wheel_gain=wheel_gain, tasks=tasks), tasks)

    def begin_step(
        self, actions: ActionArray, wheel_gain: FloatArray | None = None
    ) -> tuple[ActionArray, FloatArray | None]:
        """Do what comes before the arena's step, from here inwards; see `ForageEnv.begin_step`."""
        return self._unwrapped.begin_step(*self._before(actions, wheel_gain))

    def end_step(self, tasks: CodeArray | None = None) -> BatchStep:
        """Return the result of a step as seen from here, after the arena's; see `ForageEnv.end_step`."""
        return self._after(self._unwrapped.end_step(tasks), tasks)

    def _before(self, actions: ActionArray, wheel_gain: FloatArray | None) -> tuple[ActionArray, FloatArray | None]:
        env = self._unwrapped
        actions = env.checked_actions(actions)
        self._require_reset()
        if self._acts_first:
            env.refuse_bad_step(actions, wheel_gain)  # before any wrapper draws a number or lets a robot die
        try:
            for wrapper in self.stack:
                wrapper.before_step()
                wheel_gain = wrapper.gain(actions, wheel_gain)
        except Exception:
            env.break_off()
            raise
        return actions, wheel_gain

    def _after(self, step: BatchStep, tasks: CodeArray | None) -> BatchStep:
        obs, reward, terminated, truncated = step
        try:
            for wrapper in reversed(self.stack):
                obs = wrapper._last_obs = wrapper.observe(obs)
                wrapper.after_step(tasks, terminated, truncated)
        except Exception:
            self._unwrapped.break_off()
            raise
        return obs, reward, terminated, truncated

    def snapshot(self) -> Snapshot:
        """Return the state of the whole stack; see `ForageEnv.snapshot`."""
        return self.unwrapped.snapshot_through(self.stack)

    def restore(self, snapshot: Snapshot) -> dict[str, Any]:
        """Go back to a snapshot of a whole stack; returns observations per agent. See `ForageEnv.restore`."""
        return self.unwrapped.per_agent(self.restore_batch(snapshot))

    def restore_batch(self, snapshot: Snapshot) -> ObsArray:
        """Restore at array level and return the last observations, (N, D) float32; see `ForageEnv.restore_batch`."""
        self.unwrapped.restore_through(snapshot, self.stack)
        return self._last_obs

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Reset through the dict API; returns observations and infos by agent. See `ForageEnv.reset`."""
        no_options(options)
        return self.unwrapped.reset_through(self.reset_batch, seed)

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Step through the dict API; returns observations, rewards, terminations, truncations, infos by agent."""
        return self.unwrapped.step_through(self.step_batch, actions)


@dataclass(frozen=True, kw_only=True, slots=True)
class WrapperConfig:
    """A wrapper as data, part of a run's specification. Subclasses are frozen dataclasses of plain values."""

    name: ClassVar[str]
    """Name in stored specifications and in `wrappers.registry.WRAPPERS`."""
    wrapper: ClassVar[type[SwarmWrapper]]
    """What it is a configuration of."""
    waveform_field: ClassVar[str] = ""
    """The field that may hold a waveform, "" for none; plain values say it as `waveform.gather_waveform` reads it."""
    example: ClassVar[str] = ""
    """Settings as words of a command line that work with every scenario; errors show them."""

    def __init_subclass__(cls) -> None:
        """Refuse a class that does not say what it configures; TypeError."""
        if not hasattr(cls, "wrapper") and cls.wrap is WrapperConfig.wrap:
            raise TypeError(
                f"Expected {cls.__name__} to say what it is a configuration of; add a line "
                '"wrapper: ClassVar[type[SwarmWrapper]] = ..." with your subclass of SwarmWrapper.'
            )

    @property
    def stack_position(self) -> int:
        """Place of the wrapper in `STACK_ORDER`."""
        return self.wrapper.stack_position

    def wrap(self, env: ForageEnv | SwarmWrapper) -> SwarmWrapper:
        """Build the wrapper around `env`."""
        return self.wrapper(env, self)

    def in_words(self, dt_s: float) -> str:
        """Return the wrapper and its settings for people, in one line; pages show it.

        Args:
            dt_s: Length of a tick, for what is set per tick.
        """
        settings = ", ".join(
            f"{key} {'+'.join(map(str, value)) if isinstance(value, list | tuple) else value}"
            for key, value in self.to_mapping().items()
        )
        return f"{self.name.replace('_', ' ')}: {settings}"

    def to_mapping(self) -> dict[str, Any]:
        """Return the fields as plain values, ready for JSON."""
        return configs.to_mapping(self)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "WrapperConfig":
        """Build the configuration back from `to_mapping`; a class with other nested dataclasses overrides this.

        Raises:
            ConfigError: an unknown or missing key, or a value that the class refuses.
        """
        values = gather_waveform(mapping, cls.waveform_field, cls) if cls.waveform_field else dict(mapping)
        return configs.from_mapping(cls, values)


def wrap_in_order(env: ForageEnv, wrappers: Iterable[WrapperConfig]) -> ForageEnv | SwarmWrapper:
    """Put wrappers around an environment in the documented order, whatever the order of their configurations."""
    stack: ForageEnv | SwarmWrapper = env
    for config in sorted(wrappers, key=lambda config: config.stack_position, reverse=True):
        stack = config.wrap(stack)
    return stack


def steps_as_made(layer: ForageEnv | SwarmWrapper) -> bool:
    """Whether a layer steps as its class in this package does."""
    ours = SwarmWrapper.step_batch, ForageEnv.step_batch
    return type(layer).step_batch in ours and "step_batch" not in vars(layer)


def needs_no_python(env: ForageEnv, layers: Iterable[SwarmWrapper]) -> bool:
    """Whether several ticks can be one compiled call, but for those in which a layer has to act.

    They cannot with Chipmunk, an open window, neighbours or messages that the policy reads, a layer that does not tell
    what it does ahead, or a method that was replaced.
    """
    layers = tuple(layers)
    return (
        type(env) is ForageEnv
        and env.scenario.physics == "compiled"
        and env.render_mode != "human"
        and not env.arena.needs_python
        and all(layer.tells_ahead for layer in layers)
        and all(map(steps_as_made, (*layers, env)))
    )
