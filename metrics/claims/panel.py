"""A figure as numbers, and the two rules that compare the heights of two curves in it."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtri, stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from ..checks import CurveError
from ..curves import FloatArray
from ..statistics import CONFIDENCE

Rule: TypeAlias = Literal["intervals", "bands"]
"""`bands` is the paper's rule. The band of a curve is its mean plus and minus two standard deviations of single runs.
Two curves tie where their bands overlap, and differ where they do not. `intervals` is our rule. It tests the difference
of means with Welch's t: the curves tie where two one-sided tests find the difference within the margin of the panel
(Schuirmann 1987), differ where its 95 % interval leaves out zero, and the question is open elsewhere."""
Levels: TypeAlias = Literal["all", "low", "high"]
"""All levels of a panel, or its lower or upper half; the middle one of an odd number is in neither half."""

TIE = 0.1
"""Margin of a tie, as a share of the scale, for panels without margins (our choice: such curves look alike in a figure;
with many runs, even the smallest difference is significant)."""
MANY = 0.5
"""A statement holds at most levels if it holds at more than this share."""
MIN_RUNS = 4
"""Runs that `intervals` needs to decide (our choice: the deviation of three runs is too often wrong by half)."""
LEAST_RUNS: dict[Rule, int] = {"intervals": MIN_RUNS, "bands": 2}
"""Runs that a level needs to be judged by each rule."""
N_RESAMPLES = 1000
_SEED = 1
"""Seed of all draws; fixed, so that the same runs give the same answer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """Scores of several policies over the levels of an experiment: what one panel of a figure shows.

        Panel(levels=[1, 2], scores={"crw": [[3.0, 3.1], [4.0, 4.2]], "dpo": [[5.0, 5.1], [7.0, 6.8]]})

    Raises:
        CurveError: No policy, scores that do not match the levels or each other, or levels that do not rise.
    """

    levels: FloatArray
    """Rising values of what the experiment varies, (L,)."""
    scores: Mapping[str, FloatArray]
    """Policy -> one score per level and run, (L, R). NaN and infinite values are runs without a score."""
    margins: FloatArray | None = None
    """Largest difference that is a tie at each level, (L,), in the unit of the scores. None: `TIE` of the scale. A
    margin in the measure's own unit lets curves near zero tie, too."""
    undisturbed: Mapping[str, FloatArray] | None = None
    """Policy -> scores without any disturbance, (R,). They are not a level; see `shapes.from_undisturbed`."""
    unit: float | None = None
    """Number by which the rules divide scores to get shares, for example 1 for scalability. None: `scale`."""
    n_runs_of: Mapping[str, int] = field(default_factory=dict[str, int])
    """Policy -> how many first runs it has everywhere, where that differs between policies; see `judged_together`."""
    confidence: float = CONFIDENCE
    """Confidence of intervals."""

    def __post_init__(self) -> None:
        levels = np.asarray(self.levels, dtype=np.float64)
        if levels.ndim != 1 or levels.size == 0 or not (np.diff(levels) > 0.0).all():
            raise CurveError(f"Expected levels in rising order, (L,), got {levels.tolist()}.")
        scores = {name: np.asarray(values, dtype=np.float64) for name, values in self.scores.items()}
        shapes = {name: values.shape for name, values in scores.items()}
        if len(set(shapes.values())) != 1 or any(len(s) != 2 or s[0] != levels.size for s in shapes.values()):
            raise CurveError(
                f"Expected scores of shape ({levels.size} levels, runs), the same for all policies, got {shapes}; mark "
                "a missing run with NaN."
            )
        finite = {name: np.where(np.isfinite(values), values, np.nan) for name, values in scores.items()}
        margins = None if self.margins is None else np.asarray(self.margins, dtype=np.float64)
        for name, value in {"levels": levels, "scores": finite, "margins": margins}.items():
            object.__setattr__(self, name, value)

    @cached_property
    def scale(self) -> float:
        """`unit`, else the median over levels of the largest absolute mean of any policy; 1 if that is 0.

        A mean over levels would let one level at which one policy is far off make every other difference small.
        """
        if self.unit is not None:
            return self.unit
        means = np.abs([mean_over_runs(values) for values in self.scores.values()])
        largest = np.fmax.reduce(means, axis=0)
        known = largest[np.isfinite(largest)]
        return (float(np.median(known)) if known.size else 0.0) or 1.0

    @property
    def tie_margins(self) -> FloatArray:
        """`margins`, by default `TIE` of the scale, (L,)."""
        return np.full(self.levels.shape, TIE * self.scale) if self.margins is None else self.margins

    @property
    def tie(self) -> float:
        """Margin of a tie, mean of levels, as a share of the scale."""
        return float(self.tie_margins.mean()) / self.scale

    def of(self, policies: Iterable[str]) -> FloatArray:
        """Return the scores of policies, (P, L, R); CurveError names those without scores."""
        names = list(policies)
        absent = [name for name in names if name not in self.scores]
        if absent:
            raise CurveError(f"Expected scores of {', '.join(absent)}, got those of {', '.join(self.scores)}.")
        return np.stack([self.scores[name] for name in names])

    def part(self, levels: Levels) -> "Panel":
        """Return the panel with some of its levels."""
        half = max(1, self.levels.size // 2)
        place = np.arange(self.levels.size)
        return self.at({"all": place >= 0, "low": place < half, "high": place >= self.levels.size - half}[levels])

    def at(self, kept: NDArray[np.bool_]) -> "Panel":
        """Return the panel with the levels of a mask, (L,); it keeps the scale of the whole panel."""
        scores = {name: values[kept] for name, values in self.scores.items()}
        margins, unit = self.tie_margins[kept], self.scale
        return replace(self, levels=self.levels[kept], scores=scores, margins=margins, unit=unit, undisturbed=None)

    def reduced(self, scores: Mapping[str, FloatArray]) -> "Panel":
        """Return a panel of one level, the last, with other scores, (R,) per policy, and the mean margin."""
        rows = {name: values[None] for name, values in scores.items()}
        margins = self.tie_margins.mean(keepdims=True)
        return replace(self, levels=self.levels[-1:], scores=rows, margins=margins, unit=None, undisturbed=None)

    def first_runs(self, n_runs: int) -> "Panel":
        """Return the panel with so many first runs."""
        scores, undisturbed = (
            None if of is None else {name: values[..., :n_runs] for name, values in of.items()}
            for of in (self.scores, self.undisturbed)
        )
        return replace(self, scores=scores or {}, undisturbed=undisturbed)

    def runs_at_levels(self, policies: Iterable[str]) -> NDArray[np.int64]:
        """Return the number of runs with a score at each level, for the policy that has the fewest there, (L,)."""
        return np.isfinite(self.of(policies)).sum(axis=-1).min(axis=0)

    def n_runs(self, policies: Iterable[str]) -> int:
        """Return the smallest number of such runs at a level that has any; 0 if none has."""
        counts = self.runs_at_levels(policies)
        return int(counts[counts > 0].min()) if counts.any() else 0


def judged_together(panels: Sequence[Panel], policies: Collection[str]) -> list[Panel]:
    """Return panels with the first runs that some policies have in all of them, and with the highest confidence.

    Policies and panels may have different numbers of runs; `n_runs_of` says how many.
    """
    several = [panel for panel in panels if panel.n_runs_of]
    if not several:
        return list(panels)
    n_runs = min(panel.n_runs_of.get(name, 0) for panel in several for name in policies or panel.scores)
    confidence = max(panel.confidence for panel in panels)
    cut = [panel.first_runs(n_runs) if panel.n_runs_of else panel for panel in panels]
    return [replace(panel, n_runs_of={}, confidence=confidence) for panel in cut]


# ------------------------------------------------------------------------------------------- which curve is higher


def order(panel: Panel, pairs: Iterable[tuple[str, str]], rule: Rule, n_tests: int = 1) -> FloatArray:
    """Which policy of each pair is higher at each level: 1 the first, -1 the second, 0 a tie, NaN open; (pairs, L).

    Args:
        panel: The scores.
        pairs: Of policies.
        rule: The rule that compares them.
        n_tests: Number of tests that together are wrong by chance once in twenty times (Bonferroni); does not affect
            ties.

    Raises:
        CurveError: A policy without scores.
    """
    return np.array([_by_bands(*panel.of(pair)) if rule == "bands" else _by_intervals(panel, pair, n_tests)
                     for pair in pairs])  # fmt: skip


def _by_bands(first: FloatArray, second: FloatArray) -> FloatArray:
    gap = mean_over_runs(first) - mean_over_runs(second)
    reach = 2.0 * (std_over_runs(first) + std_over_runs(second))
    return np.where(np.isnan(gap + reach), np.nan, np.sign(gap) * (np.abs(gap) > reach))


def _by_intervals(panel: Panel, pair: tuple[str, str], n_tests: int) -> FloatArray:
    alpha = 1.0 - panel.confidence
    # Two one-sided tests at 5 % each are an interval at 90 %.
    lower, upper = intervals_of(panel, pair, 1.0 - 2.0 * alpha).T
    is_tie = (-panel.tie_margins <= lower) & (upper <= panel.tie_margins)
    lower, upper = intervals_of(panel, pair, 1.0 - alpha / n_tests).T
    return np.where(is_tie, 0.0, np.where(lower > 0.0, 1.0, np.where(upper < 0.0, -1.0, np.nan)))


def intervals_of(panel: Panel, pair: tuple[str, str], confidence: float) -> FloatArray:
    """Return the bounds of `interval_of` at each level, (L, 2)."""
    runs = zip(*panel.of(pair), strict=True)
    return np.array([interval_of(x[np.isfinite(x)], y[np.isfinite(y)], confidence) for x, y in runs])


def interval_of(first: FloatArray, second: FloatArray, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Bounds of Welch's interval of the difference of two means; NaN if either has fewer than `MIN_RUNS` runs.

    If all runs of a policy score the same, for both policies, Welch's t does not have a scatter to compare with. Then
    the bounds are the difference itself if the sign test shows for both that most runs have this score (at 95 %, six
    runs each), else NaN.

    Runs are not paired by seed: common seeds correlate scores by 0.04 to 0.15 only, and pairing costs half of the
    degrees of freedom.

    Args:
        first: Scores of runs, (R1,), all finite.
        second: Scores of the other policy, (R2,), all finite.
        confidence: Confidence of the interval.
    """
    if min(first.size, second.size) < MIN_RUNS:
        return np.nan, np.nan
    gap = float(first.mean() - second.mean())
    parts = np.array([values.var(ddof=1) / values.size for values in (first, second)])
    variance = float(parts.sum())
    if variance == 0.0:
        by_chance = MANY**first.size + MANY**second.size
        return (gap, gap) if by_chance <= 1.0 - confidence else (np.nan, np.nan)
    freedom = variance**2 / float((parts**2 / (np.array([first.size, second.size]) - 1.0)).sum())
    half = float(stdtrit(freedom, 0.5 + 0.5 * confidence)) * variance**0.5
    return gap - half, gap + half


# ---------------------------------------------------------------------------------- means, deviations, and resampled


def mean_over_runs(values: FloatArray) -> FloatArray:
    """Mean over the last axis without NaN; NaN where nothing is left."""
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.where(known, values, 0.0).sum(axis=-1) / known.sum(axis=-1)


def std_over_runs(values: FloatArray) -> FloatArray:
    """Standard deviation over the last axis without NaN, divisor R - 1; NaN for fewer than two runs."""
    known = np.isfinite(values)
    squares = np.where(known, values - mean_over_runs(values)[..., None], 0.0) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(squares.sum(axis=-1) / (known.sum(axis=-1) - 1.0))


def _resampled(values: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray, NDArray[np.int64], FloatArray]:
    """Resample at each level the runs that have all scores there, with the same draws at all levels.

    Args:
        values: Scores, (..., L, R).
        confidence: Of Student's interval. Percentiles always use `CONFIDENCE`, so a thousand draws suffice.

    Returns:
        The scores, NaN at each level in runs that lack one of the scores there; resampled ones, (N_RESAMPLES, ..., L,
        R), padded with NaN; the number of runs at each level, (L,); and the factor that stretches the mean of resampled
        runs until its percentile interval is as wide as Student's, (L,). That mean varies too little, by a factor of
        sqrt((n - 1) / n), and its percentiles treat the standard deviation of a few runs as the true one. The factor is
        1.87 with four runs and 1.12 with sixteen.
    """
    known: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=tuple(range(values.ndim - 2))))
    shares = np.random.default_rng(_SEED).random((N_RESAMPLES, values.shape[-1]))
    drawn = np.full((N_RESAMPLES, *values.shape), np.nan)
    for level, of_level in enumerate(known):
        runs = np.flatnonzero(of_level)
        if runs.size:
            places = runs[(shares[:, : runs.size] * runs.size).astype(np.int64)]
            drawn[..., level, : runs.size] = np.moveaxis(values[..., level, places], -2, 0)
    n_runs = known.sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):  # a single run
        students = stdtrit(n_runs - 1.0, 0.5 + 0.5 * confidence)
        widening = students / ndtri(0.5 + 0.5 * CONFIDENCE) * np.sqrt(n_runs / (n_runs - 1.0))
    return np.where(known, values, np.nan), drawn, n_runs, widening


def resampled_means(values: FloatArray, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Return means of scores (..., L, R) over runs, (..., L), and over resampled runs, (N_RESAMPLES, ..., L)."""
    complete, resampled, _, widening = _resampled(values, confidence)
    found, drawn = mean_over_runs(complete), mean_over_runs(resampled)
    return found, found + widening * (drawn - found)


def resampled_deviations(values: FloatArray, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations over runs and over resampled runs, corrected for their bias.

    The standard deviation of four normal numbers is 8 % too small on average, and that of n resampled ones smaller by
    another factor of sqrt((n - 1) / n). Resampled deviations are mirrored (the basic bootstrap): few runs show too
    small a deviation far more often than too large a one, so the true one lies on the other side.
    """
    complete, resampled, n_runs, widening = _resampled(values, confidence)
    with np.errstate(divide="ignore", invalid="ignore"):  # a single run has no deviation
        share = np.sqrt(2.0 / (n_runs - 1.0)) * np.exp(gammaln(0.5 * n_runs) - gammaln(0.5 * n_runs - 0.5))
        drawn = std_over_runs(resampled) * np.sqrt(n_runs / (n_runs - 1.0)) / share
    found = std_over_runs(complete) / share
    return found, 2.0 * found - (found + widening * (drawn - found))


def bounds(resampled: FloatArray) -> tuple[float, float]:
    """Bounds of the percentile interval at `CONFIDENCE`."""
    lower, upper = np.quantile(resampled, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return float(lower), float(upper)
