"""The Policy protocol, and what a policy knows before a run.

A policy, scripted or trained, sees observations and never the state of the world. One exception is called what it is:
`Policy` says how a yardstick such as the oracle gets at the world. `baselines` imports only this folder,
`Quirks`, and the tools `compiling`, `rng` and `wording`, and nothing else of `swarm_forage_env`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.layout import (
    LayoutRow,
    ObservationLayout,
    messages_row,
    neighbours_row,
    observation_layout,
)
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, CELLS_PER_M, WHEEL_SCALE_MPS
from swarm_forage_env.scenarios.quirks import Quirks

COMMANDS = 3
"""First columns of an action: left wheel, right wheel, gripper. What a robot says comes after them."""


class ActionError(ValueError):
    """Actions of the wrong shape, or not finite."""


def refused_action(row: int, action: ActionArray, gain: FloatArray) -> ActionError:
    """Return the error about a robot whose action (A,) or wheel gain (2,) is not finite."""
    return ActionError(
        f"Expected finite actions and wheel gains, got {action.tolist()} and {gain.tolist()} for robot_{row}; the "
        "world was not stepped."
    )


def refused_tasks(tasks: CodeArray, n_robots: int) -> ValueError:
    """Return the error about tasks that are not one code of `Task` per robot."""
    return ValueError(
        f"Expected tasks with shape (n_robots,) = ({n_robots},) and codes of Task (0 to {len(Task) - 1}), "
        f"got shape {tasks.shape} with codes {np.unique(tasks).tolist()}."
    )


def as_actions(actions: ActionArray, n_robots: int, message_size: int = 0) -> ActionArray:
    """Return `actions` as a contiguous (N, A) float32 array, the same array if it is one; values are not checked.

    Args:
        actions: (N, A); where robots can say something, also (N, 3), which says zeros.
        n_robots: N.
        message_size: Numbers that a robot may say, A - 3.

    Raises:
        ActionError: values that are not numbers, or another shape.
    """
    expected = (n_robots, COMMANDS + message_size)
    columns = f"{COMMANDS} + message_size" if message_size else f"{COMMANDS}"
    wanted = f"Expected actions with shape (n_robots, {columns}) = {expected}"
    try:
        given = np.asarray(actions)
        if given.dtype.kind not in "biufO":  # numpy would convert texts, too; objects say themselves what they are
            raise TypeError(f"real numbers are needed, not {given.dtype}")
        checked = np.ascontiguousarray(given, np.float32)  # kernels are compiled for such arrays only
    except (TypeError, ValueError) as error:
        raise ActionError(f"{wanted}: {error}.") from error
    if message_size and checked.shape == (n_robots, COMMANDS):
        return np.pad(checked, ((0, 0), (0, message_size)))
    if checked.shape != expected:
        raise ActionError(f"{wanted}, got {checked.shape}; pass one row per robot, inactive ones included.")
    return checked


@dataclass(frozen=True, kw_only=True, slots=True)
class SwarmSpec:
    """What every policy knows before a run: constants of robot and world, no state. `of` takes them from a scenario."""

    n_robots: int
    n_objects: int
    dt_s: float
    horizon_s: float
    layout: ObservationLayout
    max_speed_mps: float
    """Limit of the centre speed."""
    max_wheel_difference_mps: float
    """Limit of right minus left wheel speed."""
    wheel_scale_mps: float
    """Wheel speed that an action of 1.0 commands."""
    wheel_base_m: float
    arena_size_m: tuple[float, float]
    cell_m: float
    nest_centre_m: tuple[float, float]
    nest_size_m: tuple[float, float]
    nest_boxes_m: tuple[tuple[float, float, float, float], ...]
    """x low, y low, x high, y high of every nest; the first is the one of `nest_centre_m` and `nest_size_m`."""
    has_obstacles: bool
    """Whether there is anything in the way but the outer walls."""
    placement: str
    caches: str
    """"none", "static" or "dynamic"."""
    cache_side_m: float
    """Side of a cache as built, an odd number of cells."""
    cache_half_side_cells: int
    """Cells of a cache on either side of its centre cell."""
    cache_side_nominal_m: float
    """0.2 max(X, Y); distances are derived from it."""
    min_dist_m: float
    """0.2 min(X, Y)."""
    cache_proximity_m: float
    """SITE and CREATE_CACHE drops are refused within this distance of a cache centre."""
    message_size: int
    """Numbers that a robot may say, columns of its action after `COMMANDS`."""
    quirks: Quirks

    @property
    def action_size(self) -> int:
        """Columns A of an action: the commands and what the robot says."""
        return COMMANDS + self.message_size

    @classmethod
    def of(cls, scenario: ScenarioConfig, *, horizon_s: float | None = None) -> "SwarmSpec":
        """Return the constants of a scenario; no environment is needed.

        Args:
            scenario: The configuration.
            horizon_s: Length of a run, s; default that of the scenario.
        """
        arena, robots = scenario.arena, scenario.robots
        nest_left, nest_bottom, nest_right, nest_top = arena.nest_box_m
        return cls(
            n_robots=robots.n_robots,
            n_objects=scenario.objects.n_objects,
            dt_s=scenario.dt_s,
            horizon_s=scenario.horizon_ticks * scenario.dt_s if horizon_s is None else horizon_s,
            layout=layout_for(scenario),
            max_speed_mps=robots.max_speed_mps,
            max_wheel_difference_mps=robots.max_wheel_difference_mps,
            wheel_scale_mps=WHEEL_SCALE_MPS,
            wheel_base_m=robots.wheel_base_m,
            arena_size_m=(arena.width_m, arena.height_m),
            cell_m=CELL_M,
            nest_centre_m=((nest_left + nest_right) / 2, (nest_bottom + nest_top) / 2),
            nest_size_m=(nest_right - nest_left, nest_top - nest_bottom),
            nest_boxes_m=arena.nest_boxes_m,
            has_obstacles=bool(arena.obstacles),
            placement=scenario.objects.placement,
            caches=scenario.caches,
            cache_side_m=scenario.cache_side_cells / CELLS_PER_M,
            cache_half_side_cells=scenario.cache_half_side_cells,
            cache_side_nominal_m=scenario.cache_side_nominal_m,
            min_dist_m=scenario.min_dist_m,
            cache_proximity_m=scenario.cache_proximity_m,
            message_size=robots.message_size,
            quirks=scenario.quirks,
        )


def state_size(n_robots: int, n_objects: int) -> int:
    """Return how many numbers there are in a global view: six per robot first, then three per object."""
    return 6 * n_robots + 3 * n_objects


def layout_for(scenario: ScenarioConfig) -> ObservationLayout:
    """Return the layout of a scenario's observations, with all slices that only some scenarios have."""
    robots, further = scenario.robots, list[LayoutRow]()
    if robots.neighbours_seen:
        further.append(neighbours_row(robots.neighbours_seen, robots.neighbour_range_m))
    if robots.message_size:
        further.append(messages_row(robots.message_size))
    arena = scenario.arena
    return observation_layout(arena.width_m, arena.height_m, scenario.objects.n_objects, tuple(further))


class RobotStates(NamedTuple):
    """What every robot of a policy is up to now, for people; see `Policy`."""

    activity: CodeArray
    """(N,) indices into `words`."""
    words: tuple[str, ...]
    """What an activity is called; the same all through a run."""


class Memories(NamedTuple):
    """Where all robots remember things, for people; see `Policy`. One row per place, in any order."""

    robot: IntArray
    """(K,) robot row."""
    place_m: FloatArray
    """(K, 2) m, middle of the cell of an object, or of a cache."""
    is_cache: BoolArray
    """(K,) whether a cache is remembered there, else an object."""

    @classmethod
    def of_cells(cls, robot: IntArray, cell: IntArray, *, is_cache: bool = False) -> "Memories":
        """Return objects, or caches, that robots (K,) remember in cells (K, 2)."""
        return cls(robot, np.divide(cell + 0.5, CELLS_PER_M, dtype=np.float64), np.full(len(robot), is_cache))

    @classmethod
    def together(cls, parts: "Iterable[Memories]") -> "Memories":
        """Return all places of several memories."""
        nothing = cls(np.zeros(0, np.int32), np.zeros((0, 2)), np.zeros(0, np.bool_))
        return cls(*(np.concatenate(columns) for columns in zip(nothing, *parts, strict=True)))

    def of_robot(self, row: int) -> tuple[FloatArray, FloatArray]:
        """Return where one robot remembers objects, (K, 2) m, and caches, (C, 2) m."""
        own = self.robot == row
        return self.place_m[own & ~self.is_cache], self.place_m[own & self.is_cache]


def sees_world(policy: object) -> bool:
    """Return whether a policy, or its class, takes the state of the world and not only observations; see `Policy`."""
    return hasattr(policy, "see_world")


@runtime_checkable
class Policy(Protocol):
    """Controls every robot at once. An instance drives one run; its memory is created by `reset`.

    Optional attributes: `task`, an (N,) int8 array of `Task` codes; `describe_robots() -> RobotStates`, what all robots
    are doing, and `describe_memories() -> Memories`, where they remember things (replays keep both for people);
    `see_world(env)`, called by runs after `reset` with the `ForageEnv`, which a policy may read and must not change: a
    policy that has it is a yardstick and no contestant, so that `check_policy` and the benchmark refuse it;
    `compiled() -> KernelPolicy | None`, for runs without Python between ticks (`KernelPolicy` has it); the class
    attributes `caches` ("none", "static", "dynamic": those that the policy is made for) and `reads` (names of the
    slices it looks at; default all; "light if carrying" = light only of robots that carry).
    """

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Prepare for one run."""
        ...

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions.

        Args:
            obs: (N, D) float32, read only. The array is reused by the environment: copy what must be kept.
            active: (N,) bool, read only, robots at work. Others are away: robots in repair still observe, those that
                are not in the world have rows of zeros, and no action of a robot at work depends on either.

        Returns:
            (N, 3) float32 in [-1, 1]: left wheel, right wheel, gripper. Where robots can send messages,
            (N, 3 + message_size); a policy that returns (N, 3) sends zeros. Rows of robots that are away are ignored,
            unless one comes back to work in this very tick: it acts by its row.
        """
        ...
