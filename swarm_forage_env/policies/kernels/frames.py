"""Frames of their own: robots that see the world turned and mirrored, each in another way, and act accordingly.

A swarm that shares a network has one taste for directions: where the network tends to the left in doubt, all robots do,
and search the same part of the arena. With frames of their own they spread, and a robot that takes another frame from
time to time does not stay where it was (our choice; `policies.frames` has the eight ways). A frame follows from the
number of the robot and that of the decision, so nothing has to be stored.
"""

from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import ActionArray, IntArray, ObsArray

N_FRAMES = 8
N_UPRIGHT = 4
"""Frames before this one are turned only, the others are mirrored before."""
APART = 7
"""Decisions by which robots change their frames one after the other."""
OF_ROBOT, OF_PERIOD = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xD1B54A32D192ED03)
FIRST_FACTOR, SECOND_FACTOR = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


class Frames(NamedTuple):
    """How robots see the world."""

    length: int
    """Decisions for which a robot keeps a frame; 0 = all see the world as it is."""
    source: IntArray
    """(N_FRAMES, d): column c of what a robot sees is column `source[frame, c]` of the world as it is ..."""
    sign: ObsArray
    """(N_FRAMES, d): ... times `sign[frame, c]`."""
    taken: IntArray
    """(N,) the frame of each robot in the last decision."""
    row: ObsArray
    """(d,) room to work in."""


@kernel
def frame_of(robot: int, decision: int, length: int) -> int:
    """Return the frame of a robot in a decision, 0 to 7: the robot's number and the period, well mixed (SplitMix64)."""
    period = np.uint64((decision + APART * robot) // length)
    mixed = np.uint64(robot + 1) * OF_ROBOT + period * OF_PERIOD  # modulo 2^64
    mixed = (mixed ^ (mixed >> np.uint64(30))) * FIRST_FACTOR
    mixed = (mixed ^ (mixed >> np.uint64(27))) * SECOND_FACTOR
    return int((mixed ^ (mixed >> np.uint64(31))) >> np.uint64(61))


@kernel
def take_frames(view: ObsArray, decision: int, frames: Frames) -> None:
    """Show every robot what it sees, (N, d), in its frame of this decision."""
    if frames.length == 0:
        return
    row, source, sign, taken = frames.row, frames.source, frames.sign, frames.taken
    for i in range(view.shape[0]):
        frame = frame_of(i, decision, frames.length)
        taken[i] = frame
        for c in range(view.shape[1]):
            row[c] = view[i, c]
        for c in range(view.shape[1]):
            view[i, c] = row[source[frame, c]] * sign[frame, c]


@kernel
def leave_frames(actions: ActionArray, frames: Frames) -> None:
    """Turn commands (N, A) of robots in their frames into commands in the world: in a mirrored one, left is right."""
    if frames.length == 0:
        return
    for i in range(actions.shape[0]):
        if frames.taken[i] >= N_UPRIGHT:
            left = actions[i, 0]
            actions[i, 0] = actions[i, 1]
            actions[i, 1] = left
