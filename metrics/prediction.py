"""Performance predicted from swarm size: three laws, fitted to small swarms and continued to larger ones.

    linear       P(N) = a N
    contention   P(N) = a N / (1 + s (N - 1))
    universal    P(N) = a N / (1 + s (N - 1) + k N (N - 1)),    largest at N = sqrt((1 - s) / k)

a is the performance of one robot, s (contention) the share of work that robots do one at a time, k (coherency) the cost
per pair of robots. With a = 2, s = 0.1, k = 0.01, ten robots deliver 20 / (1 + 0.9 + 0.9) = 7.14 objects, and a swarm
of sqrt(0.9 / 0.01) = 9.49 robots delivers most. Sources: Amdahl 1967 for contention, whose serial fraction the paper's
scalability, Eq. (4), estimates; Gunther 1993 for the universal law, which contains the other two.

Square roots of performance are compared, not performance itself (our choice): deliveries are counts, whose variance
grows with their mean, and the variance of their square roots does not.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, cast, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear, nnls  # type: ignore[import-untyped] - scipy ships no types

from .checks import CurveError, check_level, check_option, check_resamples, check_size
from .curves import FloatArray

LawName: TypeAlias = Literal["linear", "contention", "universal"]
LAWS: tuple[LawName, ...] = get_args(LawName)
"""In rising order of their number of parameters, which is the place in this tuple plus one."""
MIN_SIZES = 4
"""Three sizes fix the universal law; a fourth is needed to judge a law by."""
REACH = 4.0
"""How many times the largest fitted size we look ahead: for the critical size, and in judging a law (our choice)."""
_MAX_STEPS = 50
_MAX_HALVINGS = 40
_CONVERGED = 1e-9
"""Relative change of the loss below which a fit has converged."""
_MOST_ALONE = 10.0
"""Largest performance of one robot that is fitted, in units of the best measured performance per robot (our choice)."""


@dataclass(frozen=True, kw_only=True)
class SizeLaw:
    """Performance as a function of swarm size."""

    name: LawName
    a: float
    """Performance of one robot, a >= 0."""
    contention: float = 0.0
    """s in [0, 1]."""
    coherency: float = 0.0
    """k >= 0."""

    @property
    def n_parameters(self) -> int:
        """Number of fitted parameters."""
        return LAWS.index(self.name) + 1

    @property
    def peak(self) -> float:
        """Swarm size of the largest performance, sqrt((1 - s) / k); infinite where performance never falls."""
        return math.sqrt((1.0 - self.contention) / self.coherency) if self.coherency > 0.0 else math.inf

    def performance(self, sizes: ArrayLike) -> FloatArray:
        """Return P(N) for swarm sizes N of any shape."""
        n = np.asarray(sizes, dtype=np.float64)
        return self.a * n / (1.0 + self.contention * (n - 1.0) + self.coherency * n * (n - 1.0))


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


def fit_law(name: LawName, sizes: Sequence[int], performance: ArrayLike) -> SizeLaw:
    """Fit a law to mean performances, by least squares of their square roots.

    With u = (1 - s) / a, v = s / a and w = k / a, all at least 0, P(N) = N / (u + v N + w N (N - 1)). The roots are
    linearized in u, v, w and solved by non-negative least squares, until they change no more (Gauss and Newton). Where
    one robot was not measured, 1 / a = u + v may be free to vanish: a is at most `_MOST_ALONE` times the best
    performance per robot.

    Args:
        name: One of `LAWS`.
        sizes: Swarm sizes, (S,).
        performance: Mean performance of each, (S,), at least one above 0.

    Raises:
        CurveError: sizes and performances do not fit together, fewer sizes than the law has parameters, or a swarm
            that never achieves anything.
        ValueError: an unknown law.
    """
    check_option("name", name, LawName)
    n = np.array([check_size("each size", size) for size in sizes], dtype=np.float64)
    means = _checked_means(n, performance)
    n_parameters = LAWS.index(name) + 1
    if len(set(n.tolist())) < n_parameters:
        raise CurveError(f"Expected {n_parameters} or more different sizes for the {name} law, got {len(set(n))}.")
    if not means.any():
        raise CurveError("Expected a performance above 0 at some swarm size, got none; there is nothing to predict.")
    return _fit(name, n, np.sqrt(means))


def forward_error(name: LawName, sizes: Sequence[int], performance: ArrayLike) -> float:
    """How well a law, fitted to the smallest swarms, predicts the next larger ones: what the law is chosen for.

    The law is fitted to the 3, 4, ... smallest sizes, and each time the larger ones up to `REACH` times the largest of
    them are predicted. The error is the root of the mean squared difference of the square roots of predicted and
    measured performance. A criterion of fit, such as Akaike's, judges a law inside the range that it was fitted to; a
    law that is asked to continue is judged by continuing.

    Args:
        name: One of `LAWS`.
        sizes: Swarm sizes in rising order, (S,), at least `MIN_SIZES`.
        performance: Mean performance of each, (S,).

    Raises:
        CurveError: too few sizes, not in rising order, or performances that do not fit to them.
        ValueError: an unknown law.
    """
    check_option("name", name, LawName)
    n = _checked_sizes(sizes)
    return _forward_error(name, n, np.sqrt(_checked_means(n, performance)))


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

    Of the three laws that with the smallest `forward_error` is taken. Each resample draws the runs of every size anew,
    adds what the law misses at the fitted sizes beyond that scatter, chooses and fits a law, and adds the scatter of
    a mean around it. So the interval covers: which runs there happened to be, the scatter of the runs that are
    predicted (a mean over as many as each size has), the misfit of the law, and the choice between the three laws. It
    does not cover what begins only in larger swarms, a jam for example.

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
    n = _checked_sizes(sizes)
    wanted = tuple(check_size("each size in at", size) for size in at)
    totals = _checked_runs(n, runs)
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
        found = _fit(_best(_forward_errors(n, roots)), n, roots)
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
        means = np.array([_resampled_mean(total, rng) for total in self.totals])
        misfit = math.sqrt(variance - self.between_means) * rng.standard_normal(means.size)
        return np.maximum(0.0, np.sqrt(means) + misfit), math.sqrt(variance)


def _resampled_mean(total: FloatArray, rng: np.random.Generator) -> float:
    """Mean of as many runs, drawn with replacement; scaled, because the mean of R runs would vary too little for R."""
    mean = float(total.mean())
    drawn = float(total[rng.integers(total.size, size=total.size)].mean())
    return max(0.0, mean + (drawn - mean) * math.sqrt(total.size / (total.size - 1.0)))


def _checked_sizes(sizes: Sequence[int]) -> FloatArray:
    checked = [check_size("each size", size) for size in sizes]
    if checked != sorted(set(checked)):
        raise CurveError(f"Expected different sizes in rising order, got {', '.join(map(str, checked))}.")
    if len(checked) < MIN_SIZES:
        raise CurveError(
            f"Expected {MIN_SIZES} or more swarm sizes to fit, got {len(checked)}: three fix a law of three "
            "parameters, and one more is needed to judge it."
        )
    return np.array(checked, dtype=np.float64)


def _checked_means(n: FloatArray, performance: ArrayLike) -> FloatArray:
    means = np.asarray(performance, dtype=np.float64)
    if means.shape != n.shape or not np.isfinite(means).all() or (means < 0.0).any():
        raise CurveError(f"Expected a finite performance >= 0 for each of {n.size} sizes, got {means.tolist()}.")
    return means


def _checked_runs(n: FloatArray, runs: Sequence[ArrayLike]) -> tuple[FloatArray, ...]:
    totals = tuple(np.asarray(values, dtype=np.float64) for values in runs)
    if len(totals) != n.size:
        raise CurveError(f"Expected the runs of {n.size} swarm sizes, got those of {len(totals)}.")
    for size, values in zip(n, totals, strict=True):
        if values.ndim != 1 or values.size < 2:
            raise CurveError(
                f"Expected two or more runs with {size:g} robots, one number each, got shape {values.shape}; "
                "a single run does not show its scatter."
            )
        if not np.isfinite(values).all() or (values < 0.0).any():
            raise CurveError(f"Expected finite performances >= 0 with {size:g} robots, got {values.tolist()}.")
    return totals


def _best(errors: Mapping[LawName, float]) -> LawName:
    """The law of the smallest error; of equal ones that with the fewest parameters."""
    smallest = min(errors.values())
    return next(name for name in LAWS if errors[name] <= smallest * (1.0 + 1e-9) + 1e-12)


def _forward_errors(n: FloatArray, roots: FloatArray) -> dict[LawName, float]:
    return {name: _forward_error(name, n, roots) for name in LAWS}


def _forward_error(name: LawName, n: FloatArray, roots: FloatArray) -> float:
    squares: list[float] = []
    for n_fitted in range(MIN_SIZES - 1, n.size):
        law = _fit(name, n[:n_fitted], roots[:n_fitted])
        ahead = (n > n[n_fitted - 1]) & (n <= REACH * n[n_fitted - 1])
        squares += ((np.sqrt(law.performance(n[ahead])) - roots[ahead]) ** 2).tolist()
    return math.sqrt(sum(squares) / len(squares)) if squares else math.inf


def _fit(name: LawName, n: FloatArray, roots: FloatArray) -> SizeLaw:
    """Fit a law to roots of mean performance, see `fit_law`."""
    terms = np.stack([np.ones_like(n), n, n * (n - 1.0)], axis=1)[:, : LAWS.index(name) + 1]
    best_per_robot = float((roots**2 / n).max())
    if best_per_robot == 0.0:
        return SizeLaw(name=name, a=0.0)
    # First N / P, which is linear in u, v, w, with the weights that differences of roots have there.
    floor = 1.0 / (_MOST_ALONE * best_per_robot)
    start = _least_squares(terms * (roots**3 / n)[:, None], roots, floor)
    start[0] = max(start[0], floor)
    solution, loss = start, _loss(start, terms, n, roots)
    for _step in range(_MAX_STEPS):
        cost = terms @ solution
        model = np.sqrt(n / cost)
        slope = -0.5 * (model / cost)[:, None] * terms
        step = _least_squares(slope, roots - model + slope @ solution, floor) - solution
        size, before = 1.0, loss
        for _halving in range(_MAX_HALVINGS):
            trial = solution + size * step
            loss = _loss(trial, terms, n, roots)
            if loss <= before:
                solution = trial
                break
            size *= 0.5
        if before - loss <= _CONVERGED * before:
            break
    u, v, w = np.pad(solution, (0, 3 - solution.size)).tolist()
    return SizeLaw(name=name, a=1.0 / (u + v), contention=v / (u + v), coherency=w / (u + v))


def _least_squares(matrix: FloatArray, target: FloatArray, floor: float) -> FloatArray:
    """Return the u, v, w >= 0 of least squares, as many as the matrix has columns, with u + v at least `floor`."""
    free = cast("FloatArray", nnls(matrix, target)[0])
    if free[:2].sum() >= floor:
        return free
    if free.size == 1:
        return np.array([floor])
    # The problem is convex, so its solution is on the bound: u = floor - v, and v and w remain.
    rest = matrix[:, 1:].copy()
    rest[:, 0] -= matrix[:, 0]
    upper = np.array([floor, math.inf])[: rest.shape[1]]
    found = lsq_linear(rest, target - floor * matrix[:, 0], bounds=(0.0, upper), method="bvls")
    others = cast("FloatArray", found.x)  # pyright: ignore[reportUnknownMemberType] - scipy ships no types
    return np.concatenate([[floor - others[0]], others])


def _loss(solution: FloatArray, terms: FloatArray, n: FloatArray, roots: FloatArray) -> float:
    with np.errstate(divide="ignore"):  # a cost of zero makes an infinite loss, and the step is halved
        difference = np.sqrt(n / (terms @ solution)) - roots
    return float(difference @ difference)
