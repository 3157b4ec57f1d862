"""Performance predicted from swarm size: three laws, fitted to small swarms and continued to larger ones.

The laws and their fit are in `laws`; here one of them is chosen, and intervals are found.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_level, check_option, check_resamples, check_size
from .curves import FloatArray
from .laws import (
    LAWS,
    MIN_SIZES,
    LawName,
    SizeLaw,
    checked_means,
    checked_runs,
    checked_sizes,
    fit_law,
    fit_roots,
    resampled_mean,
)

REACH = 4.0
"""How many times the largest fitted size we look ahead: for the critical size, and in judging a law (our choice)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SizePrediction:
    """Performance at swarm sizes, predicted from smaller swarms."""

    law: SizeLaw
    """The law with the smallest error, fitted to all sizes."""
    laws: Mapping[LawName, SizeLaw]
    """Every law, fitted to all sizes."""
    errors: Mapping[LawName, float]
    """Law -> its `forward_error`."""
    at: tuple[int, ...]
    """Swarm sizes that are predicted."""
    value: FloatArray
    """Predicted mean performance, one per size in `at`."""
    lower: FloatArray
    """Lower bounds of the intervals."""
    upper: FloatArray
    """Upper bounds of the intervals."""
    limit: float
    """Largest size at which a critical size is looked for: `REACH` times the largest fitted one."""
    critical: float
    """Swarm size of the largest performance by the law; infinite if there is none up to `limit`."""
    critical_lower: float
    """Lower bound of its interval."""
    critical_upper: float
    """Upper bound of its interval; infinite if resamples without a critical size are too many for a bound."""
    critical_share: float
    """Share of resamples that have a critical size up to `limit`."""
    law_shares: Mapping[LawName, float]
    """Law -> share of resamples in which it is chosen."""
    level: float
    """Confidence level of all intervals."""


def forward_error(name: LawName, sizes: Sequence[int], performance: ArrayLike) -> float:
    """Error of a law that is fitted to the smallest swarms and predicts the next larger ones.

    The function fits the law to the 3, 4, ... smallest sizes. Each time, it predicts the larger sizes, up to `REACH`
    times the largest fitted one. The error is the root mean squared difference between the square roots of predicted
    and measured performance. A criterion of fit, such as Akaike's, judges a law inside the range of its data. Here a
    law has to extrapolate, so we judge it by extrapolating.

    Args:
        name: One of `ALL_LAWS`.
        sizes: Swarm sizes in rising order, (S,), at least `MIN_SIZES`.
        performance: Mean performance of each, (S,).

    Raises:
        CurveError: too few sizes, not in rising order, or performances that do not fit to them.
        ValueError: an unknown law.
    """
    check_option("name", name, LawName)
    n = checked_sizes(sizes)
    return _forward_error(name, n, np.sqrt(checked_means(n, performance)))


def predict_performance(
    sizes: Sequence[int],
    runs: Sequence[ArrayLike],
    at: Sequence[int],
    *,
    level: float = 0.95,
    n_resamples: int = 500,
    seed: int | None = None,
) -> SizePrediction:
    """Predict the mean performance of swarms from the runs of smaller ones, with intervals.

        predict_performance([1, 2, 4, 8], [[10, 11], [19, 22], [38, 37], [70, 66]], at=[16, 32], seed=1)

    The function takes the law with the smallest `forward_error`. Each resample draws the runs of every size again and
    adds the misfit of the law at the fitted sizes beyond the scatter of their runs. Then it chooses and fits a law, and
    adds the scatter of a mean. So the interval covers the chance in the runs, the scatter of the predicted mean (over
    as many runs as each size has), the misfit of the law, and the choice between the three laws. It does not cover
    effects that begin only in larger swarms, such as a jam.

    Args:
        sizes: Swarm sizes in rising order, (S,), at least `MIN_SIZES`.
        runs: Performance of each run at each size, summed over time: S arrays (R,), R >= 2.
        at: Sizes to predict, usually larger ones.
        level: Confidence level.
        n_resamples: Number of resamples.
        seed: Seed of the resampling; None draws a fresh one.

    Raises:
        CurveError: too few sizes or runs, sizes that are not rising, or swarms that never achieve anything.
        ValueError: a level outside (0, 1) or no resamples.
    """
    check_level(level)
    check_resamples(n_resamples)
    n = checked_sizes(sizes)
    wanted = tuple(check_size("each size in at", size) for size in at)
    totals = checked_runs(n, runs)
    means = np.array([total.mean() for total in totals])
    laws: dict[LawName, SizeLaw] = {name: fit_law(name, n.astype(int).tolist(), means) for name in LAWS}
    errors = _forward_errors(n, np.sqrt(means))
    law = laws[_best(errors)]
    rng = np.random.default_rng(seed)
    resampled: list[SizeLaw] = []
    predicted = np.empty((n_resamples, len(wanted)))
    scatter = _Scatter.around(law, n, totals)
    for k in range(n_resamples):
        roots, deviation = scatter.draw(rng)
        found = fit_roots(_best(_forward_errors(n, roots)), n, roots)
        resampled.append(found)
        noise = deviation * rng.standard_normal(len(wanted))
        predicted[k] = np.maximum(0.0, np.sqrt(found.performance(wanted)) + noise) ** 2
    bounds = (0.5 - 0.5 * level, 0.5 + 0.5 * level)
    lower, upper = np.quantile(predicted, bounds, axis=0) if wanted else np.empty((2, 0))
    limit = REACH * float(n[-1])
    peaks = np.array([found.peak if found.peak <= limit else math.inf for found in resampled])
    # A resample without a critical size counts as infinity, which has no neighbours to interpolate between.
    critical_lower, critical_upper = np.quantile(peaks, bounds, method="inverted_cdf")
    names = [found.name for found in resampled]
    return SizePrediction(
        law=law,
        laws=laws,
        errors=errors,
        at=wanted,
        value=law.performance(wanted),
        lower=lower,
        upper=upper,
        limit=limit,
        critical=law.peak if law.peak <= limit else math.inf,
        critical_lower=float(critical_lower),
        critical_upper=float(critical_upper),
        critical_share=float(np.isfinite(peaks).mean()),
        law_shares={name: names.count(name) / n_resamples for name in LAWS},
        level=level,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scatter:
    """What resamples are drawn from, on the scale of square roots."""

    totals: tuple[FloatArray, ...]
    """Performance of each run, S arrays (R,)."""
    between_means: float
    """Variance of the root of a mean over runs, from the differences between runs."""
    around_law: float
    """Variance of these roots around the law."""
    freedom: int
    """Sizes beyond the number of parameters."""

    @classmethod
    def around(cls, law: SizeLaw, n: FloatArray, totals: tuple[FloatArray, ...]) -> "_Scatter":
        """Measure the scatter of runs, and that of their means around a law."""
        means = np.array([total.mean() for total in totals])
        # The variance of a root is that of the value over four times its mean.
        own = [float(total.var(ddof=1)) / (4.0 * total.mean() * total.size) for total in totals if total.any()]
        freedom = n.size - law.n_parameters
        residuals = np.sqrt(means) - np.sqrt(law.performance(n))
        return cls(
            totals=totals,
            between_means=float(np.mean(own)),
            around_law=float(residuals @ residuals) / freedom,
            freedom=freedom,
        )

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, float]:
        """Return resampled roots of mean performance (S,), and the standard deviation of such a root around a law."""
        # Few sizes say little about the variance around the law, so that it is drawn, too: this gives Student's tails.
        variance = max(self.between_means, self.around_law * self.freedom / rng.chisquare(self.freedom))
        means = np.array([resampled_mean(total, rng) for total in self.totals])
        misfit = math.sqrt(variance - self.between_means) * rng.standard_normal(means.size)
        return np.maximum(0.0, np.sqrt(means) + misfit), math.sqrt(variance)


def _best(errors: Mapping[LawName, float]) -> LawName:
    """The law of the smallest error; of equal ones that with the fewest parameters."""
    smallest = min(errors.values())
    return next(name for name in LAWS if errors[name] <= smallest * (1.0 + 1e-9) + 1e-12)


def _forward_errors(n: FloatArray, roots: FloatArray) -> dict[LawName, float]:
    return {name: _forward_error(name, n, roots) for name in LAWS}


def _forward_error(name: LawName, n: FloatArray, roots: FloatArray) -> float:
    squares: list[float] = []
    for n_fitted in range(MIN_SIZES - 1, n.size):
        law = fit_roots(name, n[:n_fitted], roots[:n_fitted])
        ahead = (n > n[n_fitted - 1]) & (n <= REACH * n[n_fitted - 1])
        squares += ((np.sqrt(law.performance(n[ahead])) - roots[ahead]) ** 2).tolist()
    return math.sqrt(sum(squares) / len(squares)) if squares else math.inf
