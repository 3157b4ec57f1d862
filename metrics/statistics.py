"""Statistics over runs: normalisation, means with intervals, and the bootstrap over independent experiments."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from .checks import CurveError, check_level, check_option, check_resamples
from .curves import FloatArray, as_curve

AggregateMethod: TypeAlias = Literal["t", "two_sd"]
Order: TypeAlias = Literal["per_run", "mean_curve"]
Experiment: TypeAlias = ArrayLike | tuple[ArrayLike, ...]
"""Curves of the runs of one experiment, shape (R, T); a tuple of them if a measure needs several of the same runs."""

_N_RESAMPLES = 2000
"""Enough for stable 95 % percentile bounds (our choice)."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Mean of a measure over runs with an interval."""

    mean: float
    """Mean over the runs used."""
    std: float
    """Standard deviation over the runs used, divisor R - 1; NaN for one run, or if there is no value per run."""
    lower: float
    """Lower bound of the interval."""
    upper: float
    """Upper bound of the interval."""
    n_used: int
    """Runs that entered."""
    n_nan: int
    """Runs left out because their value is NaN."""

    @classmethod
    def without_interval(cls, n_used: int = 0) -> "Summary":
        """Return what there is where runs give no number."""
        return cls(mean=math.nan, std=math.nan, lower=math.nan, upper=math.nan, n_used=n_used, n_nan=0)


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


def aggregate(values: ArrayLike, *, method: AggregateMethod = "t", level: float = 0.95) -> Summary:
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
    check_level(level)
    runs = np.asarray(values, dtype=np.float64)
    if runs.ndim != 1 or runs.size == 0:
        raise CurveError(f"Expected one value per run, shape (R,) with R >= 1, got shape {runs.shape}.")
    used = runs[~np.isnan(runs)]
    mean, std = _mean_and_std(used)
    lower = upper = math.nan
    if used.size > 1:
        spread = 2.0 * std
        if method == "t":
            spread = float(stdtrit(used.size - 1, 0.5 + 0.5 * level)) * std / math.sqrt(used.size)
        lower, upper = mean - spread, mean + spread
    return Summary(mean=mean, std=std, lower=lower, upper=upper, n_used=used.size, n_nan=runs.size - used.size)


def bootstrap_measure(
    measure: Callable[..., ArrayLike],
    *experiments: Experiment,
    order: Order = "per_run",
    level: float = 0.95,
    seed: int | None = None,
    n_resamples: int = _N_RESAMPLES,
) -> Summary:
    """Value of a measure of one or more experiments with a bootstrap interval.

    The function resamples the runs of each experiment separately, because the study's experiments have independent
    seeds: run i of one experiment is not related to run i of another.

        bootstrap_measure(adaptability, ideal_runs, throttled_runs, order="mean_curve", seed=1)

    Args:
        measure: Called with one argument per experiment, of the same structure as given, and returning (...,) for
            curves (..., T). Bind sizes and options beforehand, for example with a lambda.
        experiments: Curves (R, T) of the runs of each experiment, or a tuple of curves of the same runs.
        order: `per_run`, the authors' way: the measure of each pair of runs, then the mean; needs equal R.
            `mean_curve`: the measure of the mean curves, which lowers the noise floor of distances. The order matters
            for scalability (a ratio) and the distances; measures of products (performance times interference) belong to
            `per_run`.
        level: Confidence level.
        seed: Seed of the resampling; None draws a fresh one.
        n_resamples: Number of resamples.

    Returns:
        Summary of the percentile interval. Under `mean_curve` `std` is NaN (there is no value per run), n_used is the
        smallest number of runs, and a NaN in any run makes the value NaN.

    Raises:
        CurveError: Curves without a run axis, tuples whose parts differ in R, or experiments whose R differ under
            `per_run`.
        ValueError: Unknown order, a level outside (0, 1) or no resamples.
    """
    check_option("order", order, Order)
    check_level(level)
    check_resamples(n_resamples)
    parts = [_curves_of_runs(experiment) for experiment in experiments]
    sizes = [part[0].shape[0] for part in parts]
    if order == "per_run" and len(set(sizes)) != 1:
        raise CurveError(f"Expected equally many runs per experiment with order='per_run', got {sizes}.")

    def measured(curves: _Parts) -> FloatArray:
        arguments = [part if isinstance(e, tuple) else part[0] for part, e in zip(curves, experiments, strict=True)]
        return np.atleast_1d(np.asarray(measure(*arguments), dtype=np.float64))

    rng = np.random.default_rng(seed)
    if order == "mean_curve":
        return _bootstrap_mean_curves(measured, parts, sizes, level, rng, n_resamples)
    return _bootstrap_runs(measured, parts, sizes, level, rng, n_resamples)


_Parts: TypeAlias = list[tuple[FloatArray, ...]]
"""One tuple of curves per experiment."""


def _bootstrap_runs(
    measured: Callable[[_Parts], FloatArray],
    parts: _Parts,
    sizes: list[int],
    level: float,
    rng: np.random.Generator,
    n_resamples: int,
) -> Summary:
    values = measured(parts)
    used = values[~np.isnan(values)]
    mean, std = _mean_and_std(used)
    lower = upper = math.nan
    if used.size > 1:
        means = np.empty(n_resamples)
        for k in range(n_resamples):
            picks = [rng.integers(size, size=size) for size in sizes]
            resample = measured([tuple(c[pick] for c in part) for part, pick in zip(parts, picks, strict=True)])
            means[k], _ = _mean_and_std(resample[~np.isnan(resample)])
        lower, upper = percentile_bounds(means[~np.isnan(means)], level)
    return Summary(mean=mean, std=std, lower=lower, upper=upper, n_used=used.size, n_nan=values.size - used.size)


def _bootstrap_mean_curves(
    measured: Callable[[_Parts], FloatArray],
    parts: _Parts,
    sizes: list[int],
    level: float,
    rng: np.random.Generator,
    n_resamples: int,
) -> Summary:
    value = float(measured([tuple(curve.mean(axis=0) for curve in part) for part in parts])[0])
    lower = upper = math.nan
    if min(sizes) > 1:
        # How often each run is drawn, so that all resampled mean curves are one product, shape (n_resamples, T).
        shares = [rng.multinomial(size, np.full(size, 1.0 / size), size=n_resamples) / size for size in sizes]
        resampled = measured([tuple(s @ curve for curve in part) for part, s in zip(parts, shares, strict=True)])
        lower, upper = percentile_bounds(resampled, level)
    return Summary(mean=value, std=math.nan, lower=lower, upper=upper, n_used=min(sizes), n_nan=0)


def _curves_of_runs(experiment: Experiment) -> tuple[FloatArray, ...]:
    parts = tuple(as_curve("experiment", part, signed=True) for part in _as_tuple(experiment))
    if any(part.ndim != 2 for part in parts) or len({part.shape[0] for part in parts}) != 1:
        shapes = ", ".join(str(part.shape) for part in parts)
        raise CurveError(f"Expected curves of the same runs, shape (R, T), for each experiment, got {shapes}.")
    return parts


def _as_tuple(experiment: Experiment) -> tuple[ArrayLike, ...]:
    return experiment if isinstance(experiment, tuple) else (experiment,)


def _mean_and_std(values: FloatArray) -> tuple[float, float]:
    with np.errstate(invalid="ignore"):  # infinities, for example of scalability
        mean = float(values.mean()) if values.size else math.nan
        std = float(values.std(ddof=1)) if values.size > 1 else math.nan
    return mean, std


def percentile_bounds(values: FloatArray, level: float) -> tuple[float, float]:
    """Bounds of the percentile interval of resampled values, (B,); an infinite value can be a bound."""
    # Interpolating between two infinite values, for example of scalability, gives NaN.
    method = "nearest" if np.isinf(values).any() else "linear"
    lower, upper = np.quantile(values, [0.5 - 0.5 * level, 0.5 + 0.5 * level], method=method)
    return float(lower), float(upper)
