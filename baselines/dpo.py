"""DPO: decaying pheromones for objects. Robots remember every object they have seen and go to the most useful one.

States as in `crw`, but ACQUIRE goes to the best remembered object, and explores only while no object is remembered that
it can go to. The memory is updated in every state. Source: DPO of the paper, section "Candidate Algorithms".
"""

from typing import Any, ClassVar

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.policy import Memories, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, ObsArray

from .machines import (
    DELIVER,
    acquire,
    after_delivery,
    command,
    deliver_and_leave,
    explore_for_object,
    explore_freely,
    follow_cargo,
    hold,
)
from .memory import (
    ObjectMemory,
    forget,
    look_around,
    memory_of,
    new_memory,
    object_memories,
    object_memory_with_room,
    object_row_of,
)
from .object_choice import MemoryParameters, object_is_known, object_is_reached, select_object
from .parameters import kernel_constants
from .robots import ACQUIRE, DRAWS, HOMING, READS, VECTOR_IDLE, WAIT_PICKUP, fetch_ahead, new_robots, sense
from .scripted import ScriptedPolicy


@kernel
def step_dpo(
    obs: ObsArray,
    active: BoolArray,
    draws: FloatArray,
    state: tuple[np.ndarray, np.ndarray, ObjectMemory, ActionArray],
    _now: int,
) -> None:
    """One tick of DPO for all robots. `state` = constants (1,), robots (N,) and memory edited, actions (N, 3) written.

    `draws` is (N, DRAWS) uniform in [0, 1). Inactive robots keep their state, and hold.
    """
    constants, robots, memory, actions = state
    c = constants[0]
    for i in range(active.shape[0]):
        fetch_ahead(obs, robots, i, c)
        action = actions[i]
        if not active[i]:
            hold(obs[i], c, action)
            continue
        robot = robots[i]
        row = obs[i]
        known = memory_of(memory, i)
        senses = sense(row, c)
        look_around(robot, row, c, known)
        if follow_cargo(robot, senses, row, c, HOMING, after_delivery(c)):
            forget(robot, known, object_row_of(row[c.cargo], c))
        if robot.activity == ACQUIRE:
            is_free = robot.n_known == 0 and robot.vector_state == VECTOR_IDLE
            if is_free and explore_freely(robot, senses, row, c, draws[i], action):
                continue
            found, x, y = acquire(
                robot,
                senses,
                row,
                c,
                draws[i],
                known,
                select_object,
                object_is_known,
                object_is_reached,
                explore_for_object,
            )
            if found:
                robot.activity = WAIT_PICKUP
        else:
            x, y = deliver_and_leave(robot, senses, row, c, draws[i])
        command(robot, x, y, c, DELIVER, action)


class DPOPolicy(ScriptedPolicy):
    """Random walk with a memory of objects.

    DPO stands for decaying pheromone objects: what a robot remembers of an object fades.
    """

    caches: ClassVar[str] = "none"
    reads: ClassVar[tuple[str, ...]] = (*READS, "cargo", "los_cell", "los_object")
    default_parameters: ClassVar[MemoryParameters] = MemoryParameters()
    _kernel = staticmethod(step_dpo)

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: every robot explores and remembers nothing."""
        constants = kernel_constants(self.parameters, spec, **self.parameters.derived())
        memory = new_memory(spec.n_robots, spec.n_objects)
        self._start_script(spec, rng, DRAWS, constants, new_robots(spec.n_robots), memory)

    def _with_room(self, memory: Any, n_ticks: int, spec: SwarmSpec) -> ObjectMemory:
        return object_memory_with_room(memory, self._robots, n_ticks, spec.n_objects)

    def describe_memories(self) -> Memories:
        """Return where all robots remember objects."""
        return object_memories(self._memory, self._robots)
