"""Statistics over runs: means with intervals, paired tests, and measures of all runs that one broken run does not move.

Near the critical size of a swarm, some runs break down and others do not, and the mean describes neither kind. The
interquartile mean, the probability of improvement and their intervals are those of Agarwal et al. 2021.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtr, stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from .checks import CurveError, check_option
from .curves import FloatArray

AggregateMethod: TypeAlias = Literal["t", "two_sd"]

CONFIDENCE = 0.95
"""Confidence of intervals."""
N_RESAMPLES = 2000
"""Enough for stable 95 % percentile bounds (our choice)."""
_CUT = 0.25
"""Share of the values that the interquartile mean leaves out at each end."""
ROUNDING = 1e-9
"""Differences that vary by less than this share of their mean are equal up to rounding."""
SIGNIFICANT = 0.05
"""Largest p value that is called significant. After Holm's correction it is the probability that chance makes one or
more of the tests so that are corrected together."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Mean of a measure over runs with an interval."""

    mean: float = math.nan
    """Mean over the runs used."""
    std: float = math.nan
    """Standard deviation over the runs used, divisor R - 1; NaN for one run."""
    lower: float = math.nan
    """Lower bound of the interval."""
    upper: float = math.nan
    """Upper bound of the interval."""
    n_used: int = 0
    """Runs that entered."""
    n_nan: int = 0
    """Runs left out because their value is NaN."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number that is not a mean of runs (a share, a parameter, a critical size), with an interval."""

    value: float
    lower: float
    """Lower bound of the interval; NaN where the runs are too few for one."""
    upper: float
    """Upper bound of the interval."""
    n_runs: int
    """Runs that entered."""

    def holds(self, value: float) -> bool:
        """Return whether a value lies inside the interval."""
        return self.lower <= value <= self.upper


def normalize(theta: ArrayLike, *, distance: bool = False) -> FloatArray:
    """Squash a measure into (-1, 1): the difference of sigmoids s(x) - s(-x) = tanh(x / 2).

    Distances (reactivity, adaptability, noise robustness) change sign, -tanh(d / 2) in (-1, 0], so that higher is
    better everywhere. The authors apply it to the last-interval value of each run, and only on request: the published
    figures show raw values.

    The result depends on the unit: small rates such as 0.01 are nearly proportional to it, while counts and long
    distances all come close to 1.

    Args:
        theta: Values of one measure, any shape.
        distance: Whether lower was better.
    """
    squashed = np.tanh(0.5 * np.asarray(theta, dtype=np.float64))
    return -squashed if distance else squashed


def aggregate(values: ArrayLike, *, method: AggregateMethod = "t", level: float = CONFIDENCE) -> Summary:
    """Mean of one value per run, with an interval.

    Args:
        values: One value per run, shape (R,). NaN values are left out and counted.
        method: `t`: Student's interval for the mean. `two_sd`: mean +- 2 standard deviations, which the paper shades
            and calls a 95 % confidence interval. This interval shows where single runs lie; the interval for the mean
            of 192 runs is about 14 times narrower.
        level: Confidence level of `t`.

    Returns:
        Summary; its bounds are NaN for fewer than two runs.

    Raises:
        CurveError: No values, or not one value per run.
        ValueError: Unknown method, or a level outside (0, 1).
    """
    check_option("method", method, AggregateMethod)
    if not 0.0 < level < 1.0:
        raise ValueError(f"Expected a confidence level in (0, 1), got {level}.")
    runs = np.asarray(values, dtype=np.float64)
    if runs.ndim != 1 or runs.size == 0:
        raise CurveError(f"Expected one value per run, shape (R,) with R >= 1, got shape {runs.shape}.")
    used = runs[~np.isnan(runs)]
    n, n_nan = used.size, runs.size - used.size
    if n < 2:
        return Summary(mean=float(used[0]) if n else math.nan, n_used=n, n_nan=n_nan)
    with np.errstate(invalid="ignore"):  # infinities, for example of scalability
        mean, std = float(used.mean()), float(used.std(ddof=1))
    spread = 2.0 * std if method == "two_sd" else float(stdtrit(n - 1, 0.5 + 0.5 * level)) * std / math.sqrt(n)
    return Summary(mean=mean, std=std, lower=mean - spread, upper=mean + spread, n_used=n, n_nan=n_nan)


# ------------------------------------------------------------------------------------------------------ paired tests


def paired_p(differences: FloatArray) -> float:
    """Two-sided p value of the paired t test that the mean difference is zero.

    Args:
        differences: One per pair of runs, (R,).

    Returns:
        The p value; NaN for fewer than two pairs or a difference that is not finite. If all differences are equal (up
        to rounding), Student's t does not exist; the value is then 1 if they are zero, else that of the sign test,
        2^(1 - R).
    """
    n_pairs = differences.size
    if n_pairs < 2 or not np.isfinite(differences).all():
        return math.nan
    std, mean = float(differences.std(ddof=1)), float(differences.mean())
    if std <= ROUNDING * abs(mean):
        return 1.0 if mean == 0.0 else 2.0 ** (1 - n_pairs)
    return 2.0 * float(stdtr(n_pairs - 1, -abs(mean) * math.sqrt(n_pairs) / std))


def holm(p_values: FloatArray, most_true: int | None = None) -> FloatArray:
    """Adjust p values of one family for testing many at once (Holm 1979); NaN values do not count and stay NaN.

    Args:
        p_values: (K,).
        most_true: How many of the hypotheses can be true at once, if some exclude others (Shaffer 1986); None: all.

    Returns:
        Adjusted values (K,), at most 1: rejecting where they are at most alpha keeps the probability of any false
        rejection at alpha.
    """
    adjusted = np.full(p_values.shape, math.nan)
    order = np.argsort(p_values, kind="stable")[: np.isfinite(p_values).sum()]  # NaN comes last
    factors = np.minimum(np.arange(order.size, 0, -1), order.size if most_true is None else most_true)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(factors * p_values[order]))
    return adjusted


def paired_tests(first: ArrayLike, second: ArrayLike) -> FloatArray:
    """Two-sided p values that two policies are equally good at each level, after Holm's correction over the levels.

        paired_tests([[4, 6, 8], [5, 5, 6]], [[1, 2, 3], [5, 6, 5]])  # levels (2,), three runs each: 0.040 and 1

    Args:
        first: One value per level and run, (L, R), or (R,) for one level. NaN marks a run without a value.
        second: The same of the other policy; run i of both has the same seed.

    Returns:
        Adjusted values of `paired_p`, (L,); NaN for a level with fewer than two pairs.

    Raises:
        CurveError: The arrays differ in shape, or have no axis of runs.
    """
    a, b = (np.asarray(values, dtype=np.float64) for values in (first, second))
    if a.shape != b.shape or a.ndim not in (1, 2):
        raise CurveError(
            f"Expected two arrays of the same shape, (levels, runs), got {a.shape} and {b.shape}; runs are paired by "
            "seed, so mark a missing run with NaN."
        )
    levels = zip(np.atleast_2d(a), np.atleast_2d(b), strict=True)
    with np.errstate(invalid="ignore"):  # infinite values of both, whose test is NaN
        return holm(np.array([paired_p((x - y)[~np.isnan(x) & ~np.isnan(y)]) for x, y in levels]))


# -------------------------------------------------------------------------------------------------------- all runs


def _check_resamples(n_resamples: int) -> None:
    if n_resamples < 1:
        raise CurveError(f"Expected n_resamples of at least 1, got {n_resamples}.")


def interquartile_mean(
    values: ArrayLike | Sequence[ArrayLike], *, seed: int | None = None, n_resamples: int = N_RESAMPLES
) -> Estimate:
    """Mean of the middle half of all values, with a stratified bootstrap interval.

        interquartile_mean([0, 10, 11, 12, 13, 90, 100, 0], seed=1).value  # 11.5, the mean is 29.5

    The runs of each level are resampled on their own, so every resample has as many runs of each level as there are.
    Values of different levels are pooled: bring them to one scale first, for example as shares of the best.

    Args:
        values: One value per run, (R,), or several levels, (L, R) or L arrays (R_l,). NaN values are left out.
        seed: Seed of the resampling; None draws a fresh one.
        n_resamples: Number of resamples, at least 1.

    Returns:
        The estimate; its bounds are NaN if a level has fewer than two runs.

    Raises:
        CurveError: No values at some level.
    """
    strata = _strata("values", values)
    _check_resamples(n_resamples)
    rng = np.random.default_rng(seed)
    drawn = [stratum[rng.integers(stratum.size, size=(n_resamples, stratum.size))] for stratum in strata]
    return _estimate(middle_mean(np.concatenate(strata)), middle_mean(np.concatenate(drawn, axis=1)), strata)


def probability_of_improvement(
    first: ArrayLike | Sequence[ArrayLike],
    second: ArrayLike | Sequence[ArrayLike],
    *,
    higher_is_better: bool = True,
    seed: int | None = None,
    n_resamples: int = N_RESAMPLES,
) -> Estimate:
    """How probably a run of the first policy is better than a run of the second, mean over levels.

        probability_of_improvement([3, 4, 5], [1, 2, 4], seed=1).value  # 7.5 of 9 pairs of runs

    This is P(X > Y) + P(X = Y) / 2 over all pairs of a run of each policy. 0.5 means no difference. The probability
    says how often a run is better, not by how much.

    Args:
        first: One value per run, (R,), or several levels, (L, R) or L arrays (R_l,). NaN values are left out.
        second: The same of the other policy; the numbers of runs may differ.
        higher_is_better: Direction of the values.
        seed: Seed of the resampling, which draws the runs of each policy and level on their own. None: a fresh one.
        n_resamples: Number of resamples, at least 1.

    Returns:
        The estimate in [0, 1]; its bounds are NaN if a level has fewer than two runs of a policy. n_runs is the smaller
        number of runs.

    Raises:
        CurveError: No values at some level, or different numbers of levels.
    """
    ours, theirs = _strata("first", first), _strata("second", second)
    if len(ours) != len(theirs):
        raise CurveError(f"Expected both policies at the same levels, got {len(ours)} and {len(theirs)} levels.")
    rng = np.random.default_rng(seed)
    shares: list[float] = []
    _check_resamples(n_resamples)
    resampled = np.zeros(n_resamples)
    for x, y in zip(ours, theirs, strict=True):
        gaps = x[:, None] - y if higher_is_better else y - x[:, None]
        wins = 0.5 + 0.5 * np.sign(gaps)
        shares.append(float(wins.mean()))
        drawn_x, drawn_y = (rng.multinomial(n, np.full(n, 1.0 / n), size=n_resamples) / n for n in (x.size, y.size))
        resampled += ((drawn_x @ wins) * drawn_y).sum(axis=1) / len(ours)
    return _estimate(np.mean(shares), resampled, ours, theirs)


def _strata(name: str, values: ArrayLike | Sequence[ArrayLike]) -> list[FloatArray]:
    """Return the values of each level without NaN."""
    is_nested = np.ndim(values[0]) > 0 if isinstance(values, Sequence) and len(values) else np.ndim(values) > 1  # type: ignore[arg-type] - what is no sequence is an array
    levels = [np.asarray(level, dtype=np.float64) for level in (values if is_nested else [values])]  # type: ignore[union-attr] - nested values can be iterated
    strata = [level[~np.isnan(level)] for level in levels]
    if any(level.ndim != 1 for level in levels) or not strata or any(stratum.size == 0 for stratum in strata):
        shapes = ", ".join(str(level.shape) for level in levels)
        raise CurveError(f"Expected {name} with at least one run at each level, (R,) or (L, R), got {shapes}.")
    return strata


def _estimate(value: np.floating | FloatArray, resampled: FloatArray, *policies: list[FloatArray]) -> Estimate:
    """The estimate with its percentile interval, where each level has two runs of each policy."""
    lower, upper = np.quantile(resampled, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    if min(values.size for levels in policies for values in levels) < 2:
        lower = upper = math.nan
    n_runs = min(sum(values.size for values in levels) for levels in policies)
    return Estimate(value=float(value), lower=float(lower), upper=float(upper), n_runs=n_runs)


def middle_mean(values: FloatArray) -> FloatArray:
    """Mean of the middle half along the last axis."""
    cut = int(_CUT * values.shape[-1])
    return np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut].mean(axis=-1)
