"""SwarmWrapper: PettingZoo wrappers that work on arrays inside.

The dict API packs actions once, the whole stack runs on arrays, and observations are unpacked once, so a further
wrapper costs microseconds, not a pass over all agents.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from pettingzoo.utils import BaseParallelWrapper

from swarm_forage_env._internal.fields import Checked, ConfigError, known_keys, read
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.env import ForageEnv, checked_gain
from swarm_forage_env.layer import BatchStep, SwarmLayer
from swarm_forage_env.scenarios.config import to_mapping
from swarm_forage_env.wrappers.waveform import Waveform

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
_STEPS = ("step", "step_batch")
"""Methods of a wrapper that are called on the outermost one only."""
_HOOKS = ("before_step", "gain", "observe", "after_step")
"""Methods that are called on every wrapper in each step."""

_WAVE_FIELDS = tuple(item.name for item in dataclasses.fields(Waveform) if item.name != "kind")


class SwarmWrapper(SwarmLayer, BaseParallelWrapper):
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
            replaced = [name for name in _STEPS if getattr(type(env), name) is not getattr(SwarmWrapper, name)]
            if replaced:
                raise TypeError(
                    f"Expected {type(env).__name__} inside of {type(self).__name__} to override hooks only, got its "
                    f"own {' and '.join(replaced)}, which would never be called; override {', '.join(_HOOKS)} instead."
                )
            if self.stack_position >= env.stack_position:
                raise ConfigError(
                    f"Expected {type(env).__name__} not inside of {type(self).__name__}; the order, outermost first "
                    f"and each at most once, is {', '.join(STACK_ORDER)}."
                )
        super().__init__(env)
        self.made_from = config
        self._inner = env
        self._unwrapped: ForageEnv = env.unwrapped
        self._inside: tuple[SwarmWrapper, ...] = env.stack if isinstance(env, SwarmWrapper) else ()

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

        With 0 the hooks are called in the coming tick. A wrapper without this method, and one whose hooks were
        replaced, has them called in all ticks. Wrappers of this package also return what is done in these ticks
        instead, as fields of `world.kernels.disturbances.Disturbances`; others return {}, because compiled code reads
        these arrays unchecked, maybe past their ends.
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
            actions: (N, A) float32 in [-1, 1]. Rows of robots that are away are ignored; one that comes back to work in
                this tick acts by its row.
            wheel_gain: (N, 2) factors on the wheel speeds, None = all 1.
            tasks: (N,) int8 `contract.codes.Task` codes, None = the policy has no tasks.

        Raises:
            ActionError: as `ForageEnv.step_batch`, before any wrapper has done anything. Only a robot that comes back
                to work in this very tick is looked at later.
        """
        env = self._unwrapped
        actions = env.checked_actions(actions)
        wheel_gain = checked_gain(wheel_gain, len(actions))
        self._require_reset()
        env.refuse_bad_step(actions, wheel_gain)  # before any wrapper draws a number or lets a robot die
        env.break_off()
        _, reward, terminated, truncated = env.advance(actions, self.before(actions, wheel_gain), tasks)
        obs = self.after(tasks)
        env.make_whole()
        return obs, reward, terminated, truncated

    def before(self, actions: ActionArray, wheel_gain: FloatArray | None = None) -> FloatArray | None:
        """Call the hooks that come before the arena's step, from here inwards; returns the wheel gain for it."""
        for wrapper in self.stack:
            wrapper.before_step()
            wheel_gain = checked_gain(wrapper.gain(actions, wheel_gain), len(actions))
        return wheel_gain

    def after(self, tasks: CodeArray | None) -> ObsArray:
        """Call the hooks that come after the arena's step, from the innermost outwards; returns what is seen here."""
        env = self._unwrapped
        obs, terminated, truncated = env.last_obs, env.terminated, env.tick >= env.max_cycles
        for wrapper in reversed(self.stack):
            obs = wrapper._last_obs = wrapper.observe(obs)
            wrapper.after_step(tasks, terminated, truncated)
        return obs

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)


@dataclass(frozen=True, kw_only=True, slots=True)
class WrapperConfig(Checked):
    """A wrapper as data, part of a run's specification. Subclasses are frozen dataclasses of plain values."""

    name: ClassVar[str]
    """Name in stored specifications and in `wrappers.registry.WRAPPERS`."""
    wrapper: ClassVar[type[SwarmWrapper]]
    """What it is a configuration of."""
    waveform_field: ClassVar[str] = ""
    """The field that may hold a waveform, "" for none."""
    example: ClassVar[str] = ""
    """Settings as words of a command line that work with every scenario; errors show them."""

    def __init_subclass__(cls) -> None:
        """Call the fields of a wrapper by its name in messages."""
        cls.called = getattr(cls, "name", "")

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
        raise NotImplementedError

    def to_mapping(self) -> dict[str, Any]:
        """Return the fields as plain values, ready for JSON."""
        return to_mapping(self)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "WrapperConfig":
        """Build the configuration back from `to_mapping`.

        A waveform is a table of its fields, or the name of its kind with its fields beside it, which is shorter:
        `{"waveform": "square", "amplitude": 0.2, "period_s": 5000}`.

        Raises:
            ConfigError: an unknown or missing key, or a value that the class refuses.
        """
        values, key = dict(mapping), cls.waveform_field
        if isinstance(kind := values.get(key), str):
            known_keys(values, (*(item.name for item in dataclasses.fields(cls)), *_WAVE_FIELDS), prefix=f"{cls.name}.")
            values[key] = {"kind": kind, **{name: values.pop(name) for name in _WAVE_FIELDS if name in values}}
        return read(cls, values, cls.name)


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


def needs_no_python(env: ForageEnv, layers: "tuple[SwarmWrapper, ...]") -> bool:
    """Whether several ticks can be one compiled call, but for those in which a layer has to act.

    They cannot with Chipmunk, an open window, neighbours or messages that the policy reads, a layer that does not tell
    what it does ahead, or a method that was replaced.
    """
    return (
        type(env) is ForageEnv
        and env.scenario.physics == "compiled"
        and env.render_mode != "human"
        and not env.arena.needs_python
        and all(layer.tells_ahead for layer in layers)
        and all(map(steps_as_made, (*layers, env)))
    )
