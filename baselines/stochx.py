"""STOCHX: stochastic task allocation among seven tasks, with caches that the robots make themselves.

The tasks are those of STOCHM, and the Harvester and the Collector can each be partitioned once more. Cache Starters lay
objects down half way to the nest. Cache Finishers bring a second object there, which creates a cache. Cache Transferers
and Cache Collectors empty caches. `stoch_n1` draws what a robot does next; `task_machines` carries it out. Source:
STOCHX of the paper, section "Candidate Algorithms".
"""

from typing import ClassVar

from .task_policy import TaskPolicy
from .tasks import STOCHX_PARAMETERS, TaskParameters


class STOCHXPolicy(TaskPolicy):
    """Seven tasks around dynamic caches.

    See `TaskPolicy`.
    """

    caches: ClassVar[str] = "dynamic"
    default_parameters: ClassVar[TaskParameters] = STOCHX_PARAMETERS
    n_tabs: ClassVar[int] = 3
