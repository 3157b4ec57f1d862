"""One tick of a robot that allocates tasks: memory, executive, the machine of its task.

Every task is one machine with its own source and destination (`SOURCE`, `DESTINATION`):

    ACQUIRE         on the way to the source, or searching it; there          -> WAIT_PICKUP
    WAIT_PICKUP     stand, ask; cargo -> HOMING or TRANSPORT; refused         -> ACQUIRE
    HOMING ...      to the nest, as in CRW; there                             -> WAIT_DROP
    TRANSPORT       on the way to another destination, or searching it; there -> WAIT_DROP
    WAIT_DROP       stand, ask to drop; dropped -> FINISHED; refused          -> HOMING or TRANSPORT
    FINISHED        the executive ends the task and starts the next one in the same tick
    LET_GO          aborted while carrying: stand and release; empty          -> ACQUIRE, of the next task

Source: STOCHM and STOCHX of the paper, section "Candidate Algorithms".
"""

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.codes import DESTINATION, SOURCE, Event, Goal, Task
from swarm_forage_env.contract.detection import sees_cache
from swarm_forage_env.contract.layout import CACHE_FIELDS, GROUND_SENSORS
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, ObsArray, Row

from .cache_choice import (
    cache_is_known,
    cache_of_goal,
    from_nest_m,
    object_is_near,
    select_cache,
    select_isolated_object,
)
from .cache_memory import (
    NOT_TO_ADD,
    NOT_TO_TAKE,
    OBJECTS,
    OneTaskMemory,
    TaskMemory,
    cell_of,
    event_cache_entry,
    event_cache_serial,
    event_object_row,
    forgive_refusals,
    is_shunned,
    look_for_caches,
    remember_cache,
    shun,
    task_memory_of,
)
from .cache_sites import select_site
from .machines import (
    GRASP,
    RELEASE,
    acquire,
    command,
    deliver_and_leave,
    explore,
    explore_for_object,
    explore_freely,
    follow_cargo,
    go_to_goal,
    hold,
    random_walk,
    restart_acquiring,
    start_carrying,
    start_vector,
    stop_vector,
)
from .memory import forget, look_around, object_row_of
from .motion import arrival
from .object_choice import object_is_known, object_is_reached, select_best_object
from .robots import (
    ACQUIRE,
    DRAW_RESTART,
    DRAW_WANDER,
    FINISHED,
    HOMING,
    LET_GO,
    NOT_EXPLORING,
    TRANSPORT,
    VECTOR_IDLE,
    WAIT_DROP,
    WAIT_PICKUP,
    Senses,
    new_robots,
    sense,
)
from .stoch_n1 import NO_TASK, Allocation, after_tick, end_task, next_task
from .tasks import DRAW_ABORT, DRAW_MOVE, DRAW_PARTITION, DRAW_SWITCH, DROP_GRIP

_OBJECT = int(Goal.OBJECT)
_CACHE = int(Goal.CACHE)
_NEST = int(Goal.NEST)
_SITE = int(Goal.SITE)
_STARTER = int(Task.STARTER)
_FINISHER = int(Task.FINISHER)
_TRANSFERER = int(Task.TRANSFERER)
_CACHE_TOO_NEAR = int(Event.CACHE_TOO_NEAR)


def new_task_robots(n_robots: int) -> np.ndarray:
    """Return (n_robots,) records of robots that have no task yet and have seen nothing."""
    robots = new_robots(
        n_robots,
        [
            ("last_cache_x_m", np.float64),  # where the last remembered cache was, once none is left
            ("last_cache_y_m", np.float64),
            ("cargo_from_nest_m", np.float64),  # a Cache Transferer's: how far from the nest its cache is; else inf
            ("n_caches", np.int32),  # remembered caches
            ("goal_kind", np.int8),  # `tasks.Goal` code of what it acquires
            ("knows_last_cache", np.bool_),
            ("shunned_in_task", np.bool_),  # an object, during the current task
            ("shunned_cache_in_task", np.bool_),
        ],
    )
    robots["cargo_from_nest_m"] = np.inf
    return robots


@part
def _is_shunned(memory: OneTaskMemory, object_row: int) -> bool:
    return is_shunned(memory, OBJECTS, object_row + 1)


@part
def select_goal(robot: np.record, senses: Senses, c: np.record, draws: Row, memory: OneTaskMemory) -> bool:
    """Choose the best goal of the kind that the robot acquires; see `machines.acquire`."""
    if robot.goal_kind == _OBJECT:
        return select_best_object(robot, senses, c, memory.objects, memory, _is_shunned)
    if robot.goal_kind == _CACHE:
        return select_cache(robot, senses, c, draws, memory)
    if robot.goal_kind == _SITE:
        return select_site(robot, senses, c, draws, memory)
    return select_isolated_object(robot, senses, c, memory)


@part
def goal_is_known(robot: np.record, c: np.record, memory: OneTaskMemory) -> bool:
    """Whether the goal is still worth going to."""
    if robot.goal_kind == _OBJECT:
        return object_is_known(robot, c, memory.objects)
    return robot.goal_kind != _CACHE or cache_is_known(robot, c, memory)


@part
def goal_is_reached(robot: np.record, senses: Senses, row: Row, c: np.record, memory: OneTaskMemory) -> bool:
    """Whether what the robot came for is there."""
    if robot.goal_kind == _OBJECT:
        return object_is_reached(robot, senses, row, c, memory.objects)
    if robot.goal_kind == _CACHE:
        return sees_cache(row[c.ground : c.ground + GROUND_SENSORS])
    return robot.goal_kind == _SITE or object_is_near(robot, senses, c, memory.objects)


@part
def search_for_goal(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[bool, float, float]:
    """One tick of the search that suits the goal.

    With no site allowed the robot walks at random until it learns of a change or gives up. Our choice: the authors'
    program has no search for sites, but its robots never stand.
    """
    if robot.goal_kind == _OBJECT:
        return explore_for_object(robot, senses, row, c, draws)
    x = 0.0
    y = 0.0
    if robot.goal_kind == _CACHE:
        x, y = search_from_last_cache(robot, senses, row, c, draws)
    else:
        x, y = explore(robot, senses, c, draws)
    return False, x, y


@part
def search_from_last_cache(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[float, float]:
    """One tick of looking for caches: first to where the last known one was, if any, then at random."""
    x = 0.0
    y = 0.0
    if robot.explore_ticks == NOT_EXPLORING:
        robot.explore_ticks = 0
        if robot.knows_last_cache:
            robot.goal_x_m = robot.last_cache_x_m
            robot.goal_y_m = robot.last_cache_y_m
            robot.goal_tolerance_m = c.cache_tolerance_m
            start_vector(robot)
            robot.is_searching = True
        if c.explore_double_start:  # quirk: starting runs the strategy once more
            x, y = _search_step(robot, senses, row, c, draws, draws[DRAW_RESTART])
    step_x, step_y = _search_step(robot, senses, row, c, draws, draws[DRAW_WANDER])
    robot.explore_ticks += 1
    return x + step_x, y + step_y


@part
def _search_step(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row, u: float) -> tuple[float, float]:
    if not robot.is_searching:
        return random_walk(robot, senses, c, u)
    arrived, x, y = go_to_goal(robot, senses, row, c, draws)
    if arrived:
        stop_vector(robot)
    return x, y


@inline_kernel
def follow_events(
    a: Allocation, i: int, robot: np.record, senses: Senses, row: Row, c: np.record, memory: OneTaskMemory
) -> None:
    """Let activity and memory follow what happened to the robot since its last tick."""
    task = a.task[i]
    loaded = HOMING if DESTINATION[task] == _NEST else TRANSPORT
    if follow_cargo(robot, senses, row, c, loaded, FINISHED):
        forget(robot, memory.objects, object_row_of(row[c.cargo], c))
        robot.cargo_from_nest_m = np.inf
        if task == _TRANSFERER:
            shun(robot, memory, NOT_TO_ADD, event_cache_serial(row, c))
            if not c.transferer_goes_anywhere and row[c.event_cache] > 0.0:
                # From the event: the cache may have been used up in the same tick, and be forgotten.
                x = cell_of(row[c.event_cache + 1], c.half_width_m, c)
                y = cell_of(row[c.event_cache + 2], c.half_height_m, c)
                robot.cargo_from_nest_m = from_nest_m((x + 0.5) * c.cell_m, (y + 0.5) * c.cell_m, c)
    elif robot.activity == FINISHED:
        if task in (_STARTER, _FINISHER):
            shun(robot, memory, OBJECTS, event_object_row(row, c) + 1)
        elif task == _TRANSFERER:
            shun(robot, memory, NOT_TO_TAKE, event_cache_serial(row, c))
    elif senses.event == _CACHE_TOO_NEAR:
        remember_cache(robot, memory, row[c.event_cache : c.event_cache + CACHE_FIELDS], c)
        entry = event_cache_entry(robot, row, c, memory.caches)
        if entry >= 0:
            memory.caches[entry].has_refused = not c.refusals_not_remembered
        if robot.activity == WAIT_DROP:
            start_carrying(robot, loaded)
    elif (
        robot.activity == WAIT_PICKUP
        and SOURCE[task] == _CACHE
        and not cache_is_known(robot, c, memory)
        and not (
            c.waits_for_cache and cache_of_goal(robot, c, memory) >= 0
        )  # quirk: it stands there until there are more
    ):
        restart_acquiring(robot)  # other robots have left too few objects in the cache, or it is gone


@inline_kernel
def manage_task(
    a: Allocation, i: int, robot: np.record, senses: Senses, now: int, c: np.record, draws: Row, memory: OneTaskMemory
) -> bool:
    """End the current task if it is finished or given up, and start the next; returns whether one was started."""
    if a.task[i] != NO_TASK:
        if robot.activity != FINISHED and draws[DRAW_ABORT] >= a.p_abort[i, a.task[i]]:
            return False
        end_task(a, i, now, c)
    next_task(a, i, now, c, draws[DRAW_MOVE], draws[DRAW_PARTITION], draws[DRAW_SWITCH])
    if not robot.shunned_in_task:
        memory.n_shunned[OBJECTS] = 0
    if not (robot.shunned_cache_in_task and a.task[i] == _TRANSFERER):
        memory.n_shunned[NOT_TO_TAKE] = 0
        memory.n_shunned[NOT_TO_ADD] = 0
    forgive_refusals(robot, memory.caches)
    robot.shunned_in_task = False
    robot.shunned_cache_in_task = False
    restart_acquiring(robot)
    if senses.carrying:
        robot.activity = LET_GO
    return True


@part
def stands_at_site(robot: np.record, senses: Senses, c: np.record, draws: Row, memory: OneTaskMemory) -> bool:
    """Quirk `no_walk_at_site`: choose a site; whether the robot is so near that it drifts there and chooses again.

    Nothing happens while the robot is on the way to one.
    """
    if robot.vector_state != VECTOR_IDLE or not select_site(robot, senses, c, draws, memory):
        return False
    robot.explore_ticks = NOT_EXPLORING
    dx = robot.goal_x_m - senses.x
    dy = robot.goal_y_m - senses.y
    return dx * dx + dy * dy <= robot.goal_tolerance_m * robot.goal_tolerance_m


@inline_kernel
def run_machine(
    robot: np.record, task: int, senses: Senses, row: Row, c: np.record, draws: Row, memory: OneTaskMemory
) -> tuple[float, float]:
    """One tick of a task's machine; returns the force."""
    if robot.activity not in (ACQUIRE, TRANSPORT):
        return deliver_and_leave(robot, senses, row, c, draws)
    robot.goal_kind = SOURCE[task] if robot.activity == ACQUIRE else DESTINATION[task]
    if c.no_walk_at_site and robot.goal_kind == _SITE and stands_at_site(robot, senses, c, draws, memory):
        return arrival(robot, senses.x, senses.y, float(row[c.heading]), float(row[c.heading + 1]), c)
    found, x, y = acquire(
        robot, senses, row, c, draws, memory, select_goal, goal_is_known, goal_is_reached, search_for_goal
    )
    if found:
        robot.activity = WAIT_PICKUP if robot.activity == ACQUIRE else WAIT_DROP
    return x, y


@part
def wanders_on(robot: np.record, senses: Senses, c: np.record, draws: Row, memory: OneTaskMemory) -> bool:
    """Whether a robot that walks at random, in search of an object or a cache, has found nothing to go to.

    If so, it walks on; `explore_freely` does that quickly.
    """
    if robot.vector_state != VECTOR_IDLE or robot.explore_ticks == NOT_EXPLORING or senses.obstacle:
        return False
    if robot.activity not in (ACQUIRE, TRANSPORT):
        return False
    if robot.goal_kind == _CACHE:
        return not select_cache(robot, senses, c, draws, memory)
    return robot.goal_kind != _SITE and robot.n_known == 0


@kernel
def step_tasks(
    obs: ObsArray,
    active: BoolArray,
    draws: FloatArray,
    state: tuple[np.ndarray, np.ndarray, TaskMemory, Allocation, ActionArray],
    now: int,
) -> None:
    """One tick for all robots.

    `state` = constants (1,), robots (N,), memory and allocation edited, actions (N, 3) written. `draws` is
    (N, TASK_DRAWS) uniform in [0, 1), `now` the number of this tick, from 1. Inactive robots keep their state, and
    hold.
    """
    constants, robots, memory, allocation, actions = state
    c = constants[0]
    for i in range(active.shape[0]):
        action = actions[i]
        if not active[i]:
            hold(obs[i], c, action)
            continue
        robot = robots[i]
        row = obs[i]
        known = task_memory_of(memory, i)
        senses = sense(row, c)
        look_around(robot, row, c, known.objects)
        look_for_caches(robot, row, c, known)
        follow_events(allocation, i, robot, senses, row, c, known)
        has_started = manage_task(allocation, i, robot, senses, now, c, draws[i], known)
        task = allocation.task[i]
        wanders = wanders_on(robot, senses, c, draws[i], known)
        if wanders and explore_freely(robot, senses, row, c, draws[i], action):
            action[2] = GRASP if robot.activity == TRANSPORT else RELEASE
        else:
            x, y = run_machine(robot, task, senses, row, c, draws[i], known)
            command(robot, x, y, c, float(DROP_GRIP[task]), action)
        if not has_started:
            after_tick(allocation, i, now, robot.activity, c)
        if robot.activity == WAIT_PICKUP and SOURCE[task] == _CACHE and not cache_is_known(robot, c, known):
            action[2] = RELEASE  # quirk waits_for_cache: it stands there without asking
