"""Numbers of the controllers that use caches and allocate tasks. Their graph is in the contract, beside the codes.

STOCHM knows the upper block of tasks only, STOCHX all three. Source: section "Candidate Algorithms" of the paper.
"""

import math
from dataclasses import dataclass

import numpy as np

from swarm_forage_env.contract.codes import DESTINATION, Goal, Grip, Tab, Task

from .object_choice import MemoryParameters
from .parameters import ParameterError
from .robots import DRAWS

(DRAW_ABORT, DRAW_MOVE, DRAW_PARTITION, DRAW_SWITCH, DRAW_POINT_X, DRAW_POINT_Y) = range(DRAWS, DRAWS + 6)
"""Draw columns beyond those of `machines`: giving up, moving the active block, subtask or root, switching subtasks,
and a random point (in a cache, or around a site)."""
TASK_DRAWS = DRAWS + 6

N_TASKS = len(Task)
"""Length of arrays indexed by task code; code 0 means no task."""
N_TABS = len(Tab)
NO_TAB = -1

ROOTED_TAB = np.array([Tab[task.name] if task.name in Tab.__members__ else NO_TAB for task in Task], np.int8)
"""(N_TASKS,) block whose root a task is, or NO_TAB."""
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
    site_scatter_m: float = 0.0125
    """Under the quirk `scattered_sites`, length a of the offsets a / u around the midpoint; measured."""
    site_scatter_at_border_m: float = 0.03
    """The same around a place at the border of what is allowed; measured."""
    far_site_share: float = 0.005
    """Under that quirk, probability of a random allowed point where the midpoint is allowed; measured."""
    far_site_share_at_border: float = 0.05
    """The same where it is not; measured."""
    creation_distance_m: float = 0.8
    """A Cache Finisher drops where it remembers an object this near; authors' program."""
    loose_creation_share: float = 0.15
    """Share of max(X, Y) at which a Cache Finisher arrives under the quirk `finisher_tolerance_mismatch`; study."""

    def __post_init__(self) -> None:
        # super() without arguments fails in a slots dataclass, because that is a new class.
        MemoryParameters.__post_init__(self)
        for name in ("estimate_weight", "least_abort_probability", "far_site_share", "far_site_share_at_border"):
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
