"""A figure as numbers, and the two rules that compare the heights of two curves in it."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtri, stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from ..checks import CurveError, check_option
from ..curves import FloatArray

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
CONFIDENCE = 0.95
N_RESAMPLES = 1000
_SEED = 1
"""Seed of all draws; fixed, so that the same runs give the same answer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """Scores of several policies over the levels of an experiment: what one panel of a figure shows.

        Panel(levels=[1, 2], scores={"crw": [[3.0, 3.1], [4.0, 4.2]], "dpo": [[5.0, 5.1], [7.0, 6.8]]})

    Raises:
        CurveError: No policy, scores that do not match the levels or each other, levels that do not rise, or
            margins or a unit that are not positive.
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
        object.__setattr__(self, "levels", levels)
        object.__setattr__(self, "scores", finite)
        if self.unit is not None and not 0.0 < self.unit < np.inf:
            raise CurveError(f"Expected a positive unit, got {self.unit}.")
        if self.margins is not None:
            margins = np.asarray(self.margins, dtype=np.float64)
            if margins.shape != levels.shape or not (margins > 0.0).all():
                raise CurveError(f"Expected a positive margin per level, ({levels.size},), got {margins.tolist()}.")
            object.__setattr__(self, "margins", margins)

    @cached_property
    def scale(self) -> float:
        """`unit`, else the median over levels of the largest absolute mean of any policy; 1 if that is 0.

        A mean over levels would let one level at which one policy is far off make every other difference small.
        """
        if self.unit is not None:
            return self.unit
        means = np.abs([mean_over_runs(values) for values in self.scores.values()])
        known = np.isfinite(means)
        largest = np.where(known, means, 0.0).max(axis=0)[known.any(axis=0)]
        return (float(np.median(largest)) if largest.size else 0.0) or 1.0

    @property
    def tie_margins(self) -> FloatArray:
        """`margins`, by default `TIE` of the scale, (L,)."""
        return np.full(self.levels.shape, TIE * self.scale) if self.margins is None else self.margins

    def of(self, policies: Iterable[str]) -> FloatArray:
        """Return the scores of policies, (P, L, R).

        Raises:
            CurveError: A policy without scores.
        """
        names = list(policies)
        absent = [name for name in names if name not in self.scores]
        if absent:
            raise CurveError(f"Expected scores of {', '.join(absent)}, got those of {', '.join(self.scores)}.")
        return np.stack([self.scores[name] for name in names])

    def part(self, levels: Levels) -> "Panel":
        """Return the panel with some of its levels."""
        check_option("levels", levels, Levels)
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

    def runs_at_levels(self, policies: Iterable[str]) -> NDArray[np.int64]:
        """Return the number of runs with a score at each level, for the policy that has the fewest there, (L,)."""
        return np.isfinite(self.of(policies)).sum(axis=-1).min(axis=0)

    def n_runs(self, policies: Iterable[str]) -> int:
        """Return the smallest number of such runs at a level that has any; 0 if none has."""
        counts = self.runs_at_levels(policies)
        return int(counts[counts > 0].min()) if counts.any() else 0


def of_equal_runs(first: Panel, second: Panel, policies: Iterable[str]) -> tuple[Panel, Panel]:
    """Return two panels with equally many runs, the first ones that have all scores of these policies.

    Intervals narrow with the number of runs, so more runs alone would make more differences.
    """
    names = list(policies)
    complete = [np.flatnonzero(np.isfinite(panel.of(names)).all(axis=(0, 1))) for panel in (first, second)]
    n_runs = min(map(len, complete))
    a, b = (
        replace(panel, scores={name: panel.scores[name][:, runs[:n_runs]] for name in names})
        for panel, runs in zip((first, second), complete, strict=True)
    )
    return a, b


def judged_together(panels: Sequence[Panel], policies: Collection[str]) -> list[Panel]:
    """Return panels with the first runs that some policies have in all of them, and with the highest confidence.

    Policies and panels may have different numbers of runs; `n_runs_of` says how many.
    """
    several = [panel for panel in panels if panel.n_runs_of]
    if not several:
        return list(panels)
    n_runs = min(panel.n_runs_of.get(name, 0) for panel in several for name in policies or panel.scores)
    confidence = max(panel.confidence for panel in panels)
    return [
        replace(_with_runs(panel, n_runs) if panel.n_runs_of else panel, n_runs_of={}, confidence=confidence)
        for panel in panels
    ]


def _with_runs(panel: Panel, n_runs: int) -> Panel:
    def first(scores: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {name: values[..., :n_runs] for name, values in scores.items()}

    undisturbed = None if panel.undisturbed is None else first(panel.undisturbed)
    return replace(panel, scores=first(panel.scores), undisturbed=undisturbed)


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


def widening(n_runs: NDArray[np.int64], confidence: float = CONFIDENCE) -> FloatArray:
    """Factor that stretches the mean of resampled runs until its percentile interval is as wide as Student's.

    The mean of n resampled runs varies too little, by a factor of sqrt((n - 1) / n), and its percentiles treat the
    standard deviation of a few runs as the true one. The factor is 1.87 with four runs and 1.12 with sixteen.

    Args:
        n_runs: Number of runs in each mean.
        confidence: Confidence of Student's interval. Percentiles always use `CONFIDENCE`, so a thousand draws suffice.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # a single run
        students = stdtrit(n_runs - 1.0, 0.5 + 0.5 * confidence)
        return students / ndtri(0.5 + 0.5 * CONFIDENCE) * np.sqrt(n_runs / (n_runs - 1.0))


def complete_runs(values: FloatArray) -> FloatArray:
    """Return scores, (..., L, R), with NaN at each level in runs that lack one of the scores there."""
    known = np.isfinite(values)
    return np.where(known.all(axis=tuple(range(values.ndim - 2))), values, np.nan)


def resampled_runs(values: FloatArray) -> FloatArray:
    """Resample at each level the runs that have all scores there, with the same draws at all levels.

    Args:
        values: Scores, (..., L, R).

    Returns:
        (N_RESAMPLES, ..., L, R), padded with NaN at levels with fewer runs.
    """
    known = np.isfinite(complete_runs(values)).reshape(-1, *values.shape[-2:])[0]
    shares = np.random.default_rng(_SEED).random((N_RESAMPLES, values.shape[-1]))
    drawn = np.full((N_RESAMPLES, *values.shape), np.nan)
    for level, of_level in enumerate(known):
        runs = np.flatnonzero(of_level)
        if runs.size:
            places = runs[(shares[:, : runs.size] * runs.size).astype(np.int64)]
            drawn[..., level, : runs.size] = np.moveaxis(values[..., level, places], -2, 0)
    return drawn


def resampled_means(values: FloatArray, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Return means of scores (..., L, R) over runs, (..., L), and over resampled runs, (N_RESAMPLES, ..., L).

    `widening` stretches the distances of the resampled means from the means.
    """
    complete = complete_runs(values)
    found, drawn = mean_over_runs(complete), mean_over_runs(resampled_runs(values))
    return found, found + widening(np.isfinite(complete).sum(axis=-1), confidence) * (drawn - found)


def resampled_deviations(values: FloatArray, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations over runs and over resampled runs, corrected for their bias.

    The standard deviation of four normal numbers is 8 % too small on average, and that of n resampled ones smaller by
    another factor of sqrt((n - 1) / n). Resampled deviations are mirrored (the basic bootstrap): few runs show too
    small a deviation far more often than too large a one, so the true one lies on the other side.
    """
    complete = complete_runs(values)
    n_runs = np.isfinite(complete).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):  # a single run has no deviation
        share = np.sqrt(2.0 / (n_runs - 1.0)) * np.exp(gammaln(0.5 * n_runs) - gammaln(0.5 * n_runs - 0.5))
        drawn = std_over_runs(resampled_runs(values)) * np.sqrt(n_runs / (n_runs - 1.0)) / share
    found = std_over_runs(complete) / share
    return found, 2.0 * found - (found + widening(n_runs, confidence) * (drawn - found))


def bounds(resampled: FloatArray) -> tuple[float, float]:
    """Bounds of the percentile interval at `CONFIDENCE`."""
    lower, upper = np.quantile(resampled, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return float(lower), float(upper)


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
        ValueError: An unknown rule.
    """
    check_option("rule", rule, Rule)
    return np.array([_order(panel, pair, rule, n_tests) for pair in pairs])


def _order(panel: Panel, pair: tuple[str, str], rule: Rule, n_tests: int) -> FloatArray:
    first, second = panel.of(pair)
    if rule == "bands":
        gap = mean_over_runs(first) - mean_over_runs(second)
        reach = 2.0 * (std_over_runs(first) + std_over_runs(second))
        return np.where(np.isnan(gap + reach), np.nan, np.sign(gap) * (np.abs(gap) > reach))
    found = [
        _sign(a[np.isfinite(a)], b[np.isfinite(b)], margin, 1.0 - panel.confidence, n_tests)
        for a, b, margin in zip(first, second, panel.tie_margins, strict=True)
    ]
    return np.array(found)


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


def _sign(first: FloatArray, second: FloatArray, margin: float, alpha: float, n_tests: int) -> float:
    """Sign of the difference of two means, by the rule `intervals`; NaN where it is open."""
    # Two one-sided tests at 5 % each are an interval at 90 %.
    lower, upper = interval_of(first, second, 1.0 - 2.0 * alpha)
    if -margin <= lower and upper <= margin:
        return 0.0
    lower, upper = interval_of(first, second, 1.0 - alpha / n_tests)
    return 1.0 if lower > 0.0 else -1.0 if upper < 0.0 else np.nan
