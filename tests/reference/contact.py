"""Touching robots told slowly: every pair by itself, in Python floats, with a dictionary for what is remembered."""

import math

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
