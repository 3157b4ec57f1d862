"""What STOCHM and STOCHX have in common: a policy that runs the task machines of `task_machines`."""

import math
from typing import Any, ClassVar

import numpy as np

from swarm_forage_env.contract.policy import Memories, SwarmSpec

from .cache_memory import TaskMemory, new_task_memory, task_memory_with_room
from .memory import listed, object_memories
from .parameters import kernel_constants
from .robots import READS
from .scripted import ScriptedPolicy
from .stoch_n1 import new_allocation
from .task_machines import new_task_robots, step_tasks
from .tasks import TASK_DRAWS, TaskParameters


def site_box_m(spec: SwarmSpec) -> tuple[float, float, float, float]:
    """Return the box of allowed cache sites, half a nominal cache side inside the arena: x low, y low, x high, y high.

    Under the quirk `site_box_truncated` its borders are truncated to whole metres.
    """
    width_m, height_m = spec.arena_size_m
    margin = spec.cache_side_nominal_m / 2.0
    box = (margin, margin, width_m - margin, height_m - margin)
    if spec.quirks.site_box_truncated:
        x_low, y_low, x_high, y_high = (float(math.trunc(border)) for border in box)
        return x_low, y_low, x_high, y_high
    return box


def task_constants(parameters: TaskParameters, spec: SwarmSpec, n_tabs: int) -> np.ndarray:
    """Return `kernel_constants` with what task allocation and caches need besides."""
    x_low, y_low, x_high, y_high = site_box_m(spec)
    # Quirk finisher_tolerance_mismatch: a robot arrives at one distance and is accepted at another.
    is_loose = spec.quirks.finisher_tolerance_mismatch
    loose_m = parameters.loose_creation_share * max(spec.arena_size_m)
    return kernel_constants(
        parameters,
        spec,
        **parameters.derived(),
        n_tabs=n_tabs,
        cache_half_cells=spec.cache_half_side_cells,
        cache_side_m=spec.cache_side_m,
        proximity_m=spec.cache_side_nominal_m,
        # The world measures from where the robot stands, which is this far from its goal at most.
        refusal_m=spec.cache_proximity_m + max(parameters.site_tolerance_m, parameters.creation_distance_m),
        creation_tolerance_m=loose_m if is_loose else parameters.creation_distance_m,
        site_x_low_m=x_low,
        site_y_low_m=y_low,
        site_x_high_m=x_high,
        site_y_high_m=y_high,
    )


class TaskPolicy(ScriptedPolicy):
    """Every robot chooses its own tasks, from its own experience. An instance drives one run.

    Subclasses say which part of the task graph they use and with which numbers.
    """

    n_tabs: ClassVar[int]
    """Task allocation blocks in use, from the root of the graph."""
    reads: ClassVar[tuple[str, ...]] = (
        *READS,
        "cargo",
        "event_object",
        "event_cache",
        "los_cell",
        "los_object",
        "los_cache",
    )
    _kernel = staticmethod(step_tasks)

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: estimates are drawn, no robot has a task, and all memories are empty."""
        constants = task_constants(self.parameters, spec, self.n_tabs)
        robots = new_task_robots(spec.n_robots)
        self._allocation = new_allocation(spec.n_robots, self.parameters, spec.quirks, self.n_tabs, rng)
        self.task = self._allocation.task
        self._start_script(spec, rng, TASK_DRAWS, constants, robots, new_task_memory(spec), self._allocation)

    def _with_room(self, memory: Any, n_ticks: int, spec: SwarmSpec) -> TaskMemory:
        return task_memory_with_room(memory, self._robots, n_ticks, spec)

    def describe_memories(self) -> Memories:
        """Return where all robots remember objects and caches."""
        robot, known = listed(self._memory.caches, self._robots["n_caches"])
        cells = np.column_stack((known["cell_x"], known["cell_y"]))
        objects = object_memories(self._memory.objects, self._robots)
        return Memories.together((objects, Memories.of_cells(robot, cells, is_cache=True)))
