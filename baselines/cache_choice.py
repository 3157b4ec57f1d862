"""Which cache to go to, and which isolated object to create a cache at."""

import math

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.types import Row

from .cache_memory import NOT_TO_ADD, NOT_TO_TAKE, OneTaskMemory, covers, is_shunned, keep_away_m
from .memory import OneMemory, density
from .robots import ACQUIRE, TRANSPORT, Senses, nearest_nest
from .tasks import DRAW_POINT_X, DRAW_POINT_Y


@kernel
def cache_utility(
    cache_x: float, cache_y: float, count: float, x: float, y: float, pheromone: float, c: np.record
) -> float:
    """Utility of a cache: U = exp(density) count / (|cache - robot| |cache - nest|).

    Full caches near the robot and near the nest are good, for taking and for adding alike. An isolated object, at which
    a cache can be created, is one of a single object.

    Args:
        cache_x: Centre of the cache, m.
        cache_y: The same along y.
        count: Remembered number of objects.
        x: Robot position, m.
        y: The same along y.
        pheromone: Density of the cache, or of the object.
        c: Constants of the run.
    """
    robot_x, robot_y = cache_x - x, cache_y - y
    nest_x, nest_y = nearest_nest(cache_x, cache_y, c)
    nest_x, nest_y = cache_x - nest_x, cache_y - nest_y
    product = (robot_x * robot_x + robot_y * robot_y) * (nest_x * nest_x + nest_y * nest_y)
    # The lower limit is for a robot exactly on an object.
    return math.exp(pheromone) * count / math.sqrt(max(product, 1e-12))


@part
def is_large_enough(cache: np.record, c: np.record) -> bool:
    """Whether a cache is remembered with enough objects to take one."""
    return cache.count >= c.smallest_cache


@part
def from_nest_m(x: float, y: float, c: np.record) -> float:
    """Distance of a point (m) from the centre of the nearest nest, m."""
    nest_x, nest_y = nearest_nest(x, y, c)
    return math.sqrt((x - nest_x) ** 2 + (y - nest_y) ** 2)


@kernel
def select_cache(robot: np.record, senses: Senses, c: np.record, draws: Row, memory: OneTaskMemory) -> bool:
    """Choose the remembered cache of highest utility; the goal is a random point in it.

    Not chosen are: the cache that the robot stands in, so that a robot which has just dropped its object leaves before
    it comes back; caches to be left alone in this task; for taking, caches with too few objects; and for a Cache
    Transferer's object, caches not nearer to the nest than the one it comes from.

    Returns:
        Whether there is one; then goal, tolerance and target (the cache's serial) of the robot are set.
    """
    takes = robot.activity == ACQUIRE
    kind = NOT_TO_TAKE if takes else NOT_TO_ADD
    best = 0.0
    best_entry = -1
    for entry in range(robot.n_caches):
        cache = memory.caches[entry]
        if covers(cache, senses.x, senses.y, c) or is_shunned(memory, kind, cache.serial):
            continue
        if takes and not is_large_enough(cache, c):
            continue
        centre_x = (cache.cell_x + 0.5) * c.cell_m
        centre_y = (cache.cell_y + 0.5) * c.cell_m
        if not takes and from_nest_m(centre_x, centre_y, c) >= robot.cargo_from_nest_m:
            continue
        pheromone = density(robot.clock - cache.seen, c.log_keep)
        utility = cache_utility(centre_x, centre_y, cache.count, senses.x, senses.y, pheromone, c)
        if utility > best:
            best = utility
            best_entry = entry
    if best_entry < 0:
        return False
    robot.target = memory.caches[best_entry].serial
    spread = max(0.0, c.cache_side_m - 2.0 * c.cache_margin_m)
    robot.goal_x_m = (memory.caches[best_entry].cell_x + 0.5) * c.cell_m + spread * (draws[DRAW_POINT_X] - 0.5)
    robot.goal_y_m = (memory.caches[best_entry].cell_y + 0.5) * c.cell_m + spread * (draws[DRAW_POINT_Y] - 0.5)
    robot.goal_tolerance_m = c.cache_tolerance_m
    return True


@part
def cache_of_goal(robot: np.record, c: np.record, memory: OneTaskMemory) -> int:
    """List entry of the remembered cache in which the goal lies, or -1.

    A cache that is there again serves as well. Quirk `cache_goal_by_identity`: it must be the one that was chosen.
    """
    for entry in range(robot.n_caches):
        cache = memory.caches[entry]
        if covers(cache, robot.goal_x_m, robot.goal_y_m, c):
            return -1 if c.cache_goal_by_identity and cache.serial != robot.target else entry
    return -1


@part
def cache_is_known(robot: np.record, c: np.record, memory: OneTaskMemory) -> bool:
    """Whether the goal still lies in a remembered cache, which has enough objects if the robot wants one."""
    entry = cache_of_goal(robot, c, memory)
    return entry >= 0 and (robot.activity == TRANSPORT or is_large_enough(memory.caches[entry], c))


@part
def is_isolated(robot: np.record, entry: int, c: np.record, memory: OneTaskMemory) -> bool:
    """Whether an object is remembered without another one within the proximity distance, and far enough from caches."""
    objects = memory.objects
    for k in range(robot.n_caches):
        limit = keep_away_m(memory.caches[k], c) ** 2
        dx = (memory.caches[k].cell_x - objects.known[entry].cell_x) * c.cell_m
        dy = (memory.caches[k].cell_y - objects.known[entry].cell_y) * c.cell_m
        if dx * dx + dy * dy <= limit:
            return False
    limit = c.proximity_m * c.proximity_m
    # The next entries in the list were seen next and are probably near, so begin there.
    for step in range(1, robot.n_known):
        other = entry + step
        if other >= robot.n_known:
            other -= robot.n_known
        dx = (objects.known[other].cell_x - objects.known[entry].cell_x) * c.cell_m
        dy = (objects.known[other].cell_y - objects.known[entry].cell_y) * c.cell_m
        if dx * dx + dy * dy <= limit:
            return False
    return True


@kernel
def select_isolated_object(robot: np.record, senses: Senses, c: np.record, memory: OneTaskMemory) -> bool:
    """Choose the isolated object of highest utility as goal.

    Returns:
        Whether there is one; then goal and tolerance of the robot are set.
    """
    objects = memory.objects
    best = 0.0
    best_entry = -1
    half = 0.5 * c.cell_m
    for entry in range(robot.n_known):
        if not is_isolated(robot, entry, c, memory):
            continue
        x = objects.known[entry].cell_x * c.cell_m + half
        y = objects.known[entry].cell_y * c.cell_m + half
        pheromone = density(robot.clock - objects.known[entry].seen, c.log_keep)
        utility = cache_utility(x, y, 1, senses.x, senses.y, pheromone, c)
        if utility > best:
            best = utility
            best_entry = entry
    if best_entry < 0:
        return False
    robot.goal_x_m = objects.known[best_entry].cell_x * c.cell_m + half
    robot.goal_y_m = objects.known[best_entry].cell_y * c.cell_m + half
    robot.goal_tolerance_m = c.creation_tolerance_m
    return True


@kernel
def object_is_near(robot: np.record, senses: Senses, c: np.record, objects: OneMemory) -> bool:
    """Whether an object is remembered within the creation distance of the robot."""
    limit = c.creation_distance_m * c.creation_distance_m
    half = 0.5 * c.cell_m
    for entry in range(robot.n_known):
        dx = objects.known[entry].cell_x * c.cell_m + half - senses.x
        dy = objects.known[entry].cell_y * c.cell_m + half - senses.y
        if dx * dx + dy * dy <= limit:
            return True
    return False
