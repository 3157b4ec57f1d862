"""Site memory: two places that each robot remembers, from what it senses itself.

* The *pickup site*: where it picked an object up last. Going back there is site fidelity, as of foraging ants.
* The *sighting site*: where it last saw an object while it carried another one.

A robot without cargo that comes near a site and sees no object forgets it. Our choice: so little that a network can use
it, and enough to come back to a cluster.
"""

import math
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.policies.kernels.compact import nearest_object, write_direction
from swarm_forage_env.scenarios.floor import CELLS_PER_M

N_SITES = 2
SITE_COLUMNS = 4
"""Of one site: forward, left, 1 if there is one (`write_direction`), distance."""
PICKUP, SIGHTING = 0, 1
FAR_M = 20.0
"""Distance from which on a site counts as far (our choice: more than half of an arena of 32 m)."""
_LEAST_REACH = 0.5
"""Cells: so near to a site a robot has arrived, also one that sees only the cell it stands on."""


class SiteMemory(NamedTuple):
    """What all robots remember."""

    place: FloatArray
    """(N, N_SITES, 2) m from the middle of the arena."""
    is_known: BoolArray
    """(N, N_SITES)."""
    carried: BoolArray
    """(N,) whether the robot carried an object when it looked last."""


def new_site_memory(n_robots: int) -> SiteMemory:
    """Return memories without any site."""
    return SiteMemory(
        np.zeros((n_robots, N_SITES, 2)), np.zeros((n_robots, N_SITES), np.bool_), np.zeros(n_robots, np.bool_)
    )


@kernel
def is_near(place: FloatArray, x: float, y: float, reach_cells: int) -> bool:
    """Return whether a place lies in the window of a robot at (x, y), wherever in its cell the robot is.

    `reach_cells` on either side of its own are in the window.
    """
    near_m = max(reach_cells, _LEAST_REACH) / CELLS_PER_M
    return abs(place[0] - x) < near_m and abs(place[1] - y) < near_m


@kernel
def remember_sites(
    obs: ObsArray,
    pose_starts: tuple[int, int],
    cargo_starts: tuple[int, int, int],
    half: tuple[float, float],
    reach_cells: IntArray,
    memory: SiteMemory,
) -> None:
    """Bring the memories up to date with observations (N, D); twice with the same ones is as good as once.

    Rows of robots that are not in the world forget everything. `pose_starts` = first columns of position, heading;
    `cargo_starts` = those of carrying, los_cell, los_object; `half` = half the arena, m; `reach_cells` (N,): `is_near`.
    """
    position, heading = pose_starts
    carrying, cell, window = cargo_starts
    half_x, half_y = half
    for i in range(obs.shape[0]):
        row = obs[i]
        place = memory.place[i]
        is_known = memory.is_known[i]
        if row[heading] == 0.0 and row[heading + 1] == 0.0:
            is_known[:] = False
            memory.carried[i] = False
            continue
        x = row[position] * half_x
        y = row[position + 1] * half_y
        carries = row[carrying] > 0.5
        off_x, off_y = nearest_object(row, (position, cell, window), half_x, half_y)
        sees = off_x != math.inf
        if carries and not memory.carried[i]:
            place[PICKUP, 0] = x
            place[PICKUP, 1] = y
            is_known[PICKUP] = True
            if is_near(place[SIGHTING], x, y, reach_cells[i]):
                is_known[SIGHTING] = False  # it was this object
        memory.carried[i] = carries
        if carries and sees:
            place[SIGHTING, 0] = x + off_x
            place[SIGHTING, 1] = y + off_y
            is_known[SIGHTING] = True
        if not carries and not sees:
            for k in range(N_SITES):
                if is_near(place[k], x, y, reach_cells[i]):
                    is_known[k] = False


@kernel
def show_sites(
    obs: ObsArray, pose_starts: tuple[int, int], half: tuple[float, float], memory: SiteMemory, out: ObsArray
) -> None:
    """Write what is remembered, N_SITES times SITE_COLUMNS columns of `out`.

    `pose_starts` = first columns of position, heading in `obs` (N, D); `half` = half the arena, m.
    """
    position, heading = pose_starts
    half_x, half_y = half
    for i in range(obs.shape[0]):
        row = obs[i]
        for k in range(N_SITES):
            at = k * SITE_COLUMNS
            if not memory.is_known[i, k]:
                out[i, at : at + SITE_COLUMNS] = 0.0
                continue
            x = memory.place[i, k, 0] - row[position] * half_x
            y = memory.place[i, k, 1] - row[position + 1] * half_y
            write_direction(out[i], at, x, y, row[heading], row[heading + 1])
            out[i, at + 3] = min(1.0, math.sqrt(x * x + y * y) / FAR_M)
