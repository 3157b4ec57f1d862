"""Which remembered object to go to, and whether it is still worth going: the object goal of `machines.acquire`."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.detection import sees_object
from swarm_forage_env.contract.layout import GROUND_SENSORS
from swarm_forage_env.contract.types import Row

from .memory import OneMemory, density, find_object
from .parameters import ControllerParameters, ParameterError
from .robots import Senses, nearest_nest


@dataclass(frozen=True, kw_only=True, slots=True)
class MemoryParameters(ControllerParameters):
    """Numbers of a controller that remembers objects."""

    evaporation_per_tick: float = 0.00001
    """rho: share of the pheromone density that is lost per tick; study."""
    object_priority: float = 1.0
    """Weight of the density in the utility of an object; study: 1 for cubes."""
    object_exclusion_m: float = 0.2
    """Objects whose centre is at most this near are not chosen; authors' program: the smallest object side."""
    object_tolerance_m: float = 0.02
    """A robot this near to an object's centre has arrived; authors' program."""

    def __post_init__(self) -> None:
        # super() without arguments fails in a slots dataclass, because that is a new class.
        ControllerParameters.__post_init__(self)
        if self.evaporation_per_tick >= 1.0:
            raise ParameterError(f"Expected evaporation_per_tick < 1, got {self.evaporation_per_tick}.")

    def derived(self) -> dict[str, float]:
        """Return what kernels need besides the fields: log(1 - rho)."""
        return {"log_keep": math.log1p(-self.evaporation_per_tick)}


@kernel
def object_utility(anchor_x: float, anchor_y: float, x: float, y: float, pheromone: float, c: np.record) -> float:
    """Utility of an object: U = |anchor - nest| / |anchor - robot| * exp(density * priority).

    Far from the nest and near the robot is good: what lies near the nest will be met on the way anyway.

    Args:
        anchor_x: Lower left corner of the object's cell, m.
        anchor_y: The same along y.
        x: Robot position, m.
        y: The same along y.
        pheromone: Density of the object.
        c: Constants of the run.
    """
    nest_x, nest_y = nearest_nest(anchor_x, anchor_y, c)
    nest_x, nest_y = anchor_x - nest_x, anchor_y - nest_y
    away_x, away_y = anchor_x - x, anchor_y - y
    ratio = (nest_x * nest_x + nest_y * nest_y) / (away_x * away_x + away_y * away_y)
    return math.sqrt(ratio) * math.exp(pheromone * c.object_priority)


@inline_kernel
def select_best_object(
    robot: np.record,
    senses: Senses,
    c: np.record,
    memory: OneMemory,
    whole_memory: Any,
    is_left_out: Callable[..., bool],
) -> bool:
    """Choose the remembered object of highest utility as goal; the first one found wins a tie.

    Objects whose centre is within `object_exclusion_m` of the robot are left out, and those for which the compiled
    function `is_left_out(whole_memory, object_row)` holds.

    Returns:
        Whether there is one; then goal (its centre), tolerance and target of the robot are set.
    """
    best = 0.0
    best_entry = -1
    nearest = c.object_exclusion_m * c.object_exclusion_m
    half = 0.5 * c.cell_m
    for entry in range(robot.n_known):
        known = memory.known[entry]
        anchor_x = known.cell_x * c.cell_m
        anchor_y = known.cell_y * c.cell_m
        dx = anchor_x + half - senses.x
        dy = anchor_y + half - senses.y
        if dx * dx + dy * dy <= nearest or is_left_out(whole_memory, known.row):
            continue
        pheromone = density(robot.clock - known.seen, c.log_keep)
        utility = object_utility(anchor_x, anchor_y, senses.x, senses.y, pheromone, c)
        if utility > best:
            best = utility
            best_entry = entry
    if best_entry < 0:
        return False
    chosen = memory.known[best_entry]
    robot.goal_x_m = chosen.cell_x * c.cell_m + half
    robot.goal_y_m = chosen.cell_y * c.cell_m + half
    robot.goal_tolerance_m = c.object_tolerance_m
    robot.target = chosen.row
    return True


@part
def _never(_memory: OneMemory, _object_row: int) -> bool:
    return False


@part
def select_object(robot: np.record, senses: Senses, c: np.record, _draws: Row, memory: OneMemory) -> bool:
    """Choose the best remembered object, as `select_best_object`; no object is left out."""
    return select_best_object(robot, senses, c, memory, memory, _never)


@part
def object_is_known(robot: np.record, _c: np.record, memory: OneMemory) -> bool:
    """Whether the target object is still remembered."""
    return find_object(memory, robot.target) >= 0


@part
def object_is_reached(_robot: np.record, _senses: Senses, row: Row, c: np.record, _memory: OneMemory) -> bool:
    """Whether the ground sensors see an object."""
    return sees_object(row[c.ground : c.ground + GROUND_SENSORS])
