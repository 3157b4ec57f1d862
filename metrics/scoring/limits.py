"""How near to the limit runs come: an estimate of the most that a swarm can do in a given world.

The D + M objects of a run with D deliveries appear at gaps d from the nest, with the quantile function d(q). The best
swarm of N robots of speed v fetches the nearest share u of them in the time T of the run, with the handling h per trip:

    N (T + E[d] / v) = (D + M) C(u),     C(u) = integral from 0 to u of (2 d(q) / v + h) dq,     u = D / (D + M)

Where the sources have only K places, objects that nobody fetches fill the far ones, so that u <= 1 - (M - N) / K and
D = N (T + E[d] / v) u / C(u). docs/equations.md derives both.

Source: ours. It is an estimate and no bound: as many objects appear at each gap as the distribution says, and turning,
waiting and passing cost nothing.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WHEEL_SCALE_MPS, Box, capacity
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

from ..checks import CurveError, check_size
from ..curves import FloatArray

ABOUT_LIMIT = "of the limit: performance over the estimate for a swarm that sees everything and loses no time"
"""What the share is, for readers of tables."""
_MOST_PLACES = 250_000
"""Places of a source that are looked at; of a larger one every k-th along both axes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ForagingLimit:
    """The most that a swarm can do in a run, estimated."""

    deliveries: float
    """Objects brought to the nest, D."""
    first_pickups: float
    """Pick-ups of objects that no robot had carried since they were placed: all that appear, D + M."""
    nearest_share: float
    """Share u of the places, the nearest ones, to which all trips go."""


def foraging_limit(
    gaps_m: ArrayLike,
    *,
    n_robots: int,
    n_objects: int,
    horizon_s: float,
    speed_mps: float,
    handling_s: float,
    weights: ArrayLike | None = None,
    n_places: float = math.inf,
) -> ForagingLimit:
    """Estimate the most that a swarm can do in a run; the equations are those of this module.

    Args:
        gaps_m: Ways from places where objects may appear to the nest, m; (P,), in any order.
        n_robots: Swarm size N.
        n_objects: Objects M that lie in the arena at any time, carried ones included.
        horizon_s: Length T of the run, s.
        speed_mps: Speed v of every robot, m/s.
        handling_s: Time h to pick an object up and to drop it, s.
        weights: How likely an object appears at each place, (P,), in proportion; default all alike.
        n_places: Number K of places in the source, each with room for one object; default without end.

    Raises:
        CurveError: no gaps, gaps or weights that are negative or not finite, no weight at all, a horizon, speed or
            handling time that is not positive and finite, fewer robots or objects than one, or fewer places than
            objects.
    """
    n, m = check_size("n_robots", n_robots), n_objects
    gaps = np.asarray(gaps_m, np.float64)
    share = np.ones_like(gaps) if weights is None else np.asarray(weights, np.float64)
    is_possible = gaps.ndim == 1 and gaps.shape == share.shape and gaps.size > 0
    if not (is_possible and np.isfinite(gaps).all() and np.isfinite(share).all()):
        raise CurveError(f"Expected finite gaps and weights, (P,) each, got shapes {gaps.shape} and {share.shape}.")
    if gaps.min() < 0.0 or share.min() < 0.0 or share.sum() == 0.0:
        raise CurveError("Expected gaps and weights of 0 or more, and one weight above 0, got others.")
    for name, value in (("horizon_s", horizon_s), ("speed_mps", speed_mps), ("handling_s", handling_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise CurveError(f"Expected {name} > 0 and finite, got {value}.")
    if not 1 <= m <= n_places:
        raise CurveError(f"Expected 1 object or more and a place for each, got {m} objects and {n_places:g} places.")
    order = np.argsort(gaps, kind="stable")
    gaps, share = gaps[order], share[order] / share.sum()
    up_to = np.concatenate(([0.0], np.cumsum(share)))
    trips_s = 2.0 * gaps / speed_mps + handling_s
    cost = np.concatenate(([0.0], np.cumsum(share * trips_s)))
    time_s = n * (horizon_s + float(share @ gaps) / speed_mps)
    # M C(u) = time (1 - u) on the piece of C in which the difference of both sides changes its sign.
    piece = int(np.searchsorted(m * cost - time_s * (1.0 - up_to), 0.0, side="right")) - 1
    slope, start = float(trips_s[piece]), float(up_to[piece])
    unbounded = (time_s - m * (float(cost[piece]) - slope * start)) / (m * slope + time_s)
    nearest = min(unbounded, 1.0 - max(0, m - n) / n_places)
    deliveries = time_s * nearest / float(np.interp(nearest, up_to, cost))
    return ForagingLimit(deliveries=deliveries, first_pickups=deliveries + m, nearest_share=nearest)


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
    scenario = chosen.scenario
    unknown = {
        ", ".join(config.name for config in chosen.wrappers): bool(chosen.wrappers),
        "power-law clusters, in which objects appear again where others were taken": scenario.objects.placement
        == "power_law",
        "objects that move (walk_probability)": scenario.objects.walk_probability > 0.0,
        f"{scenario.caches} caches": scenario.caches != "none",
    }
    for reason, is_there in unknown.items():
        if is_there:
            raise CurveError(f"Expected a world whose limit can be estimated, got one with {reason}.")
    return _limit(scenario)


def share_of_limit(world: World, total: float) -> float | None:
    """Return the share of the limit that a run, or the mean of runs, reaches.

    Args:
        world: The world of the runs, with the caches that they have.
        total: Their performance, summed over a run.

    Returns:
        The share; None where no limit can be estimated, or performance is neither deliveries nor first pick-ups.
    """
    name = world.scenario.performance
    if name not in ("collected", "first_picked"):
        return None
    try:
        limit = limit_of(world)
    except CurveError:
        return None
    return total / (limit.deliveries if name == "collected" else limit.first_pickups)


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
        step = max(1, math.ceil(math.sqrt((x_high - x_low) * (y_high - y_low) / _MOST_PLACES)))
        x, y = (axis.ravel() for axis in np.mgrid[x_low:x_high:step, y_low:y_high:step])
        for left, low, right, high in taken:
            is_free = (x < left) | (x >= right) | (y < low) | (y >= high)
            x, y = x[is_free], y[is_free]
        x_m, y_m = x * CELL_M, y * CELL_M
        # From the cells to the nearest nest, along each axis.
        ways = [
            np.hypot(
                np.maximum(0.0, np.maximum(left - (x_m + CELL_M), x_m - right)),
                np.maximum(0.0, np.maximum(low - (y_m + CELL_M), y_m - high)),
            )
            for left, low, right, high in scenario.arena.nest_boxes_m
        ]
        if len(x):
            yield np.min(ways, axis=0), np.full(len(x), 1.0 / len(x))
