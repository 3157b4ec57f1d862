"""A tiny episode worked out by hand: three robots, five ticks, one point per tick at work, a death and a repair.

Robot 1 dies before tick 3. Robot 2 is in repair in the ticks 2 and 3. The horizon is 5 ticks; tick 6 belongs to the
next run.

    tick                         1    2    3    4    5    6
    reward        robot 0        1    1    1    1    1    1
                  robot 1        1    1    0    0    0    1
                  robot 2        1    0    0    1    1    1
    terminated    robot 1                  x         x         (dead in 3; absent until its arena starts anew in 5)
    truncated     robots 0, 2                        x
    episode ends  robot 0                            5 points, 5 steps
                  robot 1                  2 points, 3 steps
                  robot 2                            3 points, 5 steps
"""

from collections.abc import Callable
from typing import Any

import numpy as np

N_ROBOTS = 3
HORIZON_TICKS = 5
N_TICKS = 6
WORLD: dict[str, Any] = {
    "scenario": "warehouse_small",
    "n_robots": N_ROBOTS,
    "n_objects": 4,
    "max_cycles": HORIZON_TICKS,
    "delivery": 0.0,
    "first_pickup": 0.0,
    "tick": 1.0,
}
REWARDS = np.array(
    [
        [1, 1, 1],
        [1, 1, 0],
        [1, 0, 0],
        [1, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
    ]
)
TERMINATED = np.zeros((N_TICKS, N_ROBOTS), bool)
TERMINATED[2, 1] = TERMINATED[4, 1] = True
TRUNCATED = np.zeros((N_TICKS, N_ROBOTS), bool)
TRUNCATED[4, [0, 2]] = True
EPISODES = {(2, 1): (2.0, 3), (4, 0): (5.0, 5), (4, 2): (3.0, 5)}
"""(tick - 1, robot) -> sum of rewards, steps."""
ACTIVE_BEFORE = np.array(
    [
        [1, 1, 1],
        [1, 1, 1],
        [1, 1, 0],
        [1, 0, 0],
        [1, 0, 1],
        [1, 1, 1],
    ],
    bool,
)
"""Whether the observation that an action is chosen on shows a robot at work."""

_ALL, _DEAD = np.ones(N_ROBOTS, bool), np.array([False, True, False])
_REPAIR = np.array([False, False, True])
CHANGES: dict[int, dict[str, np.ndarray]] = {
    1: {"active": ~_REPAIR, "present": _ALL},
    2: {"active": ~_REPAIR & ~_DEAD, "present": ~_DEAD, "terminated": _DEAD},
    3: {"active": ~_DEAD, "present": ~_DEAD, "terminated": _DEAD},
}
"""Ticks done -> what happens then to the population."""


def live(set_population: Callable[..., Any], step: Callable[[], Any]) -> list[Any]:
    """Tell the story: change the population between steps; returns what `step` returned, tick by tick."""
    told = []
    for done in range(N_TICKS):
        if done in CHANGES:
            set_population(**CHANGES[done])
        told.append(step())
    return told
