"""How near to the limit runs come: the estimate of `limits` for a world, and the share of it that runs reach.

limit_of("warehouse_small").deliveries
"""

from collections.abc import Iterator
from functools import lru_cache
from math import ceil, sqrt

import numpy as np

from swarm_forage_env._internal.wording import percent
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, Box, capacity
from swarm_forage_env.scenarios.robots import WHEEL_SCALE_MPS
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

from ..checks import CurveError
from ..curves import FloatArray
from ..limits import ForagingLimit, foraging_limit

ABOUT_LIMIT = "of the limit: performance over the estimate for a swarm that sees everything and loses no time"
"""What the share is, for readers of tables."""
_MOST_PLACES = 250_000
"""Places of a source that are looked at; of a larger one every k-th along both axes."""


def limit_of(world: WorldLike) -> ForagingLimit:
    """Estimate the most that a swarm can do in a run in a world, by `foraging_limit`.

    A place is a cell of the sources, and its gap the straight way from its edge to that of the nearest nest, because a
    robot need not go further. Obstacles make ways longer, which the estimate leaves out.

    Args:
        world: A `World`, a configuration or the name of a preset; the limit is that of a run of its horizon.

    Raises:
        CurveError: the estimate does not hold in this world; the message says why.
    """
    chosen = world_of(world)
    reason = _reason_against(chosen)
    if reason:
        raise CurveError(f"Expected a world whose limit can be estimated, got one with {reason}.")
    return _limit(chosen.scenario)


def share_of_limit(world: World, total: float) -> float | None:
    """Return the share of the limit that a run, or the mean of runs, reaches.

    Args:
        world: The world of the runs, with the caches that they have.
        total: Their performance, summed over a run.

    Returns:
        The share; None where no limit can be estimated, or performance is neither deliveries nor first pick-ups.
    """
    name = world.scenario.performance
    if name not in ("collected", "first_picked") or _reason_against(world):
        return None
    limit = _limit(world.scenario)
    return total / (limit.deliveries if name == "collected" else limit.first_pickups)


def share_text(share: float | None) -> str:
    """Return a share of the limit for a cell of a table."""
    return "-" if share is None else percent(share)


def _reason_against(world: World) -> str:
    """Return what of a world the estimate does not know; empty if nothing."""
    scenario = world.scenario
    unknown = {
        ", ".join(config.name for config in world.wrappers): bool(world.wrappers),
        "power-law clusters, in which objects appear again where others were taken": scenario.objects.placement
        == "power_law",
        "objects that move (walk_probability)": scenario.objects.walk_probability > 0.0,
        f"{scenario.caches} caches": scenario.caches != "none",
        "robots of unequal speed": any(kind.speed != 1.0 for kind in scenario.robots.robot_kinds),
    }
    return next((words for words, is_there in unknown.items() if is_there), "")


@lru_cache(maxsize=64)
def _limit(scenario: ScenarioConfig) -> ForagingLimit:
    robots, objects = scenario.robots, scenario.objects
    taken = (*scenario.arena.all_nest_cells, *scenario.obstacle_cells)
    places = [*_places(scenario, taken)]
    return foraging_limit(
        np.concatenate([gaps for gaps, _ in places]),
        weights=np.concatenate([weights for _, weights in places]),
        n_robots=robots.n_robots,
        n_objects=objects.n_objects,
        horizon_s=scenario.horizon_s,
        speed_mps=min(robots.max_speed_mps, WHEEL_SCALE_MPS),
        handling_s=(objects.pickup_ticks + objects.drop_ticks) * scenario.dt_s,
        n_places=capacity(scenario.source_cells, *scenario.arena.n_cells, taken),
    )


def _places(scenario: ScenarioConfig, taken: tuple[Box, ...]) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the gaps of the free places of each source, m, (P,), and how likely an object appears at each, (P,).

    An object appears in each of the sources as often, and on each of its free cells.
    """
    for x_low, y_low, x_high, y_high in scenario.source_cells:
        step = max(1, ceil(sqrt((x_high - x_low) * (y_high - y_low) / _MOST_PLACES)))
        x, y = (axis.ravel() for axis in np.mgrid[x_low:x_high:step, y_low:y_high:step])
        is_free = ~np.any([_inside(x, y, box) for box in taken], axis=0)
        gaps = _gaps(x[is_free] * CELL_M, y[is_free] * CELL_M, scenario.arena.nest_boxes_m)
        if len(gaps):
            yield gaps, np.full(len(gaps), 1.0 / len(gaps))


def _inside(x: np.ndarray, y: np.ndarray, box: Box) -> np.ndarray:
    return (box[0] <= x) & (x < box[2]) & (box[1] <= y) & (y < box[3])


def _gaps(x: FloatArray, y: FloatArray, nests: tuple[tuple[float, float, float, float], ...]) -> FloatArray:
    """Return the ways from cells with their lower left corners at (x, y) m, (P,), to the nearest of the nests."""
    ways = [
        np.hypot(
            np.maximum(0.0, np.maximum(nest[0] - (x + CELL_M), x - nest[2])),
            np.maximum(0.0, np.maximum(nest[1] - (y + CELL_M), y - nest[3])),
        )
        for nest in nests
    ]
    return np.min(ways, axis=0)
