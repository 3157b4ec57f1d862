"""A ladder of swarm sizes described by laws: parameters, critical size and class of scaling, each with an interval.

`prediction` chooses the law that extrapolates best. Here, every law is fitted to all sizes, so that it can be drawn
beside the data.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_level, check_resamples
from .curves import FloatArray
from .laws import ALL_LAWS, PARAMETERS, LawName, SizeLaw, checked_runs, checked_sizes, fit_roots, resampled_mean
from .statistics import Estimate, percentile_bounds

Scaling: TypeAlias = Literal["sublinear", "linear", "superlinear", "undecided"]

NEAR_LINEAR = 0.1
"""An exponent whose interval lies within this distance of 1 and holds 1 is linear (our choice)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LawFit:
    """One law, fitted to a ladder."""

    law: SizeLaw
    """Its `performance` is the curve to draw."""
    error: float
    """Root of the mean squared difference of square roots, per size beyond the number of parameters."""
    parameters: Mapping[str, Estimate]
    """Field of `SizeLaw` -> its value with an interval."""
    peak: Estimate
    """Swarm size of the largest performance; infinite where there is none, and so a bound if too many resamples have
    none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Ladder:
    """Performance over swarm size, described."""

    laws: Mapping[LawName, LawFit]
    """Every law, fitted to all sizes."""
    exponent: Estimate
    """b of the power law a N^b, fitted to the sizes up to the best."""
    scaling: Scaling
    """By the interval of the exponent: `linear` if it holds 1 and lies within `NEAR_LINEAR` of it, `sublinear` or
    `superlinear` if it leaves out 1, else `undecided`."""
    best_size: int
    """Size with the largest mean performance."""
    falling_share: float
    """Share of resamples in which a smaller swarm than the largest is the best: 1 = performance falls in the end."""

    @property
    def closest(self) -> LawName:
        """The law of the smallest error."""
        return min(self.laws, key=lambda name: self.laws[name].error)


def fit_ladder(
    sizes: Sequence[int],
    runs: Sequence[ArrayLike],
    *,
    level: float = 0.95,
    n_resamples: int = 200,
    seed: int | None = None,
) -> Ladder:
    """Fit all laws to the runs of swarms of several sizes.

        fit_ladder([1, 2, 4, 8], [[10, 11], [19, 22], [38, 37], [70, 66]], seed=1).scaling  # "sublinear"

    Intervals are percentiles of fits to resampled runs, each size on its own. They say how well the runs determine a
    parameter if the law holds, not whether it does: compare the errors, and look at the curve beside the data.

    Args:
        sizes: Swarm sizes in rising order, (S,), four or more.
        runs: Performance of each run at each size, summed over time: S arrays (R,), R >= 2.
        level: Confidence level.
        n_resamples: Number of resamples.
        seed: Seed of the resampling; None draws a fresh one.

    Raises:
        CurveError: Too few sizes or runs, sizes that are not rising, or performances that are negative or not finite.
        ValueError: A level outside (0, 1), or no resamples.

    Source: laws as in `laws`; classes of scaling after Hamann et al. 2020, their borders are ours.
    """
    check_level(level)
    check_resamples(n_resamples)
    n = checked_sizes(sizes)
    totals = checked_runs(n, runs)
    n_runs = sum(total.size for total in totals)
    rng = np.random.default_rng(seed)
    roots = np.sqrt([total.mean() for total in totals])
    drawn = [np.sqrt([resampled_mean(total, rng) for total in totals]) for _ in range(n_resamples)]
    laws: dict[LawName, LawFit] = {name: _law_fit(name, n, roots, drawn, level, n_runs) for name in ALL_LAWS}
    exponent = _estimate(_rising_exponent(n, roots), [_rising_exponent(n, each) for each in drawn], level, n_runs)
    return Ladder(
        laws=laws,
        exponent=exponent,
        scaling=_scaling(exponent),
        best_size=int(n[np.argmax(roots)]),
        falling_share=float(np.mean([np.argmax(each) < n.size - 1 for each in drawn])),
    )


def _law_fit(
    name: LawName, n: FloatArray, roots: FloatArray, drawn: Sequence[FloatArray], level: float, n_runs: int
) -> LawFit:
    law = fit_roots(name, n, roots)
    resampled = [fit_roots(name, n, each) for each in drawn]
    differences = np.sqrt(law.performance(n)) - roots
    return LawFit(
        law=law,
        error=math.sqrt(float(differences @ differences) / (n.size - law.n_parameters)),
        parameters={
            field: _estimate(getattr(law, field), [getattr(each, field) for each in resampled], level, n_runs)
            for field in PARAMETERS[name]
        },
        peak=_estimate(law.peak, [each.peak for each in resampled], level, n_runs),
    )


def _estimate(value: float, resampled: Sequence[float], level: float, n_runs: int) -> Estimate:
    lower, upper = percentile_bounds(np.array(resampled, dtype=np.float64), level)
    return Estimate(value=value, lower=lower, upper=upper, n_runs=n_runs)


def _rising_exponent(n: FloatArray, roots: FloatArray) -> float:
    """Exponent of the power law of the sizes up to the best, two at least."""
    last = max(2, int(np.argmax(roots)) + 1)
    return fit_roots("power", n[:last], roots[:last]).exponent


def _scaling(exponent: Estimate) -> Scaling:
    if exponent.lower > 1.0:
        return "superlinear"
    if exponent.upper < 1.0:
        return "sublinear"
    near = exponent.lower >= 1.0 - NEAR_LINEAR and exponent.upper <= 1.0 + NEAR_LINEAR
    return "linear" if near else "undecided"
