"""Interference: how much time and performance robots lose because they avoid each other. Eq. (1)."""

import numpy as np
from numpy.typing import ArrayLike

from .checks import CurveError, check_size
from .curves import FloatArray, as_curves, as_interference


def t_lost_fraction(n_interfering: ArrayLike, n: int) -> FloatArray:
    """Fraction of the swarm that loses time to collision avoidance, t_lost(N, t) = n_int(N, t) / N.

    A robot also loses time when it avoids a wall, so the fraction of a single robot is above zero.

    Args:
        n_interfering: Robots in collision avoidance, averaged over the ticks of each interval, shape (..., T).
        n: Swarm size N.

    Returns:
        Fractions in [0, 1], shape (..., T). Lower is better.

    Raises:
        CurveError: Negative or infinite counts, more robots than the swarm has, or n < 1.

    Source: notation table of the paper. The text of the paper calls t_lost a number of robots; see `performance_lost`.
    """
    n = check_size("n", n)
    (counts,) = as_curves(n_interfering=n_interfering)
    if (counts > n).any():
        raise CurveError(f"Expected n_interfering <= n = {n} robots, got {np.nanmax(counts)}.")
    return counts / n


def performance_lost(
    perf: ArrayLike,
    t_lost: ArrayLike,
    n: int,
    perf_one: ArrayLike,
    t_lost_one: ArrayLike,
) -> FloatArray:
    """Performance lost to interference between robots, P_lost(N, t), Eq. (1).

        P_lost(1, t) = P(1, t) t_lost(1, t)
        P_lost(N, t) = P(N, t) t_lost(N, t) - N P_lost(1, t)        for N > 1

    Lower is better. A negative value means that the swarm loses less than N lone robots would.

    Args:
        perf: P(N, t), shape (..., T), objects per interval.
        t_lost: Interference *fraction* of that swarm, shape (..., T).
        n: Swarm size N.
        perf_one: P(1, t) of one robot alone.
        t_lost_one: Interference fraction of one robot alone.

    Returns:
        P_lost, shape (..., T), in the unit of `perf`.

    Raises:
        CurveError: A curve is missing, negative, infinite or of another length; a fraction above 1; a size below 1.

    The paper contradicts itself: t_lost is a number of robots in the text, but a fraction of time in the notation
    table. We use the fraction, because P_lost is then 0 for N robots that do not affect each other. The table also
    calls P_lost a fraction, but the equation gives a number of objects; `fractional_loss` computes the fraction.
    """
    n = check_size("n", n)
    perf, perf_one, t_lost, t_lost_one = as_curves(perf=perf, perf_one=perf_one, t_lost=t_lost, t_lost_one=t_lost_one)
    as_interference(t_lost=t_lost, t_lost_one=t_lost_one)
    if n == 1:
        return perf * t_lost
    return perf * t_lost - n * (perf_one * t_lost_one)


def fractional_loss(
    perf: ArrayLike,
    t_lost: ArrayLike,
    n: int,
    perf_one: ArrayLike,
    t_lost_one: ArrayLike,
) -> FloatArray:
    """Share of its performance that a swarm loses to interference, FL(N, t) = P_lost(N, t) / P(N, t).

    Arguments, shapes and errors as in `performance_lost`; -inf or NaN where P(N) = 0.
    """
    lost = performance_lost(perf, t_lost, n, perf_one, t_lost_one)
    (perf,) = as_curves(perf=perf)
    with np.errstate(divide="ignore", invalid="ignore"):
        return lost / perf
