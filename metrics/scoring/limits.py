"""How near to the limit runs come: an estimate of the most that a swarm can do in a given world.

The D + M objects of a run with D deliveries appear at gaps d from the nest, with the quantile function d(q). The best
swarm of N robots of speed v fetches the nearest share u of them in the time T of the run, with the handling h per trip:

    N (T + E[d] / v) = (D + M) C(u),     C(u) = integral from 0 to u of (2 d(q) / v + h) dq,     u = D / (D + M)

Where the sources have only K places, objects that nobody fetches fill the far ones, so that u <= 1 - (M - N) / K and
D = N (T + E[d] / v) u / C(u). docs/equations.md derives both.

Source: ours. It is an estimate and no bound: as many objects appear at each gap as the distribution says, and turning,
waiting and passing cost nothing.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WHEEL_SCALE_MPS, free_area
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

from ..checks import CurveError
from ..curves import FloatArray

ABOUT_LIMIT = "of the limit: performance over the estimate for a swarm that sees everything and loses no time"
"""What the share is, for readers of tables."""


class ForagingLimit(NamedTuple):
    """The most that a swarm can do in a run: deliveries D, and first pick-ups, at most all D + M that appear."""

    deliveries: float
    first_pickups: float


def limit_of(world: WorldLike) -> ForagingLimit:
    """Estimate the most that a swarm can do in a run of a world's horizon.

    A place is a cell of the sources, and its gap the straight way from its edge to that of the nearest nest, because a
    robot need not go further. Obstacles make ways longer, which the estimate leaves out.

    Raises:
        CurveError: the estimate does not hold in this world; the message says why.
    """
    chosen = world_of(world)
    objects, caches = chosen.scenario.objects, chosen.scenario.caches
    unknown = [config.name for config in chosen.wrappers]
    if objects.is_drawn:
        unknown.append(f"placement {objects.placement!r}, whose regions differ from run to run")
    unknown += ["objects that move (walk_probability)"] * (objects.walk_probability > 0.0)
    unknown += [f"{caches} caches"] * (caches != "none")
    if unknown:
        raise CurveError(f"Expected a world whose limit can be estimated, got one with {', '.join(unknown)}.")
    return _limit(chosen.scenario)


def share_of_limit(world: World, total: float) -> float | None:
    """Return what share of the limit runs reach whose summed performance is `total`; None where no limit is known."""
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
    """Solve the equations of this module."""
    n, m, speed_mps = scenario.robots.n_robots, scenario.objects.n_objects, scenario.robots.max_speed_mps
    speed_mps = min(speed_mps, WHEEL_SCALE_MPS)
    taken = (*scenario.arena.all_nest_cells, *scenario.obstacle_cells)
    gaps_m, share = _places(scenario)
    up_to = np.concatenate(([0.0], np.cumsum(share)))
    handling_s = (scenario.objects.pickup_ticks + scenario.objects.drop_ticks) * scenario.dt_s
    trips_s = 2.0 * gaps_m / speed_mps + handling_s
    cost = np.concatenate(([0.0], np.cumsum(share * trips_s)))
    time_s = n * (scenario.horizon_s + float(share @ gaps_m) / speed_mps)
    # M C(u) = time (1 - u) on the piece of C in which the difference of both sides changes its sign.
    piece = int(np.searchsorted(m * cost - time_s * (1.0 - up_to), 0.0, side="right")) - 1
    slope, start = float(trips_s[piece]), float(up_to[piece])
    unbounded = (time_s - m * (float(cost[piece]) - slope * start)) / (m * slope + time_s)
    n_places = free_area(scenario.source_cells, taken)
    nearest = min(unbounded, 1.0 - max(0, m - n) / n_places)
    deliveries = time_s * nearest / float(np.interp(nearest, up_to, cost))
    return ForagingLimit(deliveries=deliveries, first_pickups=deliveries + m)


def _places(scenario: ScenarioConfig) -> tuple[FloatArray, FloatArray]:
    """Return the gaps of the free places of all sources, m, rising, (P,), and the share of objects of each, (P,).

    An object appears in each of the sources as often, and on each of its free cells.
    """
    gaps: list[FloatArray] = []
    for x_low, y_low, x_high, y_high in scenario.source_cells:
        x, y = (axis.ravel() for axis in np.mgrid[x_low:x_high, y_low:y_high])
        for left, low, right, high in (*scenario.arena.all_nest_cells, *scenario.obstacle_cells):
            is_free = (x < left) | (x >= right) | (y < low) | (y >= high)
            x, y = x[is_free], y[is_free]
        x_m, y_m = x * CELL_M, y * CELL_M
        ways = [  # from the edges of the cells to the nearest nest, along each axis
            np.hypot(
                np.maximum(0.0, np.maximum(left - (x_m + CELL_M), x_m - right)),
                np.maximum(0.0, np.maximum(low - (y_m + CELL_M), y_m - high)),
            )
            for left, low, right, high in scenario.arena.nest_boxes_m
        ]
        gaps += [np.min(ways, axis=0)] * (len(x) > 0)
    share = np.concatenate([np.full(len(source), 1.0 / len(source)) for source in gaps])
    all_gaps = np.concatenate(gaps)
    order = np.argsort(all_gaps, kind="stable")
    return all_gaps[order], share[order] / share.sum()
