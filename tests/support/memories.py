"""What single robots of a scripted policy remember, and expect of tasks."""

from typing import Any

import numpy as np

from baselines.dpo import DPOPolicy
from baselines.memory import ObjectMemory, density
from baselines.task_policy import TaskPolicy


def objects_of(policy: DPOPolicy | TaskPolicy, robot: int) -> dict[int, tuple[int, int, float]]:
    """Object row -> (cell x, cell y, pheromone density)."""
    memory = policy._memory
    memory = memory if isinstance(memory, ObjectMemory) else memory.objects
    known = memory.known[robot, : policy._robots["n_known"][robot]].tolist()
    return {row: (x, y, _density(policy, robot, seen)) for row, x, y, seen, _ in known}


def caches_of(policy: TaskPolicy, robot: int) -> dict[int, tuple[int, int, int, float]]:
    """Serial -> (centre cell x, y, objects, pheromone density)."""
    caches = policy._memory.caches[robot, : policy._robots["n_caches"][robot]].tolist()
    return {serial: (x, y, count, _density(policy, robot, seen)) for x, y, serial, count, seen, *_ in caches}


def estimates_of(policy: TaskPolicy, robot: int) -> np.ndarray:
    """(8,) expected execution times in ticks, by `Task` code, a copy."""
    return policy._allocation.estimate[robot].copy()


def _density(policy: Any, robot: int, seen: int) -> float:
    return density(int(policy._robots["clock"][robot]) - seen, policy._constants[0].log_keep)
