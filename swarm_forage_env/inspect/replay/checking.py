"""What the arrays of a replay may be, for files are anybody's: shapes before they are unpacked, numbers afterwards."""

import math
from collections.abc import Mapping

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.typed import check_array
from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.inspect.replay.frames import Replay
from swarm_forage_env.scenarios.config import ScenarioConfig

MOST_BYTES = 2**31
"""Bytes of the arrays of a page, unpacked. Our choice: twice a run of 16,384 robots in 10,000 frames."""
_STEPS = np.iinfo(np.uint16).max
"""The largest place, in steps."""
_CELLS = np.iinfo(np.int32).max

Shape = tuple[int | None, ...]
"""None = any length."""


def n_frames(frame_ticks: int, end_tick: int) -> int:
    """Return how many frames a replay has: one at the start, one after every `frame_ticks`, and one at the end."""
    return 1 + math.ceil(end_tick / frame_ticks)


def shapes(scenario: ScenarioConfig, frames: int, remembered_frames: int) -> dict[str, Shape]:
    """Return the shape of each array of a `Replay`; those of signals are (frames,)."""
    n_robots = scenario.robots.n_robots
    return {
        "position": (frames, n_robots, 2),
        "heading": (frames, n_robots),
        "status": (frames, n_robots),
        "activity": (frames, n_robots),
        "remembered": (math.ceil(frames / remembered_frames), n_robots),
        "counters": (frames, None),
        "object_events": (None, 5),
        "deliveries": (None, 4),
        "cache_events": (None, 5),
        "memory_events": (None, 5),
    }


def check_numbers(replay: Replay) -> None:
    """Refuse numbers that point to frames, robots, objects or words that the run does not have.

    Raises:
        ConfigError: with the name of the array.
    """
    scenario, frames = replay.scenario, replay.n_frames
    n_robots, n_objects = scenario.robots.n_robots, scenario.objects.n_objects
    frame, robot, step = (0, frames - 1), (0, n_robots - 1), (0, _STEPS)
    cell = (-1, max(scenario.arena.n_cells))
    statuses = (min(ObjectStatus), max(ObjectStatus))
    carried = replay.object_events[:, 2] == ObjectStatus.CARRIED
    columns: Mapping[str, tuple[np.ndarray | None, tuple[tuple[int, int], ...]]] = {
        "object_events": (replay.object_events, (frame, (0, n_objects - 1), statuses, (-1, _CELLS), (-1, _CELLS))),
        "the robots in object_events": (replay.object_events[carried][:, 3:], (robot, (-1, _CELLS))),
        "the cells in object_events": (replay.object_events[~carried][:, 3:], (cell, cell)),
        "deliveries": (replay.deliveries, ((0, replay.end_tick), robot, step, step)),
        "cache_events": (replay.cache_events, (frame, (0, _CELLS), (0, n_objects), cell, cell)),
        "memory_events": (replay.memory_events, (frame, robot, (-2, 2), step, step)),
    }
    for name, (array, limits) in columns.items():
        if array is None or not len(array):
            continue
        low, high = np.array(limits).T
        if (array < low).any() or (array > high).any():
            raise ConfigError(
                f"Expected {name} to be from {low.tolist()} to {high.tolist()}, got {array.min(axis=0).tolist()} to "
                f"{array.max(axis=0).tolist()}."
            )
    if replay.activity is not None and replay.activity.max(initial=0) >= max(1, len(replay.activities)):
        raise ConfigError(f"Expected activity below {len(replay.activities)}, got {replay.activity.max()}.")
    for name, values in replay.signals.items():
        check_array(f"signal {name}", values, np.float32, (frames,))
