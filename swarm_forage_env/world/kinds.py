"""What the kinds of a scenario mean for each robot, as the arrays that compiled functions read.

Where a scenario has no kinds, all robots have full speed and the whole window, and nothing is told or left out.
"""

import numpy as np

from swarm_forage_env.contract.layout import KIND_COLUMNS, WINDOW_CELLS, ObservationLayout
from swarm_forage_env.contract.types import FloatArray, IntArray, ObsArray
from swarm_forage_env.scenarios.robots import SENSORS, RobotConfig, RobotKind


def speeds(robots: RobotConfig) -> FloatArray:
    """Return the factor on the wheels' speeds of each robot, (N,)."""
    found = np.ones(robots.n_robots)
    for kind, rows in zip(robots.robot_kinds, robots.kind_rows, strict=True):
        found[rows] = kind.speed
    return found


def half_windows(robots: RobotConfig) -> IntArray:
    """Return how many cells each robot sees on either side of its own, (N,)."""
    found = np.full(robots.n_robots, WINDOW_CELLS // 2, np.int32)
    for kind, rows in zip(robots.robot_kinds, robots.kind_rows, strict=True):
        found[rows] = kind.window_cells // 2
    return found


def kind_columns(robots: RobotConfig) -> ObsArray:
    """Return what each robot observes of its kind, (N, C); (0, C) where robots do not differ."""
    if not robots.tells_kinds:
        return np.zeros((0, len(KIND_COLUMNS)), np.float32)
    found = np.zeros((robots.n_robots, len(KIND_COLUMNS)), np.float32)
    for kind, rows in zip(robots.robot_kinds, robots.kind_rows, strict=True):
        found[rows] = _told(kind)
    return found


def _told(kind: RobotKind) -> list[float]:
    """Return `KIND_COLUMNS` of one kind."""
    has = [0.0 if sensor in kind.lacks else 1.0 for sensor in SENSORS]
    return [kind.speed, kind.window_cells / WINDOW_CELLS, *has]


def blank_boxes(robots: RobotConfig, layout: ObservationLayout) -> IntArray:
    """Return which rows and columns of an observation stay zero, (B, 4): see `kernels.kinds.blank`."""
    boxes = [
        (rows.start, rows.stop, layout[name].start, layout[name].stop)
        for kind, rows in zip(robots.robot_kinds, robots.kind_rows, strict=True)
        for name in kind.lacks
        if name in layout.names  # of neighbours and messages there may be none
    ]
    return np.array(boxes, np.int32).reshape(-1, 4)
