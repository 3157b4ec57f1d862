"""Frames of robots' own, by the rules of `policies.kernels.frames`: slow and obvious."""

import numpy as np

from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.policies.frames import turned_columns

_BITS = 2**64


def frame(robot: int, decision: int, length: int) -> int:
    """Number of the frame: SplitMix64 of the robot's number and the period, its three highest bits."""
    period = (decision + 7 * robot) // length
    mixed = ((robot + 1) * 0x9E3779B97F4A7C15 + period * 0xD1B54A32D192ED03) % _BITS
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9 % _BITS
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EB % _BITS
    return (mixed ^ (mixed >> 31)) >> 61


def seen(rows: np.ndarray, layout: ObservationLayout, decision: int, length: int) -> np.ndarray:
    """What robots see in their frames, (N, d), from what they would see in the world as it is."""
    turned = []
    for robot, row in enumerate(rows):
        source, sign = turned_columns(frame(robot, decision, length), layout)
        turned.append(row[source] * sign)
    return np.array(turned)


def commands(wanted: np.ndarray, decision: int, length: int) -> np.ndarray:
    """What robots do, (N, A), who want this in what they see."""
    done = wanted.copy()
    for robot, row in enumerate(done):
        if frame(robot, decision, length) >= 4:  # mirrored
            row[:2] = row[1::-1]
    return done
