"""Neighbour search: robots binned into a hash table of square cells."""

from swarm_forage_env._internal.compiling import inline_kernel, kernel
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray


@inline_kernel
def bin_of(cell_x: int, cell_y: int, n_bins: int) -> int:
    """Hash of a cell into [0, n_bins), n_bins a power of two."""
    return ((cell_x * 73856093) ^ (cell_y * 19349663)) & (n_bins - 1)


@inline_kernel
def cell_of(metres: float, cell_m: float) -> int:
    """Cell along one axis. The inverse is the same for all robots, so that compilers take it out of loops."""
    return int(metres * (1.0 / cell_m))


@kernel
def bin_robots(
    position: FloatArray, present: BoolArray, cell_m: float, first_in_bin: IntArray, next_in_bin: IntArray
) -> None:
    """Fill linked lists of present robots per bin: first_in_bin (bins,), next_in_bin (N,), -1 = end."""
    first_in_bin[:] = -1
    n_bins = first_in_bin.shape[0]
    for i in range(position.shape[0]):
        if present[i]:
            k = bin_of(cell_of(position[i, 0], cell_m), cell_of(position[i, 1], cell_m), n_bins)
            next_in_bin[i] = first_in_bin[k]
            first_in_bin[k] = i
