"""What robots perceive of each other: the nearest of them, and what is said around them.

Cells of the bins are a little larger than the range, so that all robots in range are in the nine cells around a robot.
"""

from swarm_forage_env._internal.compiling import inline_kernel, kernel
from swarm_forage_env.contract.layout import NEIGHBOUR_FIELDS
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.bins import bin_of, cell_of
from swarm_forage_env.world.state import Bins


@inline_kernel
def _next_in_cell(j: int, cell_x: int, cell_y: int, position: FloatArray, bins: Bins) -> int:
    """First robot from `j` on, along the list of its bin, that is really in the cell; -1 = none.

    Several cells may share a bin. Without this look a robot would be met twice where two of the nine cells do.
    """
    while j >= 0 and (cell_of(position[j, 0], bins[0]) != cell_x or cell_of(position[j, 1], bins[0]) != cell_y):
        j = bins[2][j]
    return j


@kernel
def see_neighbours(
    position: FloatArray,
    facing: FloatArray,
    present: BoolArray,
    carried_object: IntArray,
    bins: Bins,
    range_m: float,
    nearest: tuple[FloatArray, IntArray],
    obs: ObsArray,
    start: int,
) -> None:
    """Write forward and left over the range, carrying, and 1, for each of the nearest robots; zeros where none is left.

    Args:
        position: (N, 2) m.
        facing: (N, 2) cosine and sine of the heading.
        present: (N,) robots in the world; others neither see nor are seen.
        carried_object: (N,) -1 = none.
        bins: Cell size in m, first_in_bin, next_in_bin.
        range_m: Between centres; at most the size of a cell.
        nearest: Squared distances (K,) and rows (K,), scratch; K = neighbours that are seen. Nearest first, of equally
            near ones the lower row.
        obs: (N, D), 4 K columns from `start` are written.
        start: First column.
    """
    cell_m, first_in_bin, next_in_bin = bins
    squared, rows = nearest
    n_seen = rows.shape[0]
    for i in range(position.shape[0]):
        obs[i, start : start + NEIGHBOUR_FIELDS * n_seen] = 0.0
        if not present[i]:
            continue
        x = position[i, 0]
        y = position[i, 1]
        n_found = 0
        for k in range(9):
            cell_x = cell_of(x, cell_m) + k % 3 - 1
            cell_y = cell_of(y, cell_m) + k // 3 - 1
            j = _next_in_cell(
                first_in_bin[bin_of(cell_x, cell_y, first_in_bin.shape[0])], cell_x, cell_y, position, bins
            )
            while j >= 0:
                dx = position[j, 0] - x
                dy = position[j, 1] - y
                distance = dx * dx + dy * dy
                if j != i and distance <= range_m * range_m:
                    place = n_found
                    while place > 0 and (
                        squared[place - 1] > distance or (squared[place - 1] == distance and rows[place - 1] > j)
                    ):
                        place -= 1
                    n_found = min(n_found + 1, n_seen)
                    for behind in range(n_found - 1, place, -1):
                        squared[behind] = squared[behind - 1]
                        rows[behind] = rows[behind - 1]
                    if place < n_seen:
                        squared[place] = distance
                        rows[place] = j
                j = _next_in_cell(next_in_bin[j], cell_x, cell_y, position, bins)
        for k in range(n_found):
            at = start + NEIGHBOUR_FIELDS * k
            dx = (position[rows[k], 0] - x) / range_m
            dy = (position[rows[k], 1] - y) / range_m
            # At the very end of the range, turning can leave [-1, 1] by a rounding.
            obs[i, at] = min(1.0, max(-1.0, dx * facing[i, 0] + dy * facing[i, 1]))
            obs[i, at + 1] = min(1.0, max(-1.0, dy * facing[i, 0] - dx * facing[i, 1]))
            obs[i, at + 2] = 1.0 if carried_object[rows[k]] >= 0 else 0.0
            obs[i, at + 3] = 1.0


@kernel
def hear(
    position: FloatArray,
    present: BoolArray,
    bins: Bins,
    range_m: float,
    said: ObsArray,
    speaks: BoolArray,
    total: FloatArray,
    obs: ObsArray,
    start: int,
) -> None:
    """Write the mean of what the other robots in range say, and 1 if any of them speaks; zeros without.

    Args:
        position: (N, 2) m.
        present: (N,) robots in the world; others hear nothing.
        bins: As in `see_neighbours`.
        range_m: Likewise.
        said: (N, m) of each robot.
        speaks: (N,) robots that say something.
        total: (m,) scratch.
        obs: (N, D), m + 1 columns from `start` are written.
        start: First column.
    """
    cell_m, first_in_bin, next_in_bin = bins
    size = said.shape[1]
    for i in range(position.shape[0]):
        obs[i, start : start + size + 1] = 0.0
        if not present[i]:
            continue
        x = position[i, 0]
        y = position[i, 1]
        total[:] = 0.0
        n_heard = 0
        for k in range(9):
            cell_x = cell_of(x, cell_m) + k % 3 - 1
            cell_y = cell_of(y, cell_m) + k // 3 - 1
            j = _next_in_cell(
                first_in_bin[bin_of(cell_x, cell_y, first_in_bin.shape[0])], cell_x, cell_y, position, bins
            )
            while j >= 0:
                dx = position[j, 0] - x
                dy = position[j, 1] - y
                if j != i and speaks[j] and dx * dx + dy * dy <= range_m * range_m:
                    n_heard += 1
                    for number in range(size):
                        total[number] += said[j, number]
                j = _next_in_cell(next_in_bin[j], cell_x, cell_y, position, bins)
        if n_heard > 0:
            for number in range(size):
                obs[i, start + number] = total[number] / n_heard
            obs[i, start + size] = 1.0
