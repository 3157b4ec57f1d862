"""Search where the last object lay, and carry it to the light: one function for one robot, compiled."""

import math

from numba import njit

from swarm_forage_env import Grip, RobotPolicy
from swarm_forage_env.contract.detection import ring_sum, sees_nest, sees_object


class SearchNearby(RobotPolicy):
    reads = ("proximity", "light if carrying", "ground", "position", "heading", "carrying")
    memory = {"bend": 0.0, "found": False, "place_m": (0.0, 0.0)}  # of each robot, when a run starts
    parameters = {"restless": 0.05, "near_m": 1.0}
    draws = 1  # random numbers per robot and tick

    @staticmethod
    def step(see, robot, chance, known):
        carrying = see.carrying > 0.5
        if sees_nest(see.ground) if carrying else sees_object(see.ground):
            if not carrying:
                robot.found = True
                robot.place_m[0], robot.place_m[1] = place_of(see, known)
            return 0.0, 0.0, Grip.DELIVER if carrying else Grip.GRASP  # it takes two ticks
        robot.bend = 0.9 * robot.bend + known.restless * (chance[0] - 0.5)
        ahead, left = 1.0, robot.bend
        if carrying:
            ahead, left = ring_sum(see.light)
        elif robot.found:
            x, y = place_of(see, known)
            dx, dy = robot.place_m[0] - x, robot.place_m[1] - y
            ahead = dx * see.heading[0] + dy * see.heading[1]
            left = dy * see.heading[0] - dx * see.heading[1]
            robot.found = math.hypot(dx, dy) > known.near_m  # from there on it wanders again
        near_ahead, near_left = ring_sum(see.proximity)
        turn = math.atan2(left - 3.0 * near_left, ahead - 3.0 * near_ahead)
        turn = min(1.0, max(-1.0, turn))
        full = known.max_speed_mps / known.wheel_scale_mps
        return full * (1.0 - turn), full * (1.0 + turn), Grip.DELIVER if carrying else Grip.GRASP


@njit
def place_of(see, known):
    width_m, height_m = known.arena_size_m
    return (see.position[0] + 1.0) * width_m / 2.0, (see.position[1] + 1.0) * height_m / 2.0
