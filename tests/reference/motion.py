"""Slow twins of the differential drive and of touching robots: one robot, or pair, at a time, in Python floats."""

import math

MAX_SPEED_MPS = 0.10
MAX_DIFFERENCE_MPS = 0.20
WHEEL_SCALE_MPS = 0.20
WHEEL_BASE_M = 0.14


def clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def limited_wheels(left: float, right: float) -> tuple[float, float]:
    """Wheel speeds in m/s for a command in [-1, 1]: centre speed and difference are clipped separately."""
    return limited_speeds(clip(left, 1.0) * WHEEL_SCALE_MPS, clip(right, 1.0) * WHEEL_SCALE_MPS)


def limited_speeds(left: float, right: float) -> tuple[float, float]:
    """Wheel speeds in m/s with centre speed and difference clipped separately."""
    speed = clip((left + right) / 2, MAX_SPEED_MPS)
    difference = clip(right - left, MAX_DIFFERENCE_MPS)
    return speed - difference / 2, speed + difference / 2


def free_motion(
    pose: tuple[float, float, float], wheels: tuple[float, float], seconds: float, base_m: float = WHEEL_BASE_M
) -> tuple[float, float, float]:
    """Pose after driving with constant wheel speeds: a straight line or an arc of a circle."""
    x, y, heading = pose
    left, right = wheels
    speed, turn_rate = (left + right) / 2, (right - left) / base_m
    if turn_rate == 0.0:
        return x + speed * seconds * math.cos(heading), y + speed * seconds * math.sin(heading), heading
    radius = speed / turn_rate
    end = heading + turn_rate * seconds
    return x + radius * (math.sin(end) - math.sin(heading)), y - radius * (math.cos(end) - math.cos(heading)), end


Vector = tuple[float, float]


def pressed_velocities(
    places: list[Vector],
    commands: list[Vector],
    present: list[bool],
    touch_m: float,
    before: dict[tuple[int, int], float],
) -> tuple[list[Vector], dict[tuple[int, int], float]]:
    """Velocities after contact, and the common speed of each pressing pair i < j along the line from i to j."""
    wanted: list[list[tuple[float, Vector]]] = [[] for _ in places]
    after = {}
    for i in range(len(places)):
        for j in range(i + 1, len(places)):
            away = (places[j][0] - places[i][0], places[j][1] - places[i][1])
            distance = math.hypot(*away)
            if not (present[i] and present[j]) or not 0.0 < distance <= touch_m:
                continue
            normal = (away[0] / distance, away[1] / distance)
            speed_i = commands[i][0] * normal[0] + commands[i][1] * normal[1]
            speed_j = commands[j][0] * normal[0] + commands[j][1] * normal[1]
            c_i, c_j = speed_i, -speed_j
            if c_i + c_j <= 0.0:
                continue
            u = before.get((i, j), (c_i - c_j) / 2)
            if u == 0.0:  # nobody is stronger: eastwards, or northwards
                u = 3e-4 if normal > (0.0, 0.0) else -3e-4
            elif abs(u) < 3e-4:
                u = 3e-4 if u > 0.0 else -3e-4
            u = min(max(u, -c_j), c_i)
            after[i, j] = u
            wanted[i].append((c_i + c_j, ((u - speed_i) * normal[0], (u - speed_i) * normal[1])))
            wanted[j].append((c_i + c_j, ((u - speed_j) * normal[0], (u - speed_j) * normal[1])))
    velocities = []
    for command, changes in zip(commands, wanted, strict=True):
        total = sum(weight for weight, _ in changes)
        x = sum(weight * change[0] for weight, change in changes) / total if changes else 0.0
        y = sum(weight * change[1] for weight, change in changes) / total if changes else 0.0
        velocities.append((command[0] + x, command[1] + y))
    return velocities, after
