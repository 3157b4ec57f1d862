"""A robot under STOCHM or STOCHX whose observations, task and memory a test arranges by hand."""

from typing import Any

import numpy as np

from baselines.cache_memory import OneTaskMemory, remember_cache
from baselines.dpo import DPOPolicy
from baselines.machines import restart_acquiring
from baselines.memory import ObjectMemory, OneMemory, density, remember
from baselines.robots import Activity, VectorState, sense
from baselines.stochx import STOCHXPolicy
from baselines.task_policy import TaskPolicy
from baselines.tasks import ROOTED_TAB
from swarm_forage_env.contract.codes import TAB_CHILDREN, Task
from swarm_forage_env.contract.layout import SERIAL_SCALE
from tests.support.observations import Observations, make_spec


class TaskRobot:
    """A single robot that faces +x at (10.1, 10.1), in the 32 x 16 m warehouse with caches of 6.2 m."""

    def __init__(self, policy: TaskPolicy | None = None, **changes: Any) -> None:
        self.seen = Observations(make_spec(**{"caches": "dynamic", **changes}))
        self.seen.pose(10.1, 10.1)
        self.policy = policy or STOCHXPolicy()
        self.policy.reset(self.seen.spec, np.random.default_rng(5))

    def act(self, ticks: int = 1, active: bool = True) -> np.ndarray:
        """Act on the current observation; returns the last action."""
        for _ in range(ticks):
            action = self.policy.act(self.seen.array, np.array([active]))[0].copy()
        return action

    def start(self, task: Task) -> np.ndarray:
        """Let the robot begin with a task of our choice, and repeat subtasks; returns its first action."""
        a = self.policy._allocation
        tab = next((k for k, children in enumerate(TAB_CHILDREN) if task in children), int(ROOTED_TAB[task]))
        is_child = task in TAB_CHILDREN[tab]
        partition = a.partition[0, tab]
        a.task[0], a.tab[0] = Task.NONE, tab
        a.partition[0, tab] = 1.0 if is_child else 0.0
        if is_child:
            a.last_child[0, tab] = TAB_CHILDREN[tab].tolist().index(task)
        self.policy._constants["subtask_gamma"] = 0.0
        restart_acquiring(self.record)
        action = self.act()
        assert self.task is task
        a.partition[0, tab] = partition
        return action

    def finish_soon(self) -> None:
        """Nothing but finishing ends the current task."""
        self.policy._allocation.p_abort[:] = 0.0

    @property
    def record(self) -> np.record:
        return self.policy._robots[0]

    @property
    def constants(self) -> np.record:
        return self.policy._constants[0]

    @property
    def memory(self) -> OneTaskMemory:
        memory = self.policy._memory
        objects, *others = memory
        return OneTaskMemory(OneMemory(*(part[0] for part in objects)), *(part[0] for part in others))

    @property
    def left_alone(self) -> list[list[int]]:
        """What it shuns, by place in `TaskMemory.shunned`."""
        _, _, shunned, n_shunned = self.memory
        return [names[:n].tolist() for names, n in zip(shunned, n_shunned, strict=True)]

    @property
    def senses(self) -> Any:
        return sense(self.seen.array[0], self.constants)

    @property
    def activity(self) -> Activity:
        return Activity(int(self.policy.activity[0]))

    @property
    def stage(self) -> VectorState:
        return VectorState(int(self.record.vector_state))

    @property
    def task(self) -> Task:
        return Task(int(self.policy.task[0]))

    @property
    def goal(self) -> tuple[float, float]:
        return (float(self.record.goal_x_m), float(self.record.goal_y_m))

    def know_object(self, object_row: int, cell: tuple[int, int]) -> None:
        """Put an object into memory."""
        remember(self.record, self.memory.objects, object_row, *cell)

    def know_cache(self, serial: int, cell: tuple[int, int], count: int) -> None:
        """Put a cache into memory."""
        width_m, height_m = self.seen.spec.arena_size_m
        x, y = (cell[0] + 0.5) * 0.2, (cell[1] + 0.5) * 0.2
        fields = [serial / SERIAL_SCALE, 2 * x / width_m - 1, 2 * y / height_m - 1, count / self.seen.spec.n_objects]
        remember_cache(self.record, self.memory, np.array(fields, np.float32), self.constants)


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
