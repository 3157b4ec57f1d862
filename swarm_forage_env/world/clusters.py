"""Power-law clusters of objects: how many, how large, where.

The paper speaks of groups of various sizes. Here they follow a power law: small groups are many, large ones few. The
authors' program draws from the same exponents with the weights turned round, so that six of its eight arenas have
clusters of one size, and the others more large ones than small ones: quirk `large_clusters_likelier`.
"""

import math
from dataclasses import dataclass

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import CELL_NEST
from swarm_forage_env.contract.types import IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import Box

GUESSES = 100
"""Random places tried per cluster before the whole layout is drawn again (study: 100 tries)."""
LAYOUTS = 100
"""Layouts tried before an arena counts as too small (our choice: the study's arenas need one or two)."""
_PADDING = (4, 2)
"""Cells added to the square that holds a cluster's objects, along x and y (study: twice its largest object)."""


@dataclass(frozen=True, slots=True)
class ClusterLaw:
    """Exponents k of the cluster sizes 2^k in an arena, and the number of clusters in the authors' program."""

    k_min: int
    k_max: int
    n_clusters: int


def cluster_law(side_m: float) -> ClusterLaw:
    """Return the law for an arena of side X: k from ceil(X^(1/4)) + 1 to ceil(X^(1/3)) + 1, ceil(X^0.8) clusters.

    Source: the study.

    Args:
        side_m: Side of the square arena in metres (for a rectangle: of the square with its area).
    """
    # X ** (1 / 3) is not exact, so roots are rounded before `ceil`. The study's 17 clusters at 32 m come from 32 ** 0.8
    # being rounded to just above 16; the factor gives the same result on every platform.
    return ClusterLaw(
        k_min=math.ceil(round(side_m ** (1 / 4), 9)) + 1,
        k_max=math.ceil(round(side_m ** (1 / 3), 9)) + 1,
        n_clusters=math.ceil(side_m**0.8 * (1 + 1e-12)),
    )


def draw_sizes(law: ClusterLaw, n_objects: int, rng: np.random.Generator) -> IntArray:
    """Return the sizes of clusters that hold exactly `n_objects` together, largest first.

    Sizes are 2^k with probability proportional to 2^-k, k_min - 1 <= k <= k_max: twice as large is half as likely, so
    each size holds the same share of the objects. Clusters are drawn until they hold all objects; the last is cut.
    Our choice: the paper names the law and gives no exponent.
    """
    exponents = np.arange(law.k_min - 1, law.k_max + 1)
    weights = 0.5**exponents
    most = math.ceil(n_objects / 2 ** exponents[0])
    sizes = 2 ** rng.choice(exponents, size=most, p=weights / weights.sum())
    held = np.cumsum(sizes)
    n_clusters = int(np.searchsorted(held, n_objects)) + 1
    sizes = sizes[:n_clusters]
    sizes[-1] -= held[n_clusters - 1] - n_objects
    return np.sort(sizes)[::-1].astype(np.int32)


def draw_program_sizes(law: ClusterLaw, rng: np.random.Generator) -> IntArray:
    """Return (n_clusters,) cluster sizes of the authors' program, k_min <= k < k_max, largest first.

    A size is 2^floor(v) with v = (k_min^3 + (k_max^3 - k_min^3) u)^(1/3) and u uniform: the density of v grows with
    v^2, so that 2^k has probability ((k + 1)^3 - k^3) / (k_max^3 - k_min^3).
    """
    cubes = np.arange(law.k_min, law.k_max + 1) ** 3
    v_cubed = cubes[0] + (cubes[-1] - cubes[0]) * rng.random(law.n_clusters)
    # floor(v) by comparing cubes: a cube root of 64 is 3.9999... in floating point.
    exponents = law.k_min + np.searchsorted(cubes, v_cubed, side="right") - 1
    return np.sort(2**exponents)[::-1].astype(np.int32)


def footprint(size: int) -> tuple[int, int]:
    """Return the cells (along x, along y) that a cluster of `size` objects spreads over."""
    edge = math.isqrt(size - 1) + 1
    return edge + _PADDING[0], edge + _PADDING[1]


def draw_clusters(config: ScenarioConfig, floor: IntArray, rng: np.random.Generator) -> tuple[IntArray, IntArray]:
    """Draw the clusters of a run.

    Args:
        config: Scenario with power-law placement.
        floor: (ny, nx) floor codes with nest, obstacles and static caches painted; clusters keep off these.
        rng: Generator of the placement stream.

    Returns:
        Boxes (R, 4) in cells, half-open, and sizes (R,) in objects, largest first. At least one cell lies between
        any two clusters.

    Raises:
        ConfigError: the clusters found no room in `LAYOUTS` layouts.
    """
    arena = config.arena
    law = cluster_law(math.sqrt(arena.width_m * arena.height_m))
    if config.quirks.large_clusters_likelier:
        sizes = draw_program_sizes(law, rng)
    else:
        sizes = draw_sizes(law, config.objects.n_objects, rng)
    for _ in range(LAYOUTS):
        boxes = _draw_layout(sizes, floor, arena.distributable_cells, rng)
        if boxes is not None:
            return np.array(boxes, np.int32), sizes
    raise ConfigError(
        f"Expected room for {len(sizes)} clusters of {sizes.min()} to {sizes.max()} objects in a power-law arena of "
        f"{arena.width_m} x {arena.height_m} m, found none in {LAYOUTS} random layouts; use a larger arena, a smaller "
        "nest, smaller caches or fewer obstacles."
    )


def _draw_layout(sizes: IntArray, floor: IntArray, area: Box, rng: np.random.Generator) -> list[Box] | None:
    """Return one box per size, or None when a cluster finds no place in `GUESSES` guesses."""
    boxes: list[Box] = []
    for size in sizes.tolist():
        box = _draw_box(footprint(size), boxes, floor, area, rng)
        if box is None:
            return None
        boxes.append(box)
    return boxes


def _draw_box(
    extent: tuple[int, int], placed: list[Box], floor: IntArray, area: Box, rng: np.random.Generator
) -> Box | None:
    width, height = extent
    if width > area[2] - area[0] or height > area[3] - area[1]:
        return None
    for _ in range(GUESSES):
        x = int(rng.integers(area[0], area[2] - width, endpoint=True))
        y = int(rng.integers(area[1], area[3] - height, endpoint=True))
        box = (x, y, x + width, y + height)
        is_taken = np.any(floor[y : y + height, x : x + width] <= CELL_NEST)  # nest, obstacle or cache
        if not is_taken and not any(_touch(box, other) for other in placed):
            return box
    return None


def _touch(a: Box, b: Box) -> bool:
    """Return whether two boxes overlap or touch as closed ranges."""
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]
