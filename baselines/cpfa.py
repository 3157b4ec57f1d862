"""CPFA: central-place foraging. Robots go out straight, search at random, and may return to where they found something.

The baseline of the literature on swarm foraging, beside the four controllers of the paper. A robot without cargo is in
one of these stages of a trip; all else is as in `crw`, with the same steering:

    CHOOSE   back where it found its last object, or in a new direction                            -> TRAVEL
    TRAVEL   straight ahead; at the place, or in a new direction at random                         -> SEARCH
    SEARCH   random walk (`search_turn_rad`), to the nearest object in view; under it              -> WAIT_PICKUP
             at random                                                                             -> GIVE_UP
    GIVE_UP  straight to the nest, with nothing; sees it                                           -> CHOOSE

Source: [Hecker and Moses 2015], section 3. What is "ours" below, the paper leaves open or has in another way for its
robots; docs/controllers.md lists it.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.detection import sees_object
from swarm_forage_env.contract.layout import GROUND_SENSORS, WINDOW_CELLS
from swarm_forage_env.contract.policy import Memories, RobotStates, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, ObsArray, Row

from .machines import (
    DELIVER,
    command,
    deliver_and_leave,
    follow_cargo,
    go_to_goal,
    hold,
    random_walk,
    start_vector,
    stop_vector,
)
from .parameters import ControllerParameters, ParameterError, kernel_constants
from .robots import (
    ACQUIRE,
    ACTIVITY_WORDS,
    DRAW_WANDER,
    DRAWS,
    HOMING,
    READS,
    VECTOR_IDLE,
    WAIT_DROP,
    WAIT_PICKUP,
    Senses,
    activity_codes,
    fetch_ahead,
    in_nest,
    nearest_nest,
    new_robots,
    sense,
)
from .scripted import ScriptedPolicy


class Stage(IntEnum):
    """Where on its trip a robot without cargo is; see above."""

    CHOOSE = 0
    TRAVEL = 1
    SEARCH = 2
    GIVE_UP = 3


CHOOSE = int(Stage.CHOOSE)
TRAVEL = int(Stage.TRAVEL)
SEARCH = int(Stage.SEARCH)
GIVE_UP = int(Stage.GIVE_UP)
STAGE_WORDS = ("setting out", "going out", "searching", "going home with nothing")
"""What the stages mean to people, behind `robots.ACTIVITY_WORDS`."""

WIDEST_TURN_RAD = 4.0 * math.pi
"""Standard deviation of turns when an informed search begins: any direction. Source: the paper."""
DRAW_DECISION = DRAWS
"""Draw column: a decision of the trip. There is at most one in a tick."""
DRAW_TURN = DRAWS + 1
"""Draw column: how wide a turn of the search is, or the direction of a trip."""
DRAW_TURN_SIDE = DRAWS + 2
"""Draw column: the same turn's second number."""
CPFA_DRAWS = DRAWS + 3
_WINDOW = WINDOW_CELLS * WINDOW_CELLS
_REACH = WINDOW_CELLS // 2

TRIP_FIELDS: list[tuple[str, type]] = [
    ("site_x_m", np.float64),  # where it picked up the object of its last trip
    ("site_y_m", np.float64),
    ("course_rad", np.float64),  # direction of the search, counter-clockwise from +x
    ("n_nearby", np.int32),  # further objects that it saw there
    ("search_ticks", np.int32),  # since the search began
    ("step_ticks", np.int32),  # left of a step of the search
    ("stage", np.int8),
    ("has_site", np.bool_),  # whether the last trip found an object
    ("is_informed", np.bool_),  # whether this trip goes to the site
]
"""What a robot keeps beside `robots.ROBOT_FIELDS`."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CPFAParameters(ControllerParameters):
    """Numbers of CPFA. Ticks are 0.2 s long; the first five are what the paper evolves.

    Values: evolved in the training worlds of the benchmark, see docs/controllers.md.
    """

    search_per_tick: float = 0.448
    """p_s: chance that a robot on its way in a new direction begins to search, 0 to 1."""
    give_up_per_tick: float = 0.0000218
    """p_r: chance that a searching robot gives up and goes home, 0 to 1."""
    uninformed_turn_rad: float = 0.000778
    """omega: standard deviation of the turn between two steps of a search, rad, 0 to 4 pi."""
    informed_decay_per_tick: float = 0.0357
    """lambda_id: rate at which the turns of an informed search become those of any other, per tick."""
    site_fidelity_rate: float = 0.0293
    """lambda_sf: the larger, the more objects a robot must have seen at a place to return there, 0 to 20."""
    search_step_s: float = 1.2
    """Time between two turns of a search, without that of turning on the spot; ours: 11 cm at the speed of a search."""
    site_tolerance_m: float = 0.2
    """A robot this near to the place it goes to is there; ours: nearer, it would ignore obstacles."""
    wall_margin_m: float = 0.5
    """A trip in a new direction ends this far from the walls; ours: before robots see them."""
    object_tolerance_m: float = 0.02
    """As in `MemoryParameters`."""

    def __post_init__(self) -> None:
        # super() without arguments fails in a slots dataclass, because that is a new class.
        ControllerParameters.__post_init__(self)
        for name, most in (
            ("search_per_tick", 1.0),
            ("give_up_per_tick", 1.0),
            ("uninformed_turn_rad", WIDEST_TURN_RAD),
            ("site_fidelity_rate", 20.0),
        ):
            if getattr(self, name) > most:
                raise ParameterError(f"Expected {name} <= {most:g}, got {getattr(self, name)}.")


@kernel
def poisson_cdf(count: int, rate: float) -> float:
    """Chance that a Poisson variable with this mean is at most `count`: exp(-rate) * sum of rate^i / i!, i <= count."""
    term = math.exp(-rate)
    total = term
    for i in range(1, count + 1):
        term *= rate / i
        total += term
    return total


@kernel
def search_turn_rad(is_informed: bool, ticks: int, c: np.record) -> float:
    """Standard deviation of the turn between two steps of a search that has lasted for some ticks, rad.

    omega; in an informed search omega + (4 pi - omega) exp(-lambda_id t), so that it begins on the spot and spreads.
    """
    if not is_informed:
        return c.uninformed_turn_rad
    excess = WIDEST_TURN_RAD - c.uninformed_turn_rad
    return c.uninformed_turn_rad + excess * math.exp(-c.informed_decay_per_tick * ticks)


@kernel
def normal(u: float, v: float) -> float:
    """Standard normal number of two uniform ones in [0, 1), by the method of Box and Muller."""
    return math.sqrt(-2.0 * math.log(1.0 - u)) * math.cos(2.0 * math.pi * v)


@part
def _way_to(place: float, direction: float, side: float, margin: float) -> float:
    """How far a robot can go along one axis, m: to `margin` before the wall that it heads for."""
    if direction == 0.0:
        return math.inf
    return ((side - margin if direction > 0.0 else margin) - place) / direction


@kernel
def aim_at_wall(robot: np.record, senses: Senses, angle_rad: float, c: np.record) -> None:
    """Make the goal the point before the wall that lies in a direction; where the robot stands, if it is beyond it."""
    ahead_x, ahead_y = math.cos(angle_rad), math.sin(angle_rad)
    along_x = _way_to(senses.x, ahead_x, 2.0 * c.half_width_m, c.wall_margin_m)
    along_y = _way_to(senses.y, ahead_y, 2.0 * c.half_height_m, c.wall_margin_m)
    way = max(0.0, min(along_x, along_y))
    robot.goal_x_m = senses.x + way * ahead_x
    robot.goal_y_m = senses.y + way * ahead_y


@part
def set_out(robot: np.record, senses: Senses, c: np.record, draws: Row) -> None:
    """Choose where the next trip goes: to the site with the probability POIS(c, lambda_sf), else in any direction."""
    robot.is_informed = robot.has_site and poisson_cdf(robot.n_nearby, c.site_fidelity_rate) > draws[DRAW_DECISION]
    if robot.is_informed:
        robot.goal_x_m = robot.site_x_m
        robot.goal_y_m = robot.site_y_m
    else:
        aim_at_wall(robot, senses, 2.0 * math.pi * draws[DRAW_TURN], c)
    robot.goal_tolerance_m = c.site_tolerance_m
    robot.stage = TRAVEL
    start_vector(robot)


@part
def heading_rad(row: Row, c: np.record) -> float:
    """Heading of a robot, rad counter-clockwise from +x."""
    return math.atan2(float(row[c.heading + 1]), float(row[c.heading]))


@part
def start_search(robot: np.record, row: Row, c: np.record) -> None:
    """Begin to search straight ahead."""
    robot.stage = SEARCH
    robot.search_ticks = 0
    keep_course(robot, row, c)


@part
def keep_course(robot: np.record, row: Row, c: np.record) -> None:
    """Search on straight ahead, with a new step."""
    robot.course_rad = heading_rad(row, c)
    robot.step_ticks = c.search_step_ticks
    stop_vector(robot)


@part
def give_up(robot: np.record, senses: Senses, c: np.record) -> None:
    """Go home with nothing, and forget the site."""
    robot.stage = GIVE_UP
    robot.has_site = False
    robot.goal_x_m, robot.goal_y_m = nearest_nest(senses.x, senses.y, c)
    robot.goal_tolerance_m = c.site_tolerance_m
    start_vector(robot)


@part
def remember_site(robot: np.record, senses: Senses, row: Row, c: np.record) -> None:
    """Remember where the robot has just picked up an object, and how many others it sees there."""
    robot.has_site = True
    robot.site_x_m = senses.x
    robot.site_y_m = senses.y
    robot.n_nearby = 0
    for k in range(_WINDOW):
        if row[c.los_object + k] > 0.0:
            robot.n_nearby += 1


@part
def aim_at_object(robot: np.record, senses: Senses, row: Row, c: np.record) -> bool:
    """Make the goal the middle of the cell of the nearest object in view; returns whether there is one."""
    left = (float(row[c.los_cell]) + 1.0) * c.half_width_m - _REACH * c.cell_m
    bottom = (float(row[c.los_cell + 1]) + 1.0) * c.half_height_m - _REACH * c.cell_m
    least = math.inf
    for k in range(_WINDOW):
        if row[c.los_object + k] > 0.0:
            x = left + k % WINDOW_CELLS * c.cell_m
            y = bottom + k // WINDOW_CELLS * c.cell_m
            away = (x - senses.x) ** 2 + (y - senses.y) ** 2
            if away < least:
                least = away
                robot.goal_x_m = x
                robot.goal_y_m = y
    robot.goal_tolerance_m = c.object_tolerance_m
    return least < math.inf


@part
def walk(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[float, float]:
    """One tick of the random walk of a search; returns the force.

    Steps of equal length, and between them turns that are normally distributed. A robot that avoids something goes on
    in the direction in which it avoids it (ours).
    """
    heading = heading_rad(row, c)
    if senses.obstacle:
        x, y = random_walk(robot, senses, c, draws[DRAW_WANDER])
        robot.course_rad = heading + math.atan2(y, x)
        return x, y
    if robot.turn_ticks == 0:
        robot.step_ticks -= 1
    if robot.step_ticks < 0:
        deviation = search_turn_rad(robot.is_informed, robot.search_ticks, c)
        robot.course_rad = heading + deviation * normal(draws[DRAW_TURN], draws[DRAW_TURN_SIDE])
        robot.step_ticks = c.search_step_ticks
    offset = robot.course_rad - heading
    return c.wander_speed_mps * math.cos(offset), c.wander_speed_mps * math.sin(offset)


@part
def search(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[bool, float, float]:
    """One tick of a search; returns whether the robot stands over an object, and the force."""
    robot.search_ticks += 1
    if sees_object(row[c.ground : c.ground + GROUND_SENSORS]):
        keep_course(robot, row, c)
        return True, 0.0, 0.0
    if aim_at_object(robot, senses, row, c):
        if robot.vector_state == VECTOR_IDLE:
            start_vector(robot)
        _, x, y = go_to_goal(robot, senses, row, c, draws)
        return False, x, y
    if robot.vector_state != VECTOR_IDLE:  # somebody else took it, or the robot lost sight of it
        keep_course(robot, row, c)
    x, y = walk(robot, senses, row, c, draws)
    return False, x, y


@part
def go_on_a_trip(robot: np.record, senses: Senses, row: Row, c: np.record, draws: Row) -> tuple[bool, float, float]:
    """One tick without cargo; returns whether the robot stands over an object that it searched for, and the force."""
    if robot.stage == GIVE_UP and in_nest(row, c):
        robot.stage = CHOOSE
    if robot.stage == CHOOSE:
        set_out(robot, senses, c, draws)
    elif robot.stage == TRAVEL and not robot.is_informed and draws[DRAW_DECISION] < c.search_per_tick:
        start_search(robot, row, c)
    elif robot.stage == SEARCH and draws[DRAW_DECISION] < c.give_up_per_tick:
        give_up(robot, senses, c)
    if robot.stage == SEARCH:
        return search(robot, senses, row, c, draws)
    arrived, x, y = go_to_goal(robot, senses, row, c, draws)
    if arrived and robot.stage == TRAVEL:
        start_search(robot, row, c)
    return False, x, y


@kernel
def step_cpfa(
    obs: ObsArray,
    active: BoolArray,
    draws: FloatArray,
    state: tuple[np.ndarray, np.ndarray, ActionArray],
    _now: int,
) -> None:
    """One tick of CPFA for all robots. `state` = constants (1,), robots (N,) edited, actions (N, A) written.

    `draws` is (N, CPFA_DRAWS) uniform in [0, 1). Inactive robots keep their state, and hold.
    """
    constants, robots, actions = state
    c = constants[0]
    for i in range(active.shape[0]):
        fetch_ahead(obs, robots, i, c)
        action = actions[i]
        if not active[i]:
            hold(obs[i], c, action)
            continue
        robot = robots[i]
        row = obs[i]
        senses = sense(row, c)
        before = robot.activity
        if follow_cargo(robot, senses, row, c, HOMING, ACQUIRE):
            remember_site(robot, senses, row, c)
        elif robot.activity == ACQUIRE and HOMING <= before <= WAIT_DROP:
            robot.stage = CHOOSE  # it has delivered, or lost its cargo
        if robot.activity == ACQUIRE:
            found, x, y = go_on_a_trip(robot, senses, row, c, draws[i])
            if found:
                robot.activity = WAIT_PICKUP
        else:
            x, y = deliver_and_leave(robot, senses, row, c, draws[i])
        command(robot, x, y, c, DELIVER, action)


class CPFAPolicy(ScriptedPolicy):
    """Search, and return to rich places.

    CPFA stands for central-place foraging algorithm, the baseline of many works on swarm foraging.
    """

    caches: ClassVar[str] = "none"
    reads: ClassVar[tuple[str, ...]] = (*READS, "los_cell", "los_object")
    default_parameters: ClassVar[CPFAParameters] = CPFAParameters()
    _kernel = staticmethod(step_cpfa)

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: every robot sets out from where it stands, in a direction of its own."""
        step_ticks = max(1, round(self.parameters.search_step_s / spec.dt_s)) - 1  # after the tick of the turn
        constants = kernel_constants(self.parameters, spec, search_step_ticks=step_ticks)
        self._start_script(spec, rng, CPFA_DRAWS, constants, new_robots(spec.n_robots, TRIP_FIELDS))

    def describe_robots(self) -> RobotStates:
        """Return what all robots are up to, as arrays."""
        on_a_trip = self._robots["activity"] == ACQUIRE
        stage = (len(ACTIVITY_WORDS) + self._robots["stage"]).astype(np.int8)
        codes = np.where(on_a_trip, stage, activity_codes(self._robots))
        return RobotStates(codes, (*ACTIVITY_WORDS, *STAGE_WORDS))

    def describe_memories(self) -> Memories:
        """Return where all robots found their last object."""
        robot = np.flatnonzero(self._robots["has_site"]).astype(np.int32)
        place_m = np.column_stack((self._robots["site_x_m"][robot], self._robots["site_y_m"][robot]))
        return Memories(robot, place_m, np.zeros(len(robot), np.bool_))
