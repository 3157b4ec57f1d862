"""How near to the limit: an estimate of the most that a swarm can do in a given world.

The M objects of the start, and one for each delivery, appear at gaps d from the nest. All gaps come from one
distribution with the quantile function d(q). The best swarm fetches the near objects and leaves the far ones to the
end: of D + M placements it fetches the nearest D, the share u = D / (D + M). A trip takes the way out and back at
speed v, and the handling h. N robots together have the time N T. They start anywhere in the arena and not in the nest,
which saves each of them at most its first way out, on average E[d] / v:

    N (T + E[d] / v) = (D + M) C(u),     C(u) = integral from 0 to u of (2 d(q) / v + h) dq

With D + M = M / (1 - u) and given gaps, between which C is linear, this is a linear equation for u.

An object appears only where there is room. Of a source with K places, objects that nobody fetches fill the far ones: at
most M - N objects, since every robot carries one or is on its way to one. From then on all objects appear on the other
places, so that

    u <= 1 - (M - N) / K     and     D = N (T + E[d] / v) u / C(u)

All trips go to the nearest share u of the places. Where K is large, the second condition changes nothing.

Source: ours. It is an estimate and no bound: as many objects appear at each gap as the distribution says, and turning,
waiting and passing cost nothing.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .checks import CurveError, check_size
from .curves import FloatArray


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

        foraging_limit([10.0], n_robots=2, n_objects=1, horizon_s=990, speed_mps=0.1, handling_s=1.0).deliveries

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
    gaps, share = _sorted_gaps(gaps_m, weights)
    for name, value in (("horizon_s", horizon_s), ("speed_mps", speed_mps), ("handling_s", handling_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise CurveError(f"Expected {name} > 0 and finite, got {value}.")
    if not 1 <= m <= n_places:
        raise CurveError(f"Expected 1 object or more and a place for each, got {m} objects and {n_places:g} places.")
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


def _sorted_gaps(gaps_m: ArrayLike, weights: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
    """Return gaps in increasing order and the share of placements at each, which add up to 1."""
    gaps = np.asarray(gaps_m, np.float64)
    share = np.ones_like(gaps) if weights is None else np.asarray(weights, np.float64)
    is_possible = gaps.ndim == 1 and gaps.shape == share.shape and gaps.size > 0
    if not (is_possible and np.isfinite(gaps).all() and np.isfinite(share).all()):
        raise CurveError(f"Expected finite gaps and weights, (P,) each, got shapes {gaps.shape} and {share.shape}.")
    if gaps.min() < 0.0 or share.min() < 0.0 or share.sum() == 0.0:
        raise CurveError("Expected gaps and weights of 0 or more, and one weight above 0, got others.")
    order = np.argsort(gaps, kind="stable")
    return gaps[order], share[order] / share.sum()
