"""Statistics that look at all runs: interquartile mean, probability of improvement, optimality gap, profile.

The mean of a few runs depends strongly on the best or the worst run. Near the critical size of a swarm, some runs break
down and others do not, and the mean describes neither kind. Source of the measures and of their intervals: Agarwal et
al. 2021.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .checks import CurveError, check_level, check_resamples
from .curves import FloatArray
from .statistics import Estimate, percentile_bounds

N_RESAMPLES = 2000
"""As for the other intervals of `statistics` (our choice)."""
_CUT = 0.25
"""Share of the values that the interquartile mean leaves out at each end."""


def interquartile_mean(
    values: ArrayLike | Sequence[ArrayLike],
    *,
    level: float = 0.95,
    seed: int | None = None,
    n_resamples: int = N_RESAMPLES,
) -> Estimate:
    """Mean of the middle half of all values, with a stratified bootstrap interval.

        interquartile_mean([0, 10, 11, 12, 13, 90, 100, 0], seed=1).value  # 11.5, the mean is 29.5

    The runs of each level are resampled on their own, so every resample has as many runs of each level as there are.
    Values of different levels are pooled: bring them to one scale first, for example as shares of the best.

    Args:
        values: One value per run, (R,), or several levels, (L, R) or L arrays (R_l,). NaN values are left out.
        level: Confidence level.
        seed: Seed of the resampling; None draws a fresh one.
        n_resamples: Number of resamples.

    Returns:
        The estimate; its bounds are NaN if a level has fewer than two runs.

    Raises:
        CurveError: No values at some level.
        ValueError: A level outside (0, 1), or no resamples.
    """
    check_level(level)
    check_resamples(n_resamples)
    strata = _strata("values", values)
    pooled = np.concatenate(strata)
    lower = upper = math.nan
    if min(stratum.size for stratum in strata) > 1:
        rng = np.random.default_rng(seed)
        drawn = [stratum[rng.integers(stratum.size, size=(n_resamples, stratum.size))] for stratum in strata]
        lower, upper = percentile_bounds(_middle_mean(np.concatenate(drawn, axis=1)), level)
    return Estimate(value=float(_middle_mean(pooled)), lower=lower, upper=upper, n_runs=pooled.size)


def probability_of_improvement(
    first: ArrayLike | Sequence[ArrayLike],
    second: ArrayLike | Sequence[ArrayLike],
    *,
    higher_is_better: bool = True,
    level: float = 0.95,
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
        level: Confidence level.
        seed: Seed of the resampling, which draws the runs of each policy and level on their own. None: a fresh one.
        n_resamples: Number of resamples.

    Returns:
        The estimate in [0, 1]; its bounds are NaN if a level has fewer than two runs of a policy. n_runs is the smaller
        number of runs.

    Raises:
        CurveError: No values at some level, or different numbers of levels.
        ValueError: A level outside (0, 1), or no resamples.
    """
    check_level(level)
    check_resamples(n_resamples)
    ours, theirs = _strata("first", first), _strata("second", second)
    if len(ours) != len(theirs):
        raise CurveError(f"Expected both policies at the same levels, got {len(ours)} and {len(theirs)} levels.")
    rng = np.random.default_rng(seed)
    shares: list[float] = []
    resampled = np.zeros(n_resamples)
    for x, y in zip(ours, theirs, strict=True):
        if not higher_is_better:
            x, y = -x, -y
        wins = (x[:, None] > y) + 0.5 * (x[:, None] == y)
        shares.append(float(wins.mean()))
        drawn_x, drawn_y = (_drawn_shares(values.size, n_resamples, rng) for values in (x, y))
        resampled += ((drawn_x @ wins) * drawn_y).sum(axis=1) / len(ours)
    enough = min(values.size for values in (*ours, *theirs)) > 1
    lower, upper = percentile_bounds(resampled, level) if enough else (math.nan, math.nan)
    n_runs = min(sum(values.size for values in policy) for policy in (ours, theirs))
    return Estimate(value=float(np.mean(shares)), lower=lower, upper=upper, n_runs=n_runs)


def optimality_gap(values: ArrayLike) -> float:
    """Mean amount by which runs fall short of 1; 0 if every run reaches it.

        optimality_gap([0.5, 1.5]) # 0.25: a run above 1 does not make up for one below

    Args:
        values: One value per run, any shape. NaN values are left out.

    Raises:
        CurveError: No values.
    """
    runs = np.asarray(values, dtype=np.float64)
    known = runs[~np.isnan(runs)]
    if known.size == 0:
        raise CurveError(f"Expected at least one run, got values of shape {runs.shape} without a number.")
    return float(np.maximum(1.0 - known, 0.0).mean())


def performance_profile(values: ArrayLike, thresholds: ArrayLike) -> FloatArray:
    """Share of the runs above each threshold, (T,): 1 minus their distribution function.

        performance_profile([0.5, 1.5, 2.0], [0.0, 1.0])  # 1 and 2/3

    Args:
        values: One value per run, any shape. NaN values are left out.
        thresholds: (T,), in the unit of the values.

    Raises:
        CurveError: No values.
    """
    runs = np.asarray(values, dtype=np.float64)
    known = np.sort(runs[~np.isnan(runs)])
    if known.size == 0:
        raise CurveError(f"Expected at least one run, got values of shape {runs.shape} without a number.")
    return 1.0 - np.searchsorted(known, np.asarray(thresholds, dtype=np.float64), side="right") / known.size


def _strata(name: str, values: ArrayLike | Sequence[ArrayLike]) -> list[FloatArray]:
    """Return the values of each level without NaN."""
    is_nested = np.ndim(values[0]) > 0 if isinstance(values, Sequence) and len(values) else np.ndim(values) > 1  # type: ignore[arg-type] - what is no sequence is an array
    levels = [np.asarray(level, dtype=np.float64) for level in (values if is_nested else [values])]  # type: ignore[union-attr] - nested values can be iterated
    strata = [level[~np.isnan(level)] for level in levels]
    if any(level.ndim != 1 for level in levels) or not strata or any(stratum.size == 0 for stratum in strata):
        shapes = ", ".join(str(level.shape) for level in levels)
        raise CurveError(f"Expected {name} with at least one run at each level, (R,) or (L, R), got {shapes}.")
    return strata


def _middle_mean(values: FloatArray) -> FloatArray:
    """Mean of the middle half along the last axis."""
    cut = int(_CUT * values.shape[-1])
    return np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut].mean(axis=-1)


def _drawn_shares(n_runs: int, n_resamples: int, rng: np.random.Generator) -> FloatArray:
    """How often each run is drawn, as a share of the runs, (n_resamples, n_runs)."""
    return rng.multinomial(n_runs, np.full(n_runs, 1.0 / n_runs), size=n_resamples) / n_runs
