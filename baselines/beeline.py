"""A controller of one page: straight home, straight back to the last find, and wider and wider around it."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.detection import ring_sum
from swarm_forage_env.contract.robot_policy import RobotPolicy


class BeelinePolicy(RobotPolicy):
    """Straight home, and straight back to the last find."""

    caches: ClassVar[str] = "none"
    reads = ("proximity", "position", "heading", "carrying", "los_object")
    memory: ClassVar = {"find_m": (0.0, 0.0), "radius_m": math.inf, "goal_m": (0.0, 0.0), "going": False}
    memory |= {"blocked": 0, "detour": 0, "course": (0.0, 0.0)}
    parameters: Mapping[str, Any] = {
        "first_m": 0.0,  # half a side of the square for the first goal: the find itself
        "wider": 2.0,  # the next square: this times the last one,
        "near_m": 0.5,  # and this
        "sight_cells": 2,  # sees objects so far
        "inside": 0.4,  # aims at the inner part of the nest, as a share of its sides to either side
        "right": 2.0,  # turns so hard from what is in the way
        "patience": 300,  # ticks
    }
    draws = 2

    @staticmethod
    def step(see, robot, chance, known):
        """Choose wheels and gripper of one robot."""
        size, carrying = known.arena_size_m, see.carrying > 0.5
        place = (see.position[0] + 1.0) * size[0] / 2.0, (see.position[1] + 1.0) * size[1] / 2.0
        if carrying:  # home: the nearest point well inside the nest
            if robot.going:  # it has just picked up
                robot.going, robot.radius_m = False, known.first_m
                robot.find_m[0], robot.find_m[1] = place
            x, y = known.nest_centre_m[0] - place[0], known.nest_centre_m[1] - place[1]
            wide, high = known.inside * known.nest_size_m[0], known.inside * known.nest_size_m[1]
            x, y = x - min(wide, max(-wide, x)), y - min(high, max(-high, y))
        else:  # to a goal around the last find; each is further away than the one before
            arrived = math.hypot(robot.goal_m[0] - place[0], robot.goal_m[1] - place[1]) < 0.2
            if not robot.going or arrived or robot.blocked > known.patience:
                for k in range(2):
                    low = max(0.5, robot.find_m[k] - robot.radius_m)
                    robot.goal_m[k] = low + chance[k] * (min(size[k] - 0.5, robot.find_m[k] + robot.radius_m) - low)
                robot.going, robot.radius_m = True, known.wider * robot.radius_m + known.near_m
            x, y, nearest = robot.goal_m[0] - place[0], robot.goal_m[1] - place[1], 99
            for cell in range(25):  # or to the nearest object in view
                east, north = cell % 5 - 2, cell // 5 - 2
                is_near = max(abs(east), abs(north)) <= known.sight_cells
                if see.los_object[cell] > 0.0 and is_near and east * east + north * north < nearest:
                    x, y, nearest = 1.0 * east, 1.0 * north, east * east + north * north
        if robot.blocked > known.patience:  # to the left or right of the way for up to a minute
            robot.blocked, robot.detour = 0, int(chance[1] * known.patience)
            robot.course[0], robot.course[1] = (-y, x) if chance[0] < 0.5 else (y, -x)
        if robot.detour > 0:
            robot.detour -= 1
            x, y = robot.course[0], robot.course[1]
        far = max(1e-9, math.hypot(x, y))
        ahead, left = (x * see.heading[0] + y * see.heading[1]) / far, (y * see.heading[0] - x * see.heading[1]) / far
        near_ahead, near_left = ring_sum(see.proximity)
        in_the_way = ahead * near_ahead + left * near_left
        if in_the_way > 0.0:  # leave it on the left
            ahead, left = ahead + known.right * near_left, left - known.right * near_ahead
        robot.blocked = robot.blocked + 1 if in_the_way > 0.3 else max(0, robot.blocked - 1)
        turn, most = math.atan2(left, ahead), known.max_wheel_difference_mps / 2.0
        turning = min(most, max(-most, turn * known.wheel_base_m / known.dt_s / 2.0))
        speed, scale = known.max_speed_mps * max(0.0, math.cos(turn)), known.wheel_scale_mps
        return (speed - turning) / scale, (speed + turning) / scale, Grip.DELIVER if carrying else Grip.GRASP
