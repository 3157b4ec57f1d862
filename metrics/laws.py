"""Laws of performance over swarm size: what each says, and how it is fitted to measured means.

With a = 2, s = 0.1 and k = 0.01, ten robots deliver 20 / (1 + 0.9 + 0.9) = 7.14 objects, and a swarm of sqrt(0.9 /
0.01) = 9.49 robots delivers most. `LAW_WORDS` has the formulas. a is the performance of one robot (nearly, in the last
law), s (contention) is the share of the work that robots can only do one after the other, and k (coherency) is the cost
per pair of robots. If b is above 1, performance grows faster than the number of robots. c <= 0 says how much robots
hinder each other.

Sources: Amdahl 1967 for contention, whose serial fraction the paper's scalability, Eq. (4), estimates; Gunther 1993 for
the universal law, which contains the two before it; Hamann 2013 for cooperation times interference, N^b exp(c N).

We compare square roots of performance (our choice). Deliveries are counts: their variance grows with their mean, but
the variance of their square roots does not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, cast, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares, lsq_linear, nnls  # type: ignore[import-untyped] - scipy ships no types

from .checks import CurveError, check_option, check_size
from .curves import FloatArray

LawName: TypeAlias = Literal["linear", "contention", "universal", "power", "hamann"]
ALL_LAWS: tuple[LawName, ...] = get_args(LawName)
LAWS: tuple[LawName, ...] = ALL_LAWS[:3]
"""Laws that predictions choose from, each contained in the next: rising in their number of parameters."""
PARAMETERS: dict[LawName, tuple[str, ...]] = {
    "linear": ("a",),
    "contention": ("a", "contention"),
    "universal": ("a", "contention", "coherency"),
    "power": ("a", "exponent"),
    "hamann": ("a", "exponent", "decay"),
}
"""Law -> the fields of `SizeLaw` that are fitted."""
SYMBOLS = {"a": "a", "contention": "s", "coherency": "k", "exponent": "b", "decay": "c"}
"""Field of `SizeLaw` -> its letter in a formula."""


class LawWords(NamedTuple):
    """A law as readers see it."""

    formula: str
    """P(N)."""
    largest_at: str
    """Swarm size of the largest performance; a dash where it only grows."""
    says: str
    """What it says of robots."""


LAW_WORDS: dict[LawName, LawWords] = {
    "linear": LawWords("a N", "-", "robots do not affect each other"),
    "contention": LawWords("a N / (1 + s (N - 1))", "-", "robots wait for one another (Amdahl)"),
    "universal": LawWords(
        "a N / (1 + s (N - 1) + k N (N - 1))", "sqrt((1 - s) / k)", "robots wait, and every pair costs time (Gunther)"
    ),
    "power": LawWords("a N^b", "-", "b < 1 sublinear, b > 1 superlinear"),
    "hamann": LawWords("a N^b exp(c N)", "-b / c", "cooperation times interference (Hamann)"),
}
MIN_SIZES = 4
"""Three sizes fix the universal law; a fourth is needed to judge a law by."""
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
    exponent: float = 1.0
    """b >= 0."""
    decay: float = 0.0
    """c <= 0."""

    @property
    def n_parameters(self) -> int:
        """Number of fitted parameters."""
        return len(PARAMETERS[self.name])

    @property
    def peak(self) -> float:
        """Swarm size of the largest performance; infinite where performance never falls."""
        if self.decay < 0.0:
            return -self.exponent / self.decay
        return math.sqrt((1.0 - self.contention) / self.coherency) if self.coherency > 0.0 else math.inf

    def performance(self, sizes: ArrayLike) -> FloatArray:
        """Return P(N) for swarm sizes N of any shape."""
        n = np.asarray(sizes, dtype=np.float64)
        gain = n**self.exponent * np.exp(self.decay * n)
        return self.a * gain / (1.0 + self.contention * (n - 1.0) + self.coherency * n * (n - 1.0))


def fit_law(name: LawName, sizes: Sequence[int], performance: ArrayLike) -> SizeLaw:
    """Fit a law to mean performances, by least squares of their square roots.

    The first three: with u = (1 - s) / a, v = s / a and w = k / a, all at least 0, P(N) = N / (u + v N + w N (N - 1)).
    The roots are linearized in u, v, w and solved by non-negative least squares, until they change no more (Gauss and
    Newton). Where one robot was not measured, 1 / a = u + v may be free to vanish: a is at most `_MOST_ALONE` times the
    best performance per robot. The other two: the logarithm of the roots is linear in ln a, b >= 0 and c <= 0, which a
    trust region method finds.

    Args:
        name: One of `ALL_LAWS`.
        sizes: Swarm sizes, (S,).
        performance: Mean performance of each, (S,), at least one above 0.

    Raises:
        CurveError: sizes and performances do not fit together, fewer sizes than the law has parameters, or a swarm
            that never achieves anything.
        ValueError: an unknown law.
    """
    check_option("name", name, LawName)
    n = np.array([check_size("each size", size) for size in sizes], dtype=np.float64)
    means = checked_means(n, performance)
    n_parameters = len(PARAMETERS[name])
    if len(set(n.tolist())) < n_parameters:
        raise CurveError(f"Expected {n_parameters} or more different sizes for the {name} law, got {len(set(n))}.")
    if not means.any():
        raise CurveError("Expected a performance above 0 at some swarm size, got none; there is nothing to predict.")
    return fit_roots(name, n, np.sqrt(means))


def checked_means(n: FloatArray, performance: ArrayLike) -> FloatArray:
    """Return mean performances as an array, (S,).

    Raises:
        CurveError: They do not fit to the sizes n, or are negative or not finite.
    """
    means = np.asarray(performance, dtype=np.float64)
    if means.shape != n.shape or not np.isfinite(means).all() or (means < 0.0).any():
        raise CurveError(f"Expected a finite performance >= 0 for each of {n.size} sizes, got {means.tolist()}.")
    return means


def checked_sizes(sizes: Sequence[int]) -> FloatArray:
    """Return swarm sizes as an array, (S,).

    Raises:
        CurveError: Fewer than `MIN_SIZES`, or not in rising order.
    """
    checked = [check_size("each size", size) for size in sizes]
    if checked != sorted(set(checked)):
        raise CurveError(f"Expected different sizes in rising order, got {', '.join(map(str, checked))}.")
    if len(checked) < MIN_SIZES:
        raise CurveError(
            f"Expected {MIN_SIZES} or more swarm sizes to fit, got {len(checked)}: three fix a law of three "
            "parameters, and one more is needed to judge it."
        )
    return np.array(checked, dtype=np.float64)


def checked_runs(n: FloatArray, runs: Sequence[ArrayLike]) -> tuple[FloatArray, ...]:
    """Return the performances of runs as arrays (R,), one per size.

    Raises:
        CurveError: Not one array per size, fewer than two runs at some size, or values that are negative or not finite.
    """
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


def resampled_mean(total: FloatArray, rng: np.random.Generator) -> float:
    """Return the mean of as many runs, drawn with replacement, at least 0.

    Its deviation is scaled up, because the mean of R runs drawn from R varies too little.

    Args:
        total: Performance of each run, (R,), R >= 2.
        rng: Draws the runs.
    """
    mean = float(total.mean())
    drawn = float(total[rng.integers(total.size, size=total.size)].mean())
    return max(0.0, mean + (drawn - mean) * math.sqrt(total.size / (total.size - 1.0)))


def fit_roots(name: LawName, n: FloatArray, roots: FloatArray) -> SizeLaw:
    """Fit a law to roots of mean performance, (S,) like the sizes n; see `fit_law`, which checks its arguments."""
    if not roots.any():
        return SizeLaw(name=name, a=0.0)
    return _fit_rational(name, n, roots) if name in LAWS else _fit_exponential(name, n, roots)


def _fit_rational(name: LawName, n: FloatArray, roots: FloatArray) -> SizeLaw:
    terms = np.stack([np.ones_like(n), n, n * (n - 1.0)], axis=1)[:, : len(PARAMETERS[name])]
    best_per_robot = float((roots**2 / n).max())
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


def _fit_exponential(name: LawName, n: FloatArray, roots: FloatArray) -> SizeLaw:
    largest = float(n.max())  # sizes as shares of the largest, so that all parameters are of the same order
    terms = np.stack([np.ones_like(n), np.log(n / largest), n / largest], axis=1)[:, : len(PARAMETERS[name])]
    start = np.array([math.log(float((roots**2 / n).max()) * largest), 1.0, -0.1])[: terms.shape[1]]
    lowest = np.array([-np.inf, 0.0, -np.inf])[: start.size]
    highest = np.array([np.inf, np.inf, 0.0])[: start.size]

    def model(parameters: FloatArray) -> FloatArray:
        return np.exp(0.5 * (terms @ parameters))

    def differences(parameters: FloatArray) -> FloatArray:
        return model(parameters) - roots

    def slopes(parameters: FloatArray) -> FloatArray:
        return 0.5 * model(parameters)[:, None] * terms

    found = least_squares(  # pyright: ignore[reportUnknownVariableType] - scipy ships no types
        differences,
        start,
        jac=slopes,  # pyright: ignore[reportArgumentType] - scipy's source names only the methods by text
        bounds=(lowest, highest),
        xtol=_CONVERGED,
        ftol=_CONVERGED,
        gtol=_CONVERGED,
    )
    solution = cast("FloatArray", found.x)  # pyright: ignore[reportUnknownMemberType] - scipy ships no types
    height, exponent, decay = np.pad(solution, (0, 3 - solution.size)).tolist()
    scale = height - exponent * math.log(largest)
    return SizeLaw(name=name, a=math.exp(scale), exponent=exponent, decay=decay / largest)


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
