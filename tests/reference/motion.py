"""Slow twin of the differential drive: one robot at a time, in Python floats."""

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
    pose: tuple[float, float, float], wheels: tuple[float, float], seconds: float
) -> tuple[float, float, float]:
    """Pose after driving with constant wheel speeds: a straight line or an arc of a circle."""
    x, y, heading = pose
    left, right = wheels
    speed, turn_rate = (left + right) / 2, (right - left) / WHEEL_BASE_M
    if turn_rate == 0.0:
        return x + speed * seconds * math.cos(heading), y + speed * seconds * math.sin(heading), heading
    radius = speed / turn_rate
    end = heading + turn_rate * seconds
    return x + radius * (math.sin(end) - math.sin(heading)), y - radius * (math.cos(end) - math.cos(heading)), end


def steered_wheels(force_cms: float, angle_deg: float) -> tuple[float, float]:
    """Wheel speeds in m/s of the study's steering: soft turns up to 15 degrees, beyond them turns on the spot."""
    base, share = min(force_cms, 10.0) / 100, abs(angle_deg) / 15
    slow, fast = (base * (1 - share), base * (1 + share)) if share <= 1 else (-0.10, 0.10)
    return (slow, fast) if angle_deg > 0 else (fast, slow)


def held_inside(poses: list[tuple[float, float]], room: tuple[float, float, float, float]) -> list[tuple[float, float]]:
    """Places moved along each axis to the nearest point of a closed rectangle."""
    x_low, y_low, x_high, y_high = room
    held = []
    for x, y in poses:
        inside_x = x_low if x < x_low else x_high if x > x_high else x
        inside_y = y_low if y < y_low else y_high if y > y_high else y
        held.append((inside_x, inside_y))
    return held
