"""Queue model of a changing population: how many robots are away, for how long, in equilibrium and in a finite run.

S is the part of the swarm at work. Robots leave S when they die or break down, and enter it when they are born or
repaired. The paper models the robots *not* in S as one M/M/1 queue with arrival rate lambda and service rate mu, Eqs.
(9) to (11).
"""

import math
from dataclasses import dataclass, fields

import numpy as np
from scipy.special import pdtrc  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from .checks import PopulationError, check_horizon, check_size
from .curves import FloatArray


@dataclass(frozen=True)
class PopulationRates:
    """Rates of change of the population, per tick and for the whole swarm, not per robot.

    Raises:
        PopulationError: A rate is negative, infinite or not a number.

    Source: section on population dynamics of the paper.
    """

    lambda_d: float = 0.0
    """Deaths per tick; the dead never return by themselves."""
    lambda_bd: float = 0.0
    """Temporary departures (malfunctions) per tick."""
    mu_b: float = 0.0
    """Births per tick."""
    mu_bd: float = 0.0
    """Returns (repairs) per tick."""

    def __post_init__(self) -> None:
        for field in fields(self):
            rate = getattr(self, field.name)
            if not (math.isfinite(rate) and rate >= 0.0):
                raise PopulationError(f"Expected {field.name} as a finite rate >= 0 per tick, got {rate}.")

    @property
    def lam(self) -> float:
        """Rate of leaving the swarm at work, lambda = lambda_d + lambda_bd, per tick."""
        return self.lambda_d + self.lambda_bd

    @property
    def mu(self) -> float:
        """Rate of entering it, mu = mu_b + mu_bd, per tick."""
        return self.mu_b + self.mu_bd


@dataclass(frozen=True, kw_only=True, eq=False)
class QueueStats:
    """Equilibrium of the queue of robots away from work; numbers of robots, times in ticks.

    The unlimited quantities are infinite if the queue is not stable. The paper prints the number of robots *waiting* as
    the number away. Its time away counts the service twice, because 1 / (mu - lambda) already contains it.
    """

    rho: float
    """lambda / mu; 0 if no robot leaves, inf if no robot returns."""
    stable: bool
    """Whether rho < 1. A finite swarm is always stable."""
    length_printed: float
    """Number away as printed in Eq. (10), rho^2 / (1 - rho): those that wait, without the one in service."""
    length: float
    """Number away in an unlimited M/M/1 queue, rho / (1 - rho)."""
    time_printed: float
    """Time away per visit as printed in Eq. (11), 1 / (mu - lambda) + 1 / mu."""
    time: float
    """Time away per visit, W = 1 / (mu - lambda)."""
    truncated_length: float | None
    """Mean number away of a swarm of n robots, L_N; None if n was not given."""
    truncated_distribution: FloatArray | None
    """Probability that 0, 1, ..., n robots are away, shape (n + 1,); None if n was not given."""


def queue_statistics(rates: PopulationRates, n: int | None = None) -> QueueStats:
    """Equilibrium of the queue of robots away from work, Eqs. (9) to (11), as printed and corrected.

    At most N robots of a swarm can be away. The study's population process has constant rates that stop at 0 and N, so
    n robots are away with probability rho^n / sum_k rho^k, for every rho. The paper writes M/M/1/N(t)/N for this queue,
    with the current size as the capacity; capacity and population are both N.

    Args:
        rates: Rates per tick.
        n: Swarm size N, for the truncated quantities.

    Raises:
        CurveError: n < 1.
    """
    lam, mu = rates.lam, rates.mu
    rho = 0.0 if lam == 0.0 else math.inf if mu == 0.0 else lam / mu
    distribution = None if n is None else _stationary(rho, check_size("n", n))
    length = rho / (1.0 - rho) if rho < 1.0 else math.inf
    time = 1.0 / (mu - lam) if mu > lam else math.inf
    return QueueStats(
        rho=rho,
        stable=rho < 1.0,
        length_printed=rho * length,
        length=length,
        time_printed=time + (1.0 / mu if mu > 0.0 else math.inf),
        time=time,
        truncated_length=None if distribution is None else float(distribution @ np.arange(distribution.size)),
        truncated_distribution=distribution,
    )


def _stationary(rho: float, n: int) -> FloatArray:
    """Probabilities that 0, 1, ..., n of n robots are away in equilibrium, in proportion to rho^k, shape (n + 1,)."""
    if rho == 0.0 or math.isinf(rho):
        return np.eye(n + 1)[0 if rho == 0.0 else n]
    log_weight = np.arange(n + 1.0) * math.log(rho)
    weight = np.exp(log_weight - log_weight.max())  # logarithms, because rho^n overflows for large swarms
    return weight / weight.sum()


def mean_away(rates: PopulationRates, n: int, horizon: float) -> float:
    """Mean number of robots away during a run that starts with no robot away, m_T.

    This solves the queue of `queue_statistics` over time. Runs have 50,000 ticks. The relaxation time is much longer
    (253,000 ticks for the study's 50 robots, 4,000,000 for 200), so most robots are at work during the whole run. With
    the generator Q of the chain and pi(0) = (1, 0, ..., 0):

        d pi / dt = pi Q,    m_T = (1 / T) int_0^T sum_n n pi_n(s) ds

    by uniformisation: with jumps at rate Lambda, some of them to the same state,
    m_T = 1 / (Lambda T) sum_k E[n after k jumps] P(Poisson(Lambda T) > k).

    Args:
        rates: Rates per tick. The queue need not be stable; with mu = 0 robots only leave.
        n: Swarm size N.
        horizon: Run length T in ticks.

    Returns:
        m_T in [0, n].

    Raises:
        CurveError: n < 1.
        PopulationError: The horizon is not positive and finite.

    Source: our choice; the paper uses equilibrium formulas.
    """
    n = check_size("n", n)
    check_horizon(horizon)
    if rates.lam == 0.0:
        return 0.0
    leave, back = np.full(n + 1, rates.lam), np.full(n + 1, rates.mu)  # from each state 0 ... n robots away
    leave[n] = back[0] = 0.0
    jump_rate = rates.lam + rates.mu  # no state has a larger total rate
    expected_jumps = jump_rate * horizon
    n_jumps = int(expected_jumps + 12.0 * math.sqrt(expected_jumps)) + 40  # the tail beyond is below 1e-16
    up, down = leave / jump_rate, back / jump_rate
    stay = 1.0 - up - down
    n_away = np.arange(n + 1.0)
    probability = (n_away == 0.0).astype(np.float64)
    total = 0.0
    for more in pdtrc(np.arange(n_jumps), expected_jumps):
        total += more * (probability @ n_away)
        after = stay * probability
        after[1:] += up[:-1] * probability[:-1]
        after[:-1] += down[1:] * probability[1:]
        probability = after
    return float(total / expected_jumps)
