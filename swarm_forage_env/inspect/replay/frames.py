"""Replay: a run as arrays of what happened where and when, one row per frame.

Axes: F frames, N robots, M objects, E events. Frames are evenly spaced in time; the first is the start of the run and
the last its end, which may come sooner after the frame before.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M

POSITION_STEP_M = 0.005
"""Positions are stored in steps of this size (our choice: 3 % of a robot's diameter), or larger ones in huge arenas."""
HEADING_STEPS = 256
"""Headings are stored in steps of this part of a turn: 1.4 degrees."""
TASK_SHIFT = 4
"""Bit of `status` at which the task's code begins; it takes three bits."""

Small: TypeAlias = NDArray[np.uint8]
Middle: TypeAlias = NDArray[np.uint16]
Whole: TypeAlias = NDArray[np.int32]


class Status(IntFlag):
    """Bits of a robot's status; `Task` codes stand above them, from bit `TASK_SHIFT` on."""

    CARRYING = 1
    INTERFERING = 2
    REPAIR = 4
    """Present, but not part of the tasked swarm."""
    ABSENT = 8
    """Dead or not yet born. Its position is the last one that it had in the world."""
    HANDLING = 128
    """In the middle of a pick-up or a drop."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """One run, seen at F frames."""

    spec: RunSpec
    """The run; the replay may end before it does."""
    label: str
    """Name of the policy, for people."""
    frame_ticks: int
    """Ticks between two frames."""
    end_tick: int
    """Tick of the last frame."""
    position: Middle
    """(F, N, 2) in steps of `position_step_m`."""
    heading: Small
    """(F, N) in 1/256 of a turn, counter-clockwise from +x."""
    status: Small
    """(F, N) bits of `Status`, and the `Task` code."""
    activity: Small | None
    """(F, N) indices into `activities`; None where the policy does not tell."""
    activities: tuple[str, ...]
    """What robots may be up to, as the policy calls it."""
    counters: Whole
    """(F, counters) what the world has counted since the start, by `Counter` code."""
    object_events: Whole
    """(E, 5) frame, object row, `ObjectStatus`, and cell x, y; of a carried object robot row and -1. Frame 0 has all
    objects, later ones those that changed. So a change that is undone within a frame is missing; counters miss none."""
    deliveries: Whole
    """(E, 4) tick in which an object was delivered to the nest, robot row, and where the robot was, x, y in steps of
    `position_step_m`; in order of ticks. There are as many as `counters` has."""
    cache_events: Whole
    """(E, 5) frame, slot, number of objects (0 = the cache is gone), and centre cell x, y."""
    memory_events: Whole | None = None
    """(E, 5) frame, robot row, what is new, and where, x, y in steps of `position_step_m`: 1 = an object is remembered
    there, 2 = a cache, -1 and -2 = no more. In order of robots, then of frames; frame 0 has what all remember then.
    None where the policy does not tell."""
    signals: Mapping[str, NDArray[np.float32]]
    """(F,) each: throttle or handling cost at the frames, by name of the wrapper."""
    versions: Mapping[str, str]
    """What made the run."""
    has_tasks: bool = False
    """Whether the policy has tasks."""

    @property
    def scenario(self) -> ScenarioConfig:
        """The scenario of the run."""
        return self.spec.scenario

    @property
    def n_frames(self) -> int:
        """F."""
        return len(self.status)

    @property
    def ticks(self) -> Whole:
        """(F,) ticks done since the start, at each frame."""
        return np.minimum(np.arange(self.n_frames) * self.frame_ticks, self.end_tick).astype(np.int32)

    @property
    def times_s(self) -> FloatArray:
        """(F,) simulated seconds since the start."""
        return np.multiply(self.ticks, self.scenario.dt_s, dtype=np.float64)

    @property
    def position_step_m(self) -> float:
        """Metres per step of `position`; the error is half of it."""
        return position_step_m(self.scenario)

    @property
    def position_m(self) -> FloatArray:
        """(F, N, 2) m."""
        return np.multiply(self.position, self.position_step_m, dtype=np.float64)

    def has(self, flag: Status) -> NDArray[np.bool_]:
        """Return where a flag of the status is set, (F, N)."""
        return (self.status & flag) != 0

    @property
    def handovers(self) -> tuple[Whole, Whole, FloatArray]:
        """Where robots took and left objects.

        Returns:
            The frames in which they had done so, (E,); +1 for a pick-up and -1 for a drop, (E,); and where, (E, 2) m:
            the cell in which a free object lay, else where the robot was.
        """
        events = self.object_events
        events = events[np.lexsort((events[:, 0], events[:, 1]))]  # every object's story, one after the other
        after, before = events[1:], events[:-1]
        same = after[:, 1] == before[:, 1]
        taken, left = (same & (part[:, 2] == ObjectStatus.CARRIED) for part in (after, before))
        position_m = self.position_m
        lay_m = (before[taken, 3:] + 0.5) * CELL_M
        at_robot_m = position_m[after[taken, 0], after[taken, 3]]
        taken_m = np.where(before[taken, 2, None] == ObjectStatus.FREE, lay_m, at_robot_m)
        left_m = position_m[after[left, 0], before[left, 3]]
        frames = np.concatenate((after[taken, 0], after[left, 0]))
        signs = np.repeat(np.array([1, -1], np.int32), (taken.sum(), left.sum()))
        in_time = np.argsort(frames, kind="stable")
        return frames[in_time], signs[in_time], np.concatenate((taken_m, left_m))[in_time]


def position_step_m(scenario: ScenarioConfig) -> float:
    """Return the step in which positions of a scenario are stored: they must fit into 16 bits."""
    longer_m = max(scenario.arena.width_m, scenario.arena.height_m)
    return max(POSITION_STEP_M, longer_m / np.iinfo(np.uint16).max)
