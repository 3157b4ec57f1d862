"""Robustness to a changing population, Eq. (12), and availability of enough robots, Eq. (13)."""

import math
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .checks import CurveError, PopulationError, check_horizon, check_option, check_size
from .curves import FloatArray, Reduction, as_curves, as_waveforms, per_performance, reduce_intervals
from .queues import PopulationRates, mean_away, queue_statistics

PopulationWeight: TypeAlias = Literal["paper", "transient"]


def population_robustness(
    perf: ArrayLike,
    perf_ideal: ArrayLike,
    rates: PopulationRates,
    *,
    horizon: float,
    n: int | None = None,
    ideal_rates: PopulationRates | None = None,
    weight: PopulationWeight = "transient",
    reduce: Reduction = "sum",
    relative: bool = False,
) -> FloatArray:
    """Population dynamics robustness B_pd, Eq. (12): performance beyond what the time at work explains.

        B_pd = sum_t [ P(N(t), t) - w P_ideal(t) ]

    with w from `population_weight`. Higher is better. B_pd is 0 if performance falls in proportion to the time at work.

    Args:
        perf: Performance with population dynamics, shape (..., T), objects per interval.
        perf_ideal: Performance of the ideal swarm, same intervals.
        rates: Population rates per tick.
        horizon: Run length in ticks, in the same unit as the rates.
        n: Swarm size N; `transient` needs it.
        ideal_rates: Rates of the ideal swarm; None: no robot leaves.
        weight: See `population_weight`.
        reduce: `sum` as in the paper, `mean` or `last`.
        relative: Divide by the likewise reduced P_ideal, see `metrics.curves.per_performance`.

    Returns:
        B_pd, shape (...,), in the unit of `perf`; a pure number if relative.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length, or n < 1.
        PopulationError: The weight does not exist for these rates.
        ValueError: Unknown option, or a missing n.
    """
    perf, perf_ideal = as_curves(perf=perf, perf_ideal=perf_ideal)
    share = population_weight(rates, horizon=horizon, n=n, ideal_rates=ideal_rates, weight=weight)
    gain = reduce_intervals(perf - share * perf_ideal, reduce, perf, perf_ideal)
    return per_performance(gain, perf_ideal, reduce) if relative else gain


def recorded_population_robustness(
    perf: ArrayLike,
    n_active: ArrayLike,
    perf_ideal: ArrayLike,
    n_active_ideal: ArrayLike,
    *,
    reduce: Reduction = "sum",
    relative: bool = False,
) -> FloatArray:
    """Population dynamics robustness, weighted with the recorded number of robots at work.

        B_pd' = sum_t [ P(N(t), t) - (n(t) / n_ideal(t)) P_ideal(t) ]

    Eq. (12) weights every run with the same rates alike, so a run in which more robots than expected fail seems less
    robust. Here, each interval is weighted with the share of its robots that are at work. A swarm whose performance is
    proportional to the robots at work scores 0 in every run and interval. Higher is better. This measure is ours.

    Args:
        perf: Performance with population dynamics, shape (..., T), objects per interval.
        n_active: Robots at work n(t), mean over each interval of the same runs; a curve, or one number.
        perf_ideal: Performance of the ideal swarm, same intervals.
        n_active_ideal: Its robots at work; a curve, or one number for a swarm that no robot leaves.
        reduce: `sum` as in the paper, `mean` or `last`.
        relative: Divide by the likewise reduced P_ideal, see `metrics.curves.per_performance`.

    Returns:
        B_pd', shape (...,), in the unit of `perf`; a pure number if relative.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length, or no robot of the ideal swarm was at
            work in some interval.
        ValueError: Unknown reduction.
    """
    perf, perf_ideal = as_curves(perf=perf, perf_ideal=perf_ideal)
    active, ideal = as_waveforms(perf, perf_ideal, n_active=n_active, n_active_ideal=n_active_ideal)
    if (active < 0.0).any() or (ideal <= 0.0).any():
        raise CurveError(
            "Expected n_active >= 0 and n_active_ideal > 0 robots in every interval, got "
            f"{np.nanmin(active)} and {np.nanmin(ideal)}; pass the ideal swarm's robots at work."
        )
    gain = reduce_intervals(perf - active / ideal * perf_ideal, reduce, perf, active, perf_ideal, ideal)
    return per_performance(gain, perf_ideal, reduce) if relative else gain


def population_weight(
    rates: PopulationRates,
    *,
    horizon: float,
    n: int | None = None,
    ideal_rates: PopulationRates | None = None,
    weight: PopulationWeight = "transient",
) -> float:
    """Time at work relative to the ideal swarm, the factor T_S / T_S,ideal of Eq. (12).

    | weight     | time at work                                                                                 |
    |------------|----------------------------------------------------------------------------------------------|
    | paper      | T - [1 / (mu - lambda) + 1 / mu], Eq. (11) with the printed time, which counts service twice |
    | transient  | T (1 - m_T / N), the mean over the run, see `mean_away` (ours)                               |

    The printed time away is the length of *one* absence. So `paper` holds only if every robot is away exactly once, and
    is negative if that length exceeds T, as for the study's 200 robots.

    Returns:
        The weight; 1 if no robot leaves either swarm. In [0, 1] for `transient` with ideal_rates None.

    Raises:
        CurveError: n < 1.
        PopulationError: The weight does not exist: rho >= 1 for `paper`, a division by zero.
        ValueError: Unknown weight, or a missing n.
    """
    check_option("weight", weight, PopulationWeight)
    check_horizon(horizon)
    at_work = _share_at_work(rates, horizon, n, weight)
    ideal_at_work = _share_at_work(ideal_rates or PopulationRates(), horizon, n, weight)
    if ideal_at_work == 0.0:
        raise PopulationError(
            f"Expected an ideal swarm with time at work, got none for weight={weight!r}, {ideal_rates}."
        )
    return at_work / ideal_at_work


def availability(n: int, n_min: int, ratio_out: float) -> float:
    """Availability p_v: probability that at least n_min of n robots are at work, in equilibrium, Eq. (13).

        p_v = sum_{j=0}^{N - N_min} q^j pi_N = (1 - q^(N - N_min + 1)) / (1 - q^(N + 1)),    q = lambda / mu

    The paper prints 1 / rho in place of q. With rho = lambda / mu, as in the queue equations, this gives the
    probability that at least n_min robots are *away*. The paper does not define pi_N, the probability that all robots
    are at work; it is (1 - q) / (1 - q^(N + 1)).

    Args:
        n: Swarm size N.
        n_min: Robots needed; any integer: 1.0 for n_min <= 0, 0.0 for n_min > n.
        ratio_out: q = lambda / mu, the rate of leaving over that of returning, from 0 (robots never leave) to inf
            (robots never return).

    Returns:
        p_v in [0, 1]. Higher is better.

    Raises:
        CurveError: n < 1, or n_min is no whole number.
        PopulationError: A ratio that is negative or NaN.
    """
    n, n_min = check_size("n", n), check_size("n_min", n_min, least=-math.inf)
    if not ratio_out >= 0.0:
        raise PopulationError(f"Expected ratio_out = lambda / mu >= 0, got {ratio_out}.")
    if n_min <= 0 or n_min > n:
        return float(n_min <= 0)
    if ratio_out == 0.0 or math.isinf(ratio_out):
        return float(ratio_out == 0.0)
    if ratio_out == 1.0:
        return (n - n_min + 1) / (n + 1)
    # Powers of q <= 1 only, so that nothing overflows; exact near q = 1.
    log_q = -abs(math.log(ratio_out))
    p_v = math.expm1((n - n_min + 1) * log_q) / math.expm1((n + 1) * log_q)
    return p_v if ratio_out < 1.0 else p_v * math.exp(n_min * log_q)


def ratio_for_team(team: float) -> float:
    """Ratio q = lambda / mu = (1 + M) / M at which M robots are at work on average, if the swarm had no size limit.

    Then k robots are at work with probability (1 - 1/q) / q^k, and the mean is 1 / (q - 1) = M. A swarm of N robots has
    at most N at work, so its mean is below M: N - `queue_statistics(PopulationRates(lambda_bd=q, mu_bd=1.0),
    N).truncated_length`.

    Args:
        team: M > 0, robots; need not be whole.

    Raises:
        PopulationError: M is not positive and finite.

    Source: our choice of the reading that gives the 0.40 of the paper's availability figure (N = 50, N_min = 5, M = 5);
    the queue length that the paper prints gives 0.454.
    """
    if not (math.isfinite(team) and team > 0.0):
        raise PopulationError(f"Expected a mean team of more than 0 robots at work, finite, got {team}.")
    return 1.0 + 1.0 / team


def _share_at_work(rates: PopulationRates, horizon: float, n: int | None, weight: PopulationWeight) -> float:
    if rates.lam == 0.0:
        return 1.0
    if weight == "transient":
        if n is None:
            raise ValueError(f"Expected the swarm size n with weight={weight!r}, got None.")
        return 1.0 - mean_away(rates, check_size("n", n), horizon) / n
    queue = queue_statistics(rates)
    if not queue.stable:
        raise PopulationError(
            f"Expected more returns than departures with weight={weight!r}, got rho = {queue.rho}: the time away is "
            "infinite; use weight='transient'."
        )
    return 1.0 - queue.time_printed / horizon
