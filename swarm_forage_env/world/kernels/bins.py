"""Robots binned by place, so that who is near is found without looking at all.

Bins are a hash table of the cells of a grid.
"""

from swarm_forage_env._internal.compiling import inline_kernel, kernel
from swarm_forage_env._internal.prefetching import AHEAD, LARGE, prefetch
from swarm_forage_env.contract.types import BitArray, BoolArray, FloatArray, IntArray


@inline_kernel
def bin_of(cell_x: int, cell_y: int, n_bins: int) -> int:
    """Hash of a cell into [0, n_bins), n_bins a power of two. Neighbours along x are beside each other in memory."""
    return (cell_x + cell_y * 2654435769) & (n_bins - 1)


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
    n_robots = position.shape[0]
    for i in range(n_robots):
        if n_robots >= LARGE:
            ahead = min(i + AHEAD, n_robots - 1)
            x, y = cell_of(position[ahead, 0], cell_m), cell_of(position[ahead, 1], cell_m)
            prefetch(first_in_bin, bin_of(x, y, n_bins), 0)
        if present[i]:
            k = bin_of(cell_of(position[i, 0], cell_m), cell_of(position[i, 1], cell_m), n_bins)
            next_in_bin[i] = first_in_bin[k]
            first_in_bin[k] = i


@inline_kernel
def word_of(cell_x: int, cell_y: int, n_words: int) -> int:
    """Hash of the word of `mark_cells` that holds a cell, into [0, n_words), n_words a power of two."""
    return ((cell_x >> 5) + cell_y * 2654435769) & (n_words - 1)


@kernel
def mark_cells(position: FloatArray, present: BoolArray, cell_m: float, occupied: BitArray) -> None:
    """Set the bit of every cell with a present robot in `occupied` (words,), 32 cells along x to a word.

    Words may be shared by cells far apart. With one word only, as small swarms have, nothing is set.
    """
    n_words = occupied.shape[0]
    if n_words == 1:
        return
    occupied[:] = 0
    n_robots = position.shape[0]
    for i in range(n_robots):
        ahead = min(i + AHEAD, n_robots - 1)
        x, y = cell_of(position[ahead, 0], cell_m), cell_of(position[ahead, 1], cell_m)
        prefetch(occupied, word_of(x, y, n_words), 0)
        if present[i]:
            cell_x, cell_y = cell_of(position[i, 0], cell_m), cell_of(position[i, 1], cell_m)
            occupied[word_of(cell_x, cell_y, n_words)] |= 1 << (cell_x & 31)


@kernel
def may_be_beside(cell_x: int, cell_y: int, occupied: BitArray) -> bool:
    """Whether a robot may be in the next cell along x, or in one of the three next ones along y.

    False is certain. Cells at the end of a word are not worked out: two words more would be looked at.
    """
    n_words = occupied.shape[0]
    bit = cell_x & 31
    if n_words == 1 or bit == 0 or bit == 31:
        return True
    level, above = occupied[word_of(cell_x, cell_y, n_words)], occupied[word_of(cell_x, cell_y + 1, n_words)]
    return ((level >> (bit + 1)) & 1) | ((above >> (bit - 1)) & 7) != 0
