"""STOCHM: stochastic task allocation among three tasks, with static caches half way to the nest.

A robot works as Generalist (free object to nest), as Harvester (free object to cache) or as Collector (cache to nest).
`stoch_n1` draws what it does next; `task_machines` carries it out. Source: STOCHM of the paper, section "Candidate
Algorithms".
"""

from typing import ClassVar

from .task_policy import TaskPolicy
from .tasks import STOCHM_PARAMETERS, TaskParameters


class STOCHMPolicy(TaskPolicy):
    """Three tasks around static caches.

    Robots work as Generalists, Harvesters and Collectors.

    See `TaskPolicy`.
    """

    caches: ClassVar[str] = "static"
    default_parameters: ClassVar[TaskParameters] = STOCHM_PARAMETERS
    n_tabs: ClassVar[int] = 1
