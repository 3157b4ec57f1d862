"""The rows of a batch of robots, for learners: what a step adds to the episode of each."""

from typing import NamedTuple

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray


class Robots(NamedTuple):
    """The robots of an arena as they are after a step."""

    dead: BoolArray
    """(N,)"""
    is_present: BoolArray
    """(N,) in the world."""
    is_active: BoolArray
    """(N,) at work."""
    obs: ObsArray
    """(N, D)"""


@kernel
def book_rows(
    dead: BoolArray,
    is_present: BoolArray,
    is_active: BoolArray,
    reward: ObsArray,
    absent: BoolArray,
    present: BoolArray,
    returns: FloatArray,
    lengths: IntArray,
    terminated: BoolArray,
    active: BoolArray,
) -> int:
    """Book a step of one arena; returns how many rows terminate.

    Args:
        dead: (N,) robots that are dead after the step.
        is_present: (N,) robots in the world after the step.
        is_active: (N,) robots at work after the step.
        reward: (N,) float32, of this step.
        absent: (N,) rows that had terminated before.
        present: (N,) robots in the world before the step; becomes `is_present`.
        returns: (N,) the sums of rewards grow by `reward`.
        lengths: (N,) int32, grow by 1 where the robot was in the world before the step: if it died, it had begun it.
        terminated: (N,) is written.
        active: (N,) is written.
    """
    n_terminated = 0
    for i in range(dead.shape[0]):
        lengths[i] += present[i]
        returns[i] += reward[i]
        present[i] = is_present[i]
        active[i] = is_active[i]
        terminated[i] = dead[i] and not absent[i]
        n_terminated += terminated[i]
    return n_terminated
