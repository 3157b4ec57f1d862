"""Tasks of the controllers that use caches: source and destination of each, the task graph, and all numbers.

    Generalist            free object    -> nest
      Harvester           free object    -> existing cache
        Cache Starter     free object    -> a site half way to the nest
        Cache Finisher    free object    -> an isolated object, where it creates a cache
      Collector           existing cache -> nest
        Cache Transferer  existing cache -> another existing cache
        Cache Collector   existing cache -> nest

A task with two subtasks is the root of a task allocation block (TAB): doing both subtasks once does the root's work
once. STOCHM knows the upper block only, STOCHX all three. Source: section "Candidate Algorithms" of the paper.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from swarm_forage_env.contract.codes import Grip, Task

from .object_choice import MemoryParameters
from .parameters import ParameterError
from .robots import DRAWS


class Goal(IntEnum):
    """What a robot takes an object from, or brings it to."""

    NONE = 0
    OBJECT = 1
    """A free object, by ground sensor or memory."""
    CACHE = 2
    """An existing cache."""
    NEST = 3
    SITE = 4
    """A place for a new cache."""
    ISOLATED_OBJECT = 5
    """A free object far from all others and from caches: the start of a new cache."""


class Tab(IntEnum):
    """Task allocation blocks, by root."""

    GENERALIST = 0
    HARVESTER = 1
    COLLECTOR = 2


(DRAW_ABORT, DRAW_MOVE, DRAW_PARTITION, DRAW_SWITCH, DRAW_POINT_X, DRAW_POINT_Y) = range(DRAWS, DRAWS + 6)
"""Draw columns beyond those of `machines`: giving up, moving the active block, subtask or root, switching subtasks,
and a random point (in a cache, or around a site)."""
TASK_DRAWS = DRAWS + 6

N_TASKS = len(Task)
"""Length of arrays indexed by task code; code 0 means no task."""
N_TABS = len(Tab)
NO_TAB = -1

TAB_ROOT = np.array([Task.GENERALIST, Task.HARVESTER, Task.COLLECTOR], np.int8)
"""(N_TABS,) task code of each block's root."""
TAB_CHILDREN = np.array(
    [(Task.HARVESTER, Task.COLLECTOR), (Task.STARTER, Task.FINISHER), (Task.TRANSFERER, Task.CACHE_COLLECTOR)], np.int8
)
"""(N_TABS, 2) task codes of each block's subtasks."""


def _by_task(values: dict[Task, int]) -> np.ndarray:
    return np.array([values[task] for task in Task], np.int8)


ROOTED_TAB = _by_task(
    {task: int(Tab[task.name]) if task.name in Tab.__members__ else NO_TAB for task in Task},
)
"""(N_TASKS,) block whose root a task is, or NO_TAB."""
SOURCE = _by_task(
    {
        Task.NONE: Goal.NONE,
        Task.GENERALIST: Goal.OBJECT,
        Task.HARVESTER: Goal.OBJECT,
        Task.COLLECTOR: Goal.CACHE,
        Task.STARTER: Goal.OBJECT,
        Task.FINISHER: Goal.OBJECT,
        Task.TRANSFERER: Goal.CACHE,
        Task.CACHE_COLLECTOR: Goal.CACHE,
    }
)
"""(N_TASKS,) `Goal` code of where a task takes its object from."""
DESTINATION = _by_task(
    {
        Task.NONE: Goal.NONE,
        Task.GENERALIST: Goal.NEST,
        Task.HARVESTER: Goal.CACHE,
        Task.COLLECTOR: Goal.NEST,
        Task.STARTER: Goal.SITE,
        Task.FINISHER: Goal.ISOLATED_OBJECT,
        Task.TRANSFERER: Goal.CACHE,
        Task.CACHE_COLLECTOR: Goal.NEST,
    }
)
"""(N_TASKS,) `Goal` code of where a task brings it."""
DROP_GRIP = np.array([Grip.SITE if goal == Goal.SITE else Grip.DELIVER for goal in DESTINATION], np.float32)
DROP_GRIP[Task.FINISHER] = Grip.CREATE_CACHE
"""(N_TASKS,) gripper command of a robot that waits to drop."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TaskParameters(MemoryParameters):
    """Numbers of a controller that allocates tasks and uses caches. Times are counted in control ticks.

    The equations that use the first four groups are in `stoch_n1`.
    """

    partition_reactivity: float
    """k of the probability of choosing a subtask instead of the root."""
    partition_offset: float = 1.25
    """Study."""
    partition_gamma: float
    """Scale of that probability; it is capped at 1."""

    subtask_reactivity: float
    """k of the probability of switching to the other subtask."""
    subtask_offset: float = 1.25
    """Study."""
    subtask_gamma: float
    """Scale of that probability."""

    tab_reactivity: float = 4.0
    """k of the probability of moving to a neighbouring block; study."""
    tab_offset: float = 3.0
    """Study."""
    tab_gamma: float = 0.5
    """Scale of that probability, and the probability itself where one of the blocks is balanced; study."""

    abort_reactivity: float = 4.0
    """k of the abort probability per tick; study."""
    abort_offset: float = 3.0
    """Execution time over estimate at which giving up is most likely; study."""
    abort_gamma: float = 1.0
    """Study."""
    least_abort_probability: float = 0.0001
    """Per tick, while a task has no active interface; authors' program."""

    generalist_estimate_low_ticks: float = 2000.0
    """Initial estimates of the Generalist's execution time are whole numbers drawn uniformly; study."""
    generalist_estimate_high_ticks: float = 4000.0
    """Study."""
    subtask_estimate_low_ticks: float = 1000.0
    """The same for every other task; study."""
    subtask_estimate_high_ticks: float = 2000.0
    """Study."""
    estimate_weight: float = 0.5
    """Weight of the newest execution time in the moving average; study."""

    smallest_cache: float
    """Robots take objects only from caches that they remember with at least this many."""
    cache_tolerance_m: float = 0.02
    """A robot this near to its point in a cache has arrived; authors' program."""
    cache_margin_m: float = 0.2
    """Points in a cache keep this far from its border; authors' program."""
    site_tolerance_m: float = 0.8
    """A robot this near to its cache site has arrived; authors' program."""
    site_jitter_m: float = 0.05
    """Largest random offset of a site at the border of what is allowed; our choice, far below the tolerance."""
    site_offset_low_m: float = 0.1
    """Smallest random offset of a site from the midpoint between robot and nest where that is allowed; our choice."""
    site_offset_high_m: float = 0.5
    """Largest such offset; our choice."""
    creation_distance_m: float = 0.8
    """A Cache Finisher drops where it remembers an object this near; authors' program."""
    loose_creation_share: float = 0.15
    """Share of max(X, Y) at which a Cache Finisher arrives under the quirk `finisher_tolerance_mismatch`; study."""

    def __post_init__(self) -> None:
        # super() without arguments fails in a slots dataclass, because that is a new class.
        MemoryParameters.__post_init__(self)
        for name in ("estimate_weight", "least_abort_probability"):
            if getattr(self, name) > 1.0:
                raise ParameterError(f"Expected {name} <= 1, got {getattr(self, name)}.")
        for name in ("generalist_estimate", "subtask_estimate"):
            low, high = getattr(self, f"{name}_low_ticks"), getattr(self, f"{name}_high_ticks")
            if math.ceil(low) > math.floor(high):
                raise ParameterError(
                    f"Expected a whole number between {name}_low_ticks and {name}_high_ticks, got {low} and {high}."
                )
        if self.site_offset_low_m > self.site_offset_high_m:
            raise ParameterError(
                f"Expected site_offset_low_m <= site_offset_high_m, got {self.site_offset_low_m} and "
                f"{self.site_offset_high_m}."
            )


STOCHM_PARAMETERS = TaskParameters(
    partition_reactivity=4.0,
    partition_gamma=1.75,
    subtask_reactivity=0.5,
    subtask_gamma=0.75,
    smallest_cache=0.0,
)
"""Numbers of STOCHM; study. Robots take from caches of any size."""

STOCHX_PARAMETERS = TaskParameters(
    partition_reactivity=1.0,
    partition_gamma=1.0,
    subtask_reactivity=1.0,
    subtask_gamma=1.0,
    smallest_cache=3.0,
)
"""Numbers of STOCHX; study."""
