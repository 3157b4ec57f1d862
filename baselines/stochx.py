"""STOCHX: stochastic task allocation among seven tasks, with caches that the robots make themselves.

The tasks of STOCHM, whose Harvester and Collector can each be partitioned once more: Cache Starters lay objects down
half way to the nest, Cache Finishers bring a second object there, which creates a cache; Cache Transferers and Cache
Collectors empty caches. What a robot does next is drawn by `stoch_n1`, how it does it is in `task_machines`. Source:
STOCHX of the paper, section "Candidate Algorithms".
"""

from typing import ClassVar

from .task_policy import TaskPolicy
from .tasks import STOCHX_PARAMETERS, TaskParameters


class STOCHXPolicy(TaskPolicy):
    """All seven tasks around dynamic caches; see `TaskPolicy`."""

    caches: ClassVar[str] = "dynamic"
    default_parameters: ClassVar[TaskParameters] = STOCHX_PARAMETERS
    n_tabs: ClassVar[int] = 3
