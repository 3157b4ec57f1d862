"""What a learner sees and does: a choice of observations and actions.

The environment itself has observations (N, D) and actions (N, A): commands, and messages if there are any. A learner
may prefer fewer columns, numbered actions or a gripper that works by itself. Training environments and trained policies
use the same translation, so a policy runs exactly as it was trained.
"""

import copy
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, get_args

import numpy as np
from gymnasium import spaces
from msgspec import Meta

from swarm_forage_env._internal.compiling import Calls
from swarm_forage_env._internal.fields import Amount, Checked, ConfigError, Count, Positive, Whole, read
from swarm_forage_env._internal.held import hold
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.kernel_policy import Driver
from swarm_forage_env.contract.layout import (
    BUILT_IN_SLICES,
    MESSAGES,
    NEIGHBOURS,
    ObservationLayout,
    layout_of,
    messages_row,
    neighbours_row,
)
from swarm_forage_env.contract.policy import COMMANDS, ActionError, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.policies.compact_layout import COMPACT_READS, SITE_ROWS, columns_of, compact_layout
from swarm_forage_env.policies.frames import frames_of
from swarm_forage_env.policies.kernels.frames import frame_of
from swarm_forage_env.policies.kernels.learner import (
    GRIP_COMMANDS,
    MOTION_WHEELS,
    N_GRIPS,
    N_MOTIONS,
    N_SITES,
    SITE_COLUMNS,
    SiteMemory,
    Translation,
    mask_actions,
    new_site_memory,
)
from swarm_forage_env.policies.kernels.network import carry_out, keep_on, see
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario

Observation: TypeAlias = Literal["full", "compact"]
OBSERVATIONS = get_args(Observation)
Actions: TypeAlias = Literal["continuous", "discrete"]
ACTIONS = get_args(Actions)
EXTRA = "extra"
"""Name of the slice with the columns of the user's `extra_observation`."""
MOST_EXTRA_COLUMNS = 1024
"""Our choice: an observation of the package itself has about 140."""

MOTIONS = tuple(MOTION_WHEELS)
"""Discrete actions that move, in order."""
GRIPS = tuple(GRIP_COMMANDS)
"""Discrete actions of the gripper, in order after the motions; the wheels stand."""


@dataclass(frozen=True, kw_only=True, slots=True)
class InterfaceConfig(Checked):
    """Choices of a learner, plain values.

    Raises:
        ConfigError: an unknown word, or a number of ticks below 1.
    """

    called: ClassVar[str] = "interface"

    observation: Observation = "full"
    """"full": the (D,) row of the environment; "compact": the columns of `compact_layout`."""
    actions: Actions = "continuous"
    """"continuous": left wheel, right wheel, unless automatic gripper, and the message, in [-1, 1]; "discrete": a
    number, see `MOTIONS` and `GRIPS`."""
    automatic_gripper: bool = False
    """Grasp when empty and over an object or a cache, deliver when carrying in the nest; the learner only drives."""
    decision_ticks: Whole = 1
    """Ticks for which an action is kept; rewards add up. An automatic gripper decides in every tick."""
    neighbours_seen: Count | None = None
    """How many neighbours the learner sees, as many as its scenario shows, or 0. Where nothing is said (None),
    environments and trainings fill in those of their scenario, and a policy sees none."""
    neighbour_range_m: Positive | None = None
    """How far it sees them: what a column of 1.0 means. None: as for `neighbours_seen`."""
    message_size: Count | None = None
    """Numbers of the messages that the learner sends and hears, as many as in its scenario, or 0: it says zeros and
    hears nothing. None: as for `neighbours_seen`. Messages need continuous actions."""
    site_memory: bool = False
    """Two places that a robot remembers, see `policies.kernels.learner`: eight more columns."""
    hearing_m: Amount = 0.0
    """Distance within which robots tell each other where they picked up last. 0: they do not."""
    frame_decisions: Count = 0
    """Decisions for which each robot sees the world in a frame of its own, turned and mirrored in one of eight ways,
    before it takes another, see `policies.kernels.frames`. 0: all see the world as it is."""
    without: tuple[str, ...] = ()
    """Slices of what it sees that are 0 throughout: ("position", "heading") are robots without GPS and compass."""
    extra_columns: Annotated[int, Meta(ge=0, le=MOST_EXTRA_COLUMNS)] = 0
    """Columns K of the user's `extra_observation`, which come last; environments and trainings fill them in."""

    def check(self) -> None:
        """Refuse messages of discrete actions, frames of what only its author can turn, and memory without places."""
        if self.message_size and self.actions != "continuous":
            raise ConfigError(
                f"Expected interface.actions 'continuous' for messages of {self.message_size} numbers, got "
                f"{self.actions!r}; choose continuous actions, or message_size=0 for a learner without messages."
            )
        if self.extra_columns and self.frame_decisions:
            raise ConfigError(
                f"Expected interface.frame_decisions of 0 beside extra_observation, because only its author knows what "
                f"a turn does to it, got {self.frame_decisions}; give interface={{'frame_decisions': 0}}."
            )
        if self.hearing_m and not self.site_memory:
            raise ConfigError("Expected site_memory for hearing_m: robots tell each other what they remember.")
        if self.site_memory and {"position", "heading"} & {*self.without}:
            raise ConfigError("Expected position and heading for site_memory, which needs both; got interface without.")

    def decisions_in(self, ticks: int) -> int:
        """Return how many decisions there are in so many ticks of a run, with one that its end cuts short."""
        return -(-ticks // self.decision_ticks)

    def for_scenario(self, scenario: ScenarioConfig) -> "InterfaceConfig":
        """Return these choices, with what the scenario has of neighbours and messages unless told.

        What a scenario does not have stays None.

        Raises:
            ConfigError: discrete actions in a scenario with messages, of which nothing was said.
        """
        robots, found = scenario.robots, dict[str, Any]()
        if self.neighbours_seen is None and robots.neighbours_seen:
            found["neighbours_seen"] = robots.neighbours_seen
        if self.neighbour_range_m is None and found.get("neighbours_seen", self.neighbours_seen):
            found["neighbour_range_m"] = robots.neighbour_range_m
        if self.message_size is None and robots.message_size:
            found["message_size"] = robots.message_size
        return replace(self, **found) if found else self

    @property
    def sensors(self) -> tuple[str, ...]:
        """The slices of the environment that are seen beside those of every observation: neighbours, messages."""
        optional = {NEIGHBOURS: self.neighbours_seen, MESSAGES: self.message_size}
        return tuple(name for name, wanted in optional.items() if wanted)

    @property
    def reads(self) -> tuple[str, ...] | None:
        """Observation slices that are used, None = all; the value for `ForageEnv(reads=...)`."""
        return (*COMPACT_READS, *self.sensors) if self.observation == "compact" else None


def _check_rows(name: str, rows: np.ndarray, shape: tuple[int, int]) -> None:
    """Refuse an array of another shape, type or order in memory than compiled code takes."""
    if rows.shape != shape or rows.dtype != np.float32 or not rows.flags.c_contiguous:
        order = "" if rows.flags.c_contiguous else ", not contiguous"
        raise ValueError(
            f"Expected {name} as contiguous float32 of shape {shape}, got {rows.dtype} of shape {rows.shape}{order}; "
            "np.ascontiguousarray(rows, np.float32) makes such an array."
        )


class LearnerInterface:
    """Translates between a swarm and a learner that controls all robots in the same way.

    Attributes:
        config: The choices.
        layout: Columns of what the learner sees.
        hidden: Those of them that are 0 throughout, see `InterfaceConfig.without`.
        translation: What kernels need for both ways.
        observation_space: Box of one robot's row, (d,) float32 in [-1, 1].
        action_space: Box or Discrete of one robot's action.
    """

    def __init__(self, config: InterfaceConfig, spec: SwarmSpec) -> None:
        """Bind the choices to a swarm.

        Args:
            config: The choices.
            spec: The swarm: `SwarmSpec.of(scenario)`, or `swarm_spec` of an environment.
        """
        self.config = config
        self._n_choices = N_MOTIONS if config.automatic_gripper else N_MOTIONS + N_GRIPS
        self._dynamic_caches = spec.caches == "dynamic"
        source = spec.layout
        start = {part.name: part.start for part in source}
        self._mask_starts = (
            start["ground"],
            start["carrying"],
            start["interacting"],
            start["active"],
            start["los_object"],
        )
        self._commands = np.zeros((spec.n_robots, spec.action_size), np.float32)
        self.layout = learner_layout(source, config)
        self.hidden = columns_of(self.layout, config.without)
        self._n_columns = source.size
        own = columns_of(source, config.sensors)
        half_x, half_y = source.part("position").scale
        self.translation = Translation(
            is_compact=config.observation == "compact",
            is_discrete=config.actions == "discrete",
            grips_itself=config.automatic_gripper,
            has_memory=config.site_memory,
            behind_counts=spec.quirks.obstacle_behind_counts,
            decision_ticks=config.decision_ticks,
            n_shown=self.layout.size - len(own) - config.extra_columns - N_SITES * SITE_COLUMNS * config.site_memory,
            n_driven=2 if config.automatic_gripper else COMMANDS,
            own_columns=own,
            view_starts=tuple(start[name] for name in COMPACT_READS),
            pose_starts=(start["position"], start["heading"]),
            cargo_starts=(start["carrying"], start["los_cell"], start["los_object"]),
            grip_starts=(start["ground"], start["carrying"], start["los_object"]),
            half=(float(half_x), float(half_y)),
            hearing_m=float(config.hearing_m),
            sites=new_site_memory(spec.n_robots),
            frames=frames_of(config.frame_decisions, self.layout, spec.n_robots),
            wheels=_wheels_of(spec),
            grips=np.array(list(GRIP_COMMANDS.values()), np.float32),
        )
        self.observation_space = self.new_observation_space()
        self.action_space = self.new_action_space()
        self._actions_shape = (spec.n_robots, *(self.action_space.shape or ()))
        n_values = 0 if self.translation.is_discrete else self._actions_shape[1]
        self._chosen = np.zeros(spec.n_robots, np.int32), np.zeros((spec.n_robots, n_values), np.float32)
        self._call = Calls()

    def new_observation_space(self) -> spaces.Box:
        """Return a new space, with its own random state, for one robot's row."""
        return spaces.Box(-1.0, 1.0, (self.layout.size,), np.float32)

    def new_action_space(self) -> spaces.Box | spaces.Discrete:
        """Return a new space, with its own random state, for one robot's action."""
        if self.translation.is_discrete:
            return spaces.Discrete(self._n_choices)
        return spaces.Box(-1.0, 1.0, (self.translation.n_driven + (self.config.message_size or 0),), np.float32)

    @property
    def widths(self) -> tuple[int, int]:
        """Columns that a robot sees, and numbers that a network gives for its action."""
        space = self.action_space
        return self.layout.size, int(space.n) if isinstance(space, spaces.Discrete) else space.shape[0]

    @property
    def active_column(self) -> int:
        """Column of what the learner sees that is 1 for robots at work, 0 for all others."""
        return self.layout.part("active").start

    def forget(self) -> None:
        """Forget what robots remember, and let them have the frames of the first decision: a run begins."""
        for part in self.translation.sites:
            part[...] = 0
        frames = self.translation.frames
        if frames.length:
            frames.taken[:] = [frame_of(robot, 0, frames.length) for robot in range(len(frames.taken))]

    def memory(self) -> SiteMemory | None:
        """Return a copy of what robots remember; None without memory."""
        return copy.deepcopy(self.translation.sites) if self.config.site_memory else None

    def observe(
        self,
        obs: ObsArray,
        out: ObsArray | None = None,
        *,
        decision: int | None = None,
        extra: FloatArray | None = None,
    ) -> ObsArray:
        """Return what the learner sees, a new array or `out`; with `site_memory`, robots remember it.

        Args:
            obs: (N, D) observations of the environment, in each decision of a run.
            out: (N, d) float32 to write into.
            decision: How many decisions of the run came before; `frame_decisions` needs it.
            extra: (N, K) what the user's `extra_observation` returned; `extra_columns` needs it.

        Raises:
            ValueError: arrays of another shape or type; robots have frames of their own, and the decision is not told;
                another number of rows than robots, where they have these or memories; or other extra columns than
                `extra_columns`.
        """
        _check_rows("observations", obs, (len(obs), self._n_columns))
        if out is not None:
            _check_rows("out", out, (len(obs), self.layout.size))
            if not out.flags.writeable:
                raise ValueError("Expected out as an array that can be written to; give a copy.")
        n_extra = 0 if extra is None else extra.shape[1]
        if n_extra != self.config.extra_columns:
            raise ValueError(
                f"Expected {self.config.extra_columns} columns of extra_observation, which the learner sees, got "
                f"{n_extra}."
            )
        n_robots = len(self._commands)
        if (self.translation.has_memory or self.config.frame_decisions) and len(obs) != n_robots:
            raise ValueError(f"Expected observations of {n_robots} robots, each with its row, got {len(obs)} rows.")
        if decision is None and (self.config.frame_decisions or self.config.hearing_m):
            raise ValueError(
                "Expected the number of decisions before this one, which says what frames robots have and how old news "
                "are, got none; call observe(observations, decision=...)."
            )
        if out is None:
            out = np.empty((len(obs), self.layout.size), np.float32)
        self.show(obs, out, decision or 0, extra)
        return out

    def show(self, obs: ObsArray, out: ObsArray, decision: int, extra: FloatArray | None) -> None:
        """Do what `observe` does with arrays that are known to be right, for arenas; `obs` is contiguous."""
        if extra is not None:
            out[:, -extra.shape[1] :] = extra
        self._call(see, obs, decision, self._held, out)
        if self.hidden.size:
            out[:, self.hidden] = 0.0

    def command(self, actions: np.ndarray, obs: ObsArray) -> ActionArray:
        """Return actions of the environment, (N, A) float32, in a reused buffer.

        Args:
            actions: (N,) whole numbers or (N, k) float, as `action_space` says, one row per robot.
            obs: (N, D) observations of the environment in the tick in which the commands are carried out.

        Raises:
            ActionError: another shape, or a number outside of `action_space`.
            ValueError: observations of another shape or type.
        """
        _check_rows("observations", obs, (len(self._commands), self._n_columns))
        return self.carry_out(self.checked(actions), obs)

    def checked(self, actions: np.ndarray) -> np.ndarray:
        """Return actions as `carry_out` takes them; arguments and errors as those of `command`."""
        if actions.shape != self._actions_shape:
            raise ActionError(
                f"Expected actions with shape {self._actions_shape}, one row per robot as in {self.action_space}, "
                f"got {actions.shape}."
            )
        if not self.translation.is_discrete:
            return actions
        most = self._n_choices - 1
        expected = f"Expected actions as whole numbers from 0 to {most}, got"
        if actions.dtype.kind not in "iu":
            raise ActionError(f"{expected} {actions.dtype}.")
        if actions.min() < 0 or actions.max() > most:
            raise ActionError(f"{expected} {actions.min()} to {actions.max()}.")
        return np.ascontiguousarray(actions, np.int32)

    def resting(self, actions: np.ndarray, away: BoolArray, carrying: BoolArray) -> np.ndarray:
        """Return checked actions in which robots that are away (N,) stand and hold what they carry, should they come.

        So rows of robots that are not at work never act, a decision of many ticks long.
        """
        actions = actions.copy()
        actions[away] = 0  # to stand, if it is a number
        if not (self.translation.is_discrete or self.translation.grips_itself):
            actions[away, COMMANDS - 1] = np.where(carrying[away], Grip.GRASP, Grip.RELEASE)
        return actions

    def carry_out(self, actions: np.ndarray, obs: ObsArray) -> ActionArray:
        """Do what `command` does with actions that were checked, which may last for several ticks.

        Args:
            actions: What `checked` returned.
            obs: As in `command`.
        """
        self._call(carry_out, np.ascontiguousarray(obs), self._held, *self._kept(actions), self._commands)
        return self._commands

    def driver(self, actions: np.ndarray) -> Driver:
        """Return what does in the compiled loop of the world what `carry_out` does with these actions, tick by tick."""
        self._kept(actions)
        return self._driver

    def _kept(self, actions: np.ndarray) -> tuple[IntArray, ObsArray]:
        """Keep actions in the buffers that kernels read, and return both; only one of them is in use."""
        number, values = self._chosen
        np.copyto(number if self.translation.is_discrete else values, actions, casting="same_kind")
        return number, values

    @cached_property
    def _held(self) -> Translation:
        return hold(self.translation)

    @cached_property
    def _driver(self) -> Driver:
        return _Decision(self.config.decision_ticks, self._held, *self._chosen, self._commands)

    def mask(self, obs: ObsArray) -> BoolArray:
        """Return which discrete actions make sense, (N, number of actions) bool; at least one per row.

        Motions during an interaction and gripper actions that would be refused make no sense. Robots that are not at
        work may only stand.

        Args:
            obs: (N, D) observations of the environment.

        Raises:
            ValueError: the actions are continuous, or observations of another shape or type.
        """
        _check_rows("observations", obs, (len(obs), self._n_columns))
        if not self.translation.is_discrete:
            raise ValueError("Expected discrete actions: continuous ones have no mask. Set actions='discrete'.")
        mask = np.empty((len(obs), self._n_choices), np.bool_)
        mask_actions(obs, self._mask_starts, self._dynamic_caches, mask)
        return mask


class _Decision(Driver):
    """What a learner has decided."""

    _kernel = staticmethod(keep_on)

    def __init__(self, decision_ticks: int, *state: Any) -> None:
        self.decision_ticks, self.calls = decision_ticks, (Calls(), Calls())
        self._take(*state)


def _wheels_of(spec: SwarmSpec) -> ActionArray:
    """Return the wheel commands of motions, (N_MOTIONS, 2): `MOTION_WHEELS` are those of robots of 0.1 m/s."""
    share = 2.0 * spec.max_speed_mps / spec.wheel_scale_mps
    return np.clip(share * np.array([*MOTION_WHEELS.values()]), -1.0, 1.0).astype(np.float32)


def any_swarm(config: InterfaceConfig) -> LearnerInterface:
    """Return the choices bound to some swarm that shows what they see: columns and actions are the same in all."""
    company = {name: getattr(config, name) for name in ("neighbours_seen", "neighbour_range_m", "message_size")}
    shown = {name: value for name, value in company.items() if value is not None}
    return LearnerInterface(config, SwarmSpec.of(scenario("warehouse_small", **shown)))


@lru_cache(maxsize=64)  # a curriculum may ask for a new size in every run
def learner_layout(source: ObservationLayout, config: InterfaceConfig) -> ObservationLayout:
    """Return the layout of what a learner sees.

    Args:
        source: Layout of the environment's observations.
        config: The learner's choices.

    Raises:
        ConfigError: the environment lacks a sensor that the learner wants.
    """
    _check_company(source, config)
    if config.observation == "compact":
        built_in = [part.row for part in compact_layout(source)]
    elif source.names == (*BUILT_IN_SLICES, *config.sensors) and not (config.site_memory or config.extra_columns):
        return source
    else:
        built_in = [part.row for part in source if part.name in BUILT_IN_SLICES]
    if config.site_memory:
        built_in += SITE_ROWS
    extra = [(EXTRA, (1.0,) * config.extra_columns, "", "extra_observation of the user")] * bool(config.extra_columns)
    return layout_of([*built_in, *(source.part(name).row for name in config.sensors), *extra])


def _check_company(source: ObservationLayout, config: InterfaceConfig) -> None:
    """Refuse a scenario with other neighbours or messages than the learner knows."""
    rows = {part.name: part.row for part in source}
    n_seen, size = config.neighbours_seen or 0, config.message_size or 0
    _, scale, _, shown = rows.get(NEIGHBOURS, (NEIGHBOURS, (1.0,), "", "none"))
    range_m = scale[0] if config.neighbour_range_m is None else config.neighbour_range_m
    if n_seen and rows.get(NEIGHBOURS) != neighbours_row(n_seen, range_m):
        raise ConfigError(
            f"Expected a scenario that shows the neighbours which the policy sees, got {shown}; give the scenario "
            f"neighbours_seen={n_seen} and neighbour_range_m={range_m:g}."
        )
    if size and rows.get(MESSAGES) != messages_row(size):
        there = source.part(MESSAGES).size - 1 if MESSAGES in rows else 0
        raise ConfigError(
            f"Expected a scenario with messages of {size} numbers, which the policy sends, got {there}; give the "
            f"scenario message_size={size}."
        )


GivenInterface: TypeAlias = InterfaceConfig | Mapping[str, Any] | None
"""Type of the argument `interface` of environments; see `chosen_interface`."""


def chosen_interface(given: GivenInterface, default: InterfaceConfig | None = None) -> InterfaceConfig:
    """Return the configuration for an argument `interface`.

    Args:
        given: A configuration, fields by name, or None for the default.
        default: Gives the fields that are not named; None = `InterfaceConfig()`.

    Raises:
        ConfigError: `given` is none of these, or has an unknown field or value.
    """
    if isinstance(given, InterfaceConfig):
        return given
    default = default or InterfaceConfig()
    if given is None:
        return default
    if isinstance(given, Mapping):
        return read(InterfaceConfig, {**asdict(default), **given}, "interface")
    raise ConfigError(
        f"Expected interface as an InterfaceConfig or its fields by name, such as {{'actions': 'discrete'}}, "
        f"got {given!r}."
    )
