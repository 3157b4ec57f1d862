"""State machines of one robot: exploring, going to a point, acquiring, homing.

All controllers share these functions. Every function is compiled, handles one robot and returns the steering force
(forward, left) that it adds this tick; a kernel of a controller loops over the robots. What differs between goals
(which candidate, is it still valid, was it reached) is passed in as compiled functions.
Conventions are those of `robots`.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.contract.detection import sees_object
from swarm_forage_env.contract.layout import GROUND_SENSORS, RING_SENSORS
from swarm_forage_env.contract.types import Row

from .motion import arrival, avoidance, drive, is_standing, phototaxis, recovery, wander, wander_freely
from .robots import (
    ACQUIRE,
    DRAW_DEPTH,
    DRAW_RESTART,
    DRAW_VECTOR,
    DRAW_WANDER,
    HOMING,
    HOMING_IN_NEST,
    LEAVE_NEST,
    LET_GO,
    NOT_EXPLORING,
    TRANSPORT,
    VECTOR,
    VECTOR_AVOIDANCE,
    VECTOR_IDLE,
    VECTOR_RECOVERY,
    WAIT_DROP,
    WAIT_PICKUP,
    Senses,
    in_nest,
    nearest_nest,
)

_HALF_RIGHT = math.sqrt(0.5)
"""Cosine and sine of 45 degrees."""
_OFF_THE_WALL = 0.1
"""Share of the avoidance force while a robot drives along an obstacle; our choice: it stays in sight of it."""
NOTHING_HERE = int(Event.NOTHING_HERE)
VANISHED = int(Event.VANISHED)
GRASP = float(Grip.GRASP)
RELEASE = float(Grip.RELEASE)
DELIVER = float(Grip.DELIVER)


@kernel
def restart_acquiring(robot: np.record) -> None:
    """Begin a new acquisition: no goal, exploration not started."""
    robot.activity = ACQUIRE
    robot.explore_ticks = NOT_EXPLORING
    stop_vector(robot)


@part
def start_carrying(robot: np.record, activity: int) -> None:
    """Begin to carry the cargo to its destination: HOMING, or TRANSPORT with no goal and exploration not started."""
    robot.activity = activity
    robot.explore_ticks = NOT_EXPLORING
    robot.rest_ticks = robot.detour_ticks = 0
    stop_vector(robot)


@part
def follow_cargo(robot: np.record, senses: Senses, row: Row, c: np.record, loaded: int, emptied: int) -> bool:
    """Before the robot acts, adapt its activity to what happened since its last tick.

    The activity follows the cargo. So it is also right for a robot that missed an event while it was in repair, or
    whose cargo changed for another reason. Refusals and lost conditions arrive as events: a waiting robot then looks
    for another object, or resumes homing (with a new drop depth once it sees the nest again) or transport.

    Args:
        robot: Record of the robot.
        senses: What it senses.
        row: Its observation.
        c: Constants of the run.
        loaded: Activity after a pick-up: HOMING or TRANSPORT.
        emptied: Activity after a drop: ACQUIRE, LEAVE_NEST or FINISHED.

    Returns:
        Whether the robot has just got its cargo.
    """
    activity = robot.activity
    failed = senses.event == NOTHING_HERE or senses.event == VANISHED
    if senses.carrying:
        if activity in (ACQUIRE, WAIT_PICKUP, LEAVE_NEST):
            start_carrying(robot, loaded)
            return True
        if activity == WAIT_DROP and failed:
            start_carrying(robot, loaded)
        return False
    if activity == WAIT_DROP and emptied != ACQUIRE:
        robot.activity = emptied
    elif activity in (HOMING, HOMING_IN_NEST, TRANSPORT, WAIT_DROP, LET_GO) or (activity == WAIT_PICKUP and failed):
        restart_acquiring(robot)
    if robot.activity == LEAVE_NEST and not in_nest(row, c):
        restart_acquiring(robot)
    return False


@part
def after_delivery(c: np.record) -> int:
    """Activity of CRW and DPO after a delivery: look for the next object at once, as the other two do.

    Quirk `nest_left_at_random`: walk at random until the nest is left.
    """
    return LEAVE_NEST if c.nest_left_at_random else ACQUIRE


@part
def avoid(senses: Senses, c: np.record) -> tuple[float, float]:
    """Avoidance force if there is an obstacle, else zero."""
    if senses.obstacle:
        return avoidance(senses.obstacle_x, senses.obstacle_y, c)
    return 0.0, 0.0


@part
def random_walk(robot: np.record, senses: Senses, c: np.record, u: float) -> tuple[float, float]:
    """One tick of the correlated random walk: wander, and avoid what is in the way."""
    wander_x, wander_y = wander(robot, c, u)
    away_x, away_y = avoid(senses, c)
    return wander_x + away_x, wander_y + away_y


@part
def start_exploring(robot: np.record, senses: Senses, c: np.record, draws: Row) -> tuple[float, float]:
    """Start a random walk unless one is under way; returns the force that starting adds."""
    if robot.explore_ticks == NOT_EXPLORING:
        robot.explore_ticks = 0
        if c.explore_double_start:  # quirk: starting runs the strategy once more
            return random_walk(robot, senses, c, draws[DRAW_RESTART])
    return 0.0, 0.0


@part
def explore(robot: np.record, senses: Senses, c: np.record, draws: Row) -> tuple[float, float]:
    """One tick of a random walk that ends only when the robot sees what it looks for; returns the force."""
    x, y = start_exploring(robot, senses, c, draws)
    walk_x, walk_y = random_walk(robot, senses, c, draws[DRAW_WANDER])
    robot.explore_ticks += 1
    return x + walk_x, y + walk_y


@part
def explore_for_object(
    robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row
) -> tuple[bool, float, float]:
    """Walk at random until the ground sensors see an object; objects are ignored for the first 50 ticks.

    Returns:
        Whether an object was found (then the robot stands still), and the force.
    """
    x, y = start_exploring(robot, senses, c, draws)
    if robot.explore_ticks >= c.exploration_lock_ticks and sees_object(row[c.ground : c.ground + GROUND_SENSORS]):
        return True, 0.0, 0.0
    walk_x, walk_y = explore(robot, senses, c, draws)
    return False, x + walk_x, y + walk_y


@part
def explore_freely(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row, action: Row) -> bool:
    """Do one tick of `explore_for_object` and `command`, quickly, for a robot that does nothing but wander on.

    Most robots are in this state most of the time. It must have no goal.

    Returns:
        False, and nothing has happened, if the robot starts to explore, avoids something or finds an object, or if
        `wander_freely` cannot tell.
    """
    if robot.explore_ticks == NOT_EXPLORING or senses.obstacle:
        return False
    if robot.explore_ticks >= c.exploration_lock_ticks and sees_object(row[c.ground : c.ground + GROUND_SENSORS]):
        return False
    if not wander_freely(robot, c, draws[DRAW_WANDER], action):
        return False
    robot.explore_ticks += 1
    _count_turning(robot, action)
    action[2] = RELEASE
    return True


@part
def start_vector(robot: np.record) -> None:
    """Start going to the robot's goal; follow with `go_to_goal` in the same tick."""
    robot.vector_state = VECTOR
    robot.recovery_ticks = 0
    robot.is_searching = False


@part
def stop_vector(robot: np.record) -> None:
    """Give up the goal."""
    robot.vector_state = VECTOR_IDLE
    robot.recovery_ticks = 0
    robot.is_searching = False


@part
def go_to_goal(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[bool, float, float]:
    """One tick on the way to the goal: arrival force, avoidance, then 2 s straight on before turning back.

    A change of state acts in the same tick. If the robot was within the slowing radius at its last arrival force, it
    ignores obstacles (`approach_ignores_obstacles`); otherwise it avoids them first.

    Returns:
        Whether the robot is within tolerance of its goal, and the force.
    """
    x = 0.0
    y = 0.0
    arrived = False
    if robot.vector_state == VECTOR_RECOVERY:
        x, y = recovery(c)
        robot.recovery_ticks += 1
        if senses.obstacle:
            robot.recovery_ticks = 0
            robot.vector_state = VECTOR_AVOIDANCE
        elif robot.recovery_ticks >= c.recovery_ticks:
            robot.recovery_ticks = 0
            robot.vector_state = VECTOR
    if robot.vector_state == VECTOR:
        if senses.obstacle and not (robot.is_slowing and c.approach_ignores_obstacles != 0):
            robot.vector_state = VECTOR_AVOIDANCE
        else:
            seek_x, seek_y = arrival(robot, senses.x, senses.y, float(row[c.heading]), float(row[c.heading + 1]), c)
            x += seek_x
            y += seek_y
            dx = robot.goal_x_m - senses.x
            dy = robot.goal_y_m - senses.y
            arrived = dx * dx + dy * dy <= robot.goal_tolerance_m * robot.goal_tolerance_m
    if robot.vector_state == VECTOR_AVOIDANCE:
        if senses.obstacle:
            away_x, away_y = avoid(senses, c)
            x += away_x
            y += away_y
            if is_standing(row[c.wheel_speed : c.wheel_speed + 2], c):
                wander_x, wander_y = wander(robot, c, draws[DRAW_VECTOR])
                x += wander_x
                y += wander_y
        else:
            robot.vector_state = VECTOR_RECOVERY
            robot.recovery_ticks = 1
            ahead_x, ahead_y = recovery(c)
            x += ahead_x
            y += ahead_y
    return arrived, x, y


@inline_kernel
def acquire(
    robot: np.record,
    senses: Senses,
    row: Row,
    c: np.record,
    draws: Row,
    memory: Any,
    select: Callable[..., bool],
    is_known: Callable[..., bool],
    is_reached: Callable[..., bool],
    search: Callable[..., tuple[bool, float, float]],
) -> tuple[bool, float, float]:
    """One tick towards the best remembered goal, or of the search for one.

    Args:
        robot: Record of the robot.
        senses: What it senses.
        row: Its observation.
        c: Constants of the run.
        draws: Its draws of this tick.
        memory: What the robot remembers, handed to the first three functions.
        select: (robot, senses, c, draws, memory) -> found; sets goal, tolerance and target of the robot, or nothing.
        is_known: (robot, c, memory) -> whether the goal is still valid.
        is_reached: (robot, senses, row, c, memory) -> whether the goal is really there.
        search: (robot, senses, row, c, draws) -> (found, force), while there is nothing to go to. It may itself go
            to a point, marked by the robot's `is_searching`.

    Returns:
        Whether a goal was acquired, by going there or by the search, and the force.
    """
    x = 0.0
    y = 0.0
    if robot.vector_state == VECTOR_IDLE or robot.is_searching:
        if select(robot, senses, c, draws, memory):
            robot.explore_ticks = NOT_EXPLORING
            start_vector(robot)
            arrived, x, y = go_to_goal(robot, senses, row, c, draws)
            if not arrived:
                return False, x, y
            stop_vector(robot)
            # Quirk finisher_tolerance_mismatch: starting within tolerance never counts as arriving.
            if not c.finisher_tolerance_mismatch and is_reached(robot, senses, row, c, memory):
                return True, 0.0, 0.0
    else:
        arrived, x, y = go_to_goal(robot, senses, row, c, draws)
        if not is_known(robot, c, memory):
            stop_vector(robot)
        elif not arrived:
            return False, x, y
        else:
            stop_vector(robot)
            if is_reached(robot, senses, row, c, memory):
                return True, 0.0, 0.0
    found, search_x, search_y = search(robot, senses, row, c, draws)
    return found, x + search_x, y + search_y


@part
def begin_detour(robot: np.record, senses: Senses, c: np.record, u: float) -> None:
    """Begin a detour where a robot has not come further for long; `u`, uniform in [0, 1), decides side and length."""
    dx = senses.x - robot.rest_x_m
    dy = senses.y - robot.rest_y_m
    if dx * dx + dy * dy > c.detour_way_m * c.detour_way_m:
        robot.rest_x_m = senses.x
        robot.rest_y_m = senses.y
        robot.rest_ticks = 0
    robot.rest_ticks += 1
    if robot.rest_ticks > c.detour_after_ticks and robot.detour_ticks == 0:
        share = abs(2.0 * u - 1.0)
        ticks = 1 + int(share * share * c.detour_longest_ticks)
        robot.detour_ticks = ticks if u < 0.5 else -ticks
        robot.rest_ticks = 0


@part
def go_round(robot: np.record, senses: Senses, x: float, y: float, c: np.record) -> tuple[float, float]:
    """One tick of a detour; returns the force, where (x, y) is the one towards the light.

    A robot drives along what is in its way, and a little off it. Where it sees nothing, it turns half way back to the
    light. So it goes round the end of a wall, or comes back and tries again.
    """
    side = 1.0 if robot.detour_ticks > 0 else -1.0
    robot.detour_ticks -= int(side)
    if not senses.obstacle:
        return _HALF_RIGHT * (x - side * y), _HALF_RIGHT * (side * x + y)
    away_x, away_y = avoidance(senses.obstacle_x, senses.obstacle_y, c)
    return side * away_y + _OFF_THE_WALL * away_x, -side * away_x + _OFF_THE_WALL * away_y


@part
def home(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[bool, float, float]:
    """One tick of carrying an object into the nest: towards the light, then deeper by a random amount.

    The drop distance from the nest centre is drawn uniformly between 0.01 m and the distance at entry, which spreads
    deliveries over the nest; inside, the robot also wanders. So does one outside that has been turning on the spot for
    longer than any turn takes. Two robots side by side may see each other in one heading only: each turns away, sees
    nothing, turns back, and so on for ever. Our choice: the paper does not say how they part.

    Returns:
        Whether the robot has reached its place to drop, and the force.
    """
    nest_x, nest_y = nearest_nest(senses.x, senses.y, c)
    dx = senses.x - nest_x
    dy = senses.y - nest_y
    distance = np.sqrt(dx * dx + dy * dy)
    sees_it = in_nest(row, c)
    if robot.activity == HOMING and sees_it:
        robot.drop_depth_m = c.drop_depth_min_m + (distance - c.drop_depth_min_m) * draws[DRAW_DEPTH]
        robot.activity = HOMING_IN_NEST
    if robot.activity == HOMING_IN_NEST and sees_it and distance <= robot.drop_depth_m:
        return True, 0.0, 0.0
    x, y = phototaxis(row[c.light : c.light + RING_SENSORS], c)
    if c.has_obstacles and robot.activity == HOMING:
        begin_detour(robot, senses, c, draws[DRAW_DEPTH])
        if robot.detour_ticks:
            x, y = go_round(robot, senses, x, y, c)
            return False, x, y
    if robot.activity == HOMING_IN_NEST:
        walk_x, walk_y = random_walk(robot, senses, c, draws[DRAW_WANDER])
    else:
        walk_x, walk_y = avoid(senses, c)
        if robot.turn_ticks > c.longest_turn_ticks:
            ahead_x, ahead_y = wander(robot, c, draws[DRAW_WANDER])
            walk_x += ahead_x
            walk_y += ahead_y
    return False, x + walk_x, y + walk_y


@part
def deliver_and_leave(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[float, float]:
    """One tick of homing or of leaving the nest; returns the force."""
    x = 0.0
    y = 0.0
    if robot.activity == HOMING or robot.activity == HOMING_IN_NEST:
        arrived, x, y = home(robot, senses, row, c, draws)
        if arrived:
            robot.activity = WAIT_DROP
    elif robot.activity == LEAVE_NEST:
        x, y = random_walk(robot, senses, c, draws[DRAW_WANDER])
    return x, y


@part
def hold(row: Row, c: np.record, action: Row) -> None:
    """Write the action of a robot that is not at work: it stands and keeps its cargo.

    The world heeds it in one tick only, that in which the robot comes back to work.
    """
    action[0] = 0.0
    action[1] = 0.0
    action[2] = GRASP if row[c.carrying] > 0.5 else RELEASE


@part
def _count_turning(robot: np.record, action: Row) -> None:
    """Count the ticks in a row in which a robot is told to turn on the spot or to stand."""
    robot.turn_ticks = 0 if action[0] + action[1] > 0.0 else robot.turn_ticks + 1


@part
def command(robot: np.record, x: float, y: float, c: np.record, drop_grip: float, action: Row) -> None:
    """Write the action: wheels for the summed force (x, y), gripper for the activity (`drop_grip` asks to drop)."""
    activity = robot.activity
    if activity in (WAIT_PICKUP, WAIT_DROP, LET_GO):
        action[0] = 0.0
        action[1] = 0.0
        robot.turn_ticks = 0
    else:
        drive(x, y, c, action)
        _count_turning(robot, action)
    if activity == WAIT_DROP:
        action[2] = drop_grip
    elif activity in (WAIT_PICKUP, HOMING, HOMING_IN_NEST, TRANSPORT):
        action[2] = GRASP  # empty: asks for the object below; carrying: holds
    else:
        action[2] = RELEASE
