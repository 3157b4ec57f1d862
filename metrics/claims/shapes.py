"""Rules about the shape of curves: where they begin to change, how steep and how straight they are; see `rules`."""

from dataclasses import replace
from math import inf

import numpy as np

from ..checks import CurveError
from ..curves import FloatArray
from .panel import CONFIDENCE, Panel, Rule, bounds, mean_over_runs, resampled_means, std_over_runs
from .rules import Answer, Names, Outcome, alone, of_curves

LINEAR = 0.9
"""Share of the variance between levels that a line explains if growth is nearly linear (our choice)."""
MIN_LEVELS = 4
"""A broken line needs two levels on either side of its bend, which may share one, and one more that tests it."""
ROUNDING = 1e-9
"""Share by which rounding may move a level from its place in the ladder."""
ZERO = "zero"
"""Name of the policy that `with_zero` adds."""


def rise_of(panel: Panel) -> Panel:
    """Return a panel of one level: the score at the last level less the score at the first, run by run."""
    return panel.reduced({name: values[-1] - values[0] for name, values in panel.scores.items()})


def slope_of(panel: Panel) -> Panel:
    """Return a panel of one level: the slope of the line through the scores of each run, times the span of levels."""
    return panel.reduced({name: _slope(panel, slice(None), values) for name, values in panel.scores.items()})


def bend_of(panel: Panel) -> Panel:
    """Return a panel of one level: how much steeper the upper half of the levels is than the lower, run by run.

    Both slopes are multiplied by the span of all levels; the middle one of an odd number of levels is in both halves.

    Raises:
        CurveError: Fewer than three levels.
    """
    if panel.levels.size < 3:
        raise CurveError(f"Expected three or more levels for a bend, got {panel.levels.size}.")
    half = (panel.levels.size + 1) // 2
    upper, lower = slice(panel.levels.size - half, None), slice(None, half)
    return panel.reduced({name: _slope(panel, upper, v) - _slope(panel, lower, v) for name, v in panel.scores.items()})


def _slope(panel: Panel, kept: slice, values: FloatArray) -> FloatArray:
    """Slope of the line through some levels of each run, times the span of all levels, (R,)."""
    x = panel.levels[kept] - panel.levels[kept].mean()
    span = panel.levels[-1] - panel.levels[0]
    return span * (x @ values[kept]) / (x @ x)


def with_zero(panel: Panel) -> Panel:
    """Return the panel with a further policy `zero` that always scores 0, for comparison."""
    first = next(iter(panel.scores.values()))
    return replace(panel, scores={**panel.scores, ZERO: np.zeros_like(first)})


def from_undisturbed(panel: Panel) -> Panel:
    """Return the panel with a level 0 before the others if it has scores of undisturbed swarms, else as it is."""
    if panel.undisturbed is None:
        return panel
    scores = {name: np.vstack([panel.undisturbed[name], values]) for name, values in panel.scores.items()}
    margins, levels = (np.concatenate([[first], of]) for first, of in
                       ((panel.tie_margins[0], panel.tie_margins), (0.0, panel.levels)))  # fmt: skip
    return replace(panel, levels=levels, scores=scores, margins=margins, undisturbed=None)


# ------------------------------------------------------------------------------------------------------ single curves


def is_linear(panel: Panel, *, policies: Names, rule: Rule = "intervals") -> Outcome:
    """Whether each policy grows nearly linearly with the level.

    A rising line explains `LINEAR` of the variance between the means; by intervals, with its interval. Contradicted if
    it explains less, or surely rises by less than a tie over all levels. By bands, the rule looks at the means alone,
    however little they rise. If no two levels have bands that are apart, no growth is visible: undecided.
    """

    def judge(part: Panel, scores: FloatArray, names: Names) -> Outcome:
        (values,), (policy,) = scores, names
        means, drawn = resampled_means(values, part.confidence)
        rest, total, rise = (float(one[0]) for one in _line(part.levels, means[None]))
        explained, rise = 1.0 - rest / total if total > 0.0 else 0.0, rise / part.scale
        if rule == "bands":
            reach = 2.0 * std_over_runs(values)
            is_seen = float((means - reach).max()) > float((means + reach).min())
            is_line = explained >= LINEAR and rise > 0.0
            answer: Answer = "undecided" if not is_seen else "supported" if is_line else "contradicted"
            words = "" if is_seen else f"no two bands of {policy} are apart; "
        else:
            rests, totals, _ = (np.quantile(one, CONFIDENCE) for one in _line(part.levels, drawn - means))
            lower, upper = bounds(_line(part.levels, drawn)[2] / part.scale)
            # Square roots of sums of squares are lengths: what chance adds changes them by its own length at most.
            most = _ratio(rest**0.5 + rests**0.5, total**0.5 - totals**0.5)
            least = _ratio(rest**0.5 - rests**0.5, total**0.5 + totals**0.5)
            answer = "supported" if 1.0 - most >= LINEAR and lower > 0.0 else "undecided"
            answer = "contradicted" if 1.0 - least < LINEAR or upper <= part.tie else answer
            words = f"{1.0 - most:.2f} to {1.0 - least:.2f} with its interval; "
        why = f"a line explains {explained:.2f} of the variance of {policy} ({words}{LINEAR:g} is nearly linear)"
        why = f"{why} and rises by {rise:.2f} of the scale" + ("" if rise > 0.0 else ": it does not grow")
        return Outcome(answer, explained, rise, why=why)

    return of_curves(panel, alone(policies), rule, judge)


def _ratio(above: float, below: float) -> float:
    """Square of the ratio of two lengths, from 0 to 1; a length below 0 counts as 0."""
    return min(1.0, (max(0.0, above) / below) ** 2) if below > 0.0 else 1.0


def _line(levels: FloatArray, means: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit lines to curves (B, L): residual sum of squares, total sum of squares, and rise over the span; (B,) each."""
    x, y = levels - levels.mean(), means - means.mean(axis=1, keepdims=True)
    slope = y @ x / (x @ x)
    total = (y**2).sum(axis=1)
    return np.maximum(0.0, total - slope**2 * (x @ x)), total, slope * (levels[-1] - levels[0])


def changes_within(panel: Panel, *, policies: Names, between: tuple[float, float], rule: Rule = "intervals") -> Outcome:
    """Whether the behaviour of each policy begins to change at a level between two values, both included.

    By intervals: the rule fits two lines that meet at one of the inner levels to the means. The change must be real
    (the interval of the change of slope leaves out 0), and 95 % of the resamples must have the bend between the two
    values. Contradicted if at most 5 % have it there, or if the slope changes by less than a tie. By bands: the first
    level whose band does not overlap the band of the lowest one lies between the values.

    If the levels cannot locate a real change, the answer is undecided. To support the statement, a bend must have been
    possible at a level below the two values and at one above; to contradict it, at one between them. If the first level
    is 0, undisturbed, no level below is needed: a curve that changes from there on is a straight line without a bend.
    """
    low, high = between[0] * (1.0 - ROUNDING), between[1] * (1.0 + ROUNDING)

    def judge(part: Panel, _: FloatArray, names: Names) -> Outcome:
        (policy,) = names
        if rule == "bands":
            onset = _onset(part, policy)
            if onset == inf:
                return Outcome("contradicted", onset, why=f"band of {policy} never leaves that of the first level")
            answer, reason = _located(float(low <= onset <= high), part.levels, part.levels[1:], (low, high))
            return Outcome(answer, onset, why=f"band of {policy} leaves that of the first level at {onset:.3g}{reason}")
        if part.levels.size < MIN_LEVELS:
            return _too_few(part, names)
        places, change, chance = _bends(part, policy)
        middle, inside = float(np.median(places)), float(((places >= low) & (places <= high)).mean())
        why = f"slope of {policy} changes by {change:.2f} of the scale, by chance alone up to {chance:.2f}"
        answer = "undecided"
        if abs(change) + chance <= part.tie:
            answer, why = "contradicted", f"{why}: no change, {part.tie:.2g} would be one"
        elif abs(change) > chance:
            answer, reason = _located(inside, part.levels, part.levels[1:-1], (low, high))
            where = f"in {inside:.0%} of the resamples between {between[0]:.3g} and {between[1]:.3g}"
            why = f"slope of {policy} changes at {middle:.3g}, {where}{reason}"
        return Outcome(answer, middle, change, why=why)

    return of_curves(panel, alone(policies), rule, judge)


def changes_before(panel: Panel, *, first: str, others: Names, rule: Rule = "intervals") -> Outcome:
    """Whether a policy changes at a lower level than each of others; `changes_within` says where a policy changes.

    Undecided if one of the two does not surely change.
    """

    def judge(part: Panel, _: FloatArray, names: Names) -> Outcome:
        if rule == "bands":
            mine, theirs = (_onset(part, name) for name in names)
            if inf in (mine, theirs):
                still = [name for name, onset in zip(names, (mine, theirs), strict=True) if onset == inf]
                return Outcome("undecided", mine, why=f"bands of {' and '.join(still)} never leave the first level's")
            why = f"band of {first} leaves that of the first level at {mine:.3g}, that of {names[1]} at {theirs:.3g}"
            return Outcome("supported" if mine < theirs else "contradicted", mine, why=why)
        if part.levels.size < MIN_LEVELS:
            return _too_few(part, names)
        bends = {name: _bends(part, name) for name in names}
        mine, theirs = (bends[name][0] for name in names)
        before = float((mine < theirs).mean())
        if unsure := [name for name, (_, change, chance) in bends.items() if abs(change) <= chance]:
            return Outcome("undecided", before, why=f"no change of {' and '.join(unsure)} that chance could not make")
        return Outcome(
            _mostly(before), before, why=f"{first} changes before {names[1]} in {before:.0%} of the resamples"
        )

    return of_curves(panel, [(first, other) for other in others], rule, judge)


def _mostly(share: float) -> Answer:
    """Whether a share of resamples is surely most or surely few of them."""
    return "supported" if share >= CONFIDENCE else "contradicted" if share <= 1.0 - CONFIDENCE else "undecided"


def broken_line(levels: FloatArray, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit two lines that meet at an inner level, by least squares.

    Args:
        levels: Rising values, (L,), L >= `MIN_LEVELS`.
        means: Curves, (B, L).

    Returns:
        Level of the bend and change of the slope there, (B,) each.
    """
    rests: list[FloatArray] = []
    changes: list[FloatArray] = []
    for bend in levels[1:-1]:
        terms = np.stack([np.ones_like(levels), levels, np.maximum(0.0, levels - bend)], axis=1)
        fitted = means @ np.linalg.pinv(terms).T
        rests.append(((means - fitted @ terms.T) ** 2).sum(axis=1))
        changes.append(fitted[:, 2])
    best = np.argmin(rests, axis=0)
    return levels[1:-1][best], np.array(changes)[best, np.arange(best.size)]


def _onset(panel: Panel, policy: str) -> float:
    """Lowest level whose band does not overlap the band of the first level; infinite if there is none."""
    (values,) = panel.of((policy,))
    means, deviations = mean_over_runs(values), std_over_runs(values)
    apart = np.abs(means - means[0]) > 2.0 * (deviations + deviations[0])
    return float(panel.levels[apart][0]) if apart.any() else inf


def _bends(panel: Panel, policy: str) -> tuple[FloatArray, float, float]:
    """Return where the mean curve of a policy bends, and how much.

    Returns:
        Level of the bend in each resample, (B,); change of the slope, times the span of levels, as a share of the
        scale; and the part of it that chance may have added, at `CONFIDENCE`.
    """
    (values,) = panel.of((policy,))
    means, drawn = resampled_means(values, panel.confidence)
    unit = (panel.levels[-1] - panel.levels[0]) / panel.scale
    _, change = broken_line(panel.levels, means[None])
    places, _ = broken_line(panel.levels, drawn)
    # The bend is put where it fits best, so chance may add what it adds at its best place.
    _, by_chance = broken_line(panel.levels, drawn - means)
    return places, float(change[0]) * unit, float(np.quantile(np.abs(by_chance), CONFIDENCE)) * unit


def _too_few(panel: Panel, policies: Names) -> Outcome:
    why = f"{panel.levels.size} levels of {' and '.join(policies)}, {MIN_LEVELS} are needed for a bend"
    return Outcome("undecided", why=why)


def _located(
    share: float, levels: FloatArray, possible: FloatArray, between: tuple[float, float]
) -> tuple[Answer, str]:
    """Return whether a change lies between two values, or undecided and why if the levels cannot show it.

    Args:
        share: Of the resamples that have it there.
        levels: Of the panel, (L,).
        possible: Those at which a change could be seen.
        between: The two values.
    """
    low, high = between
    answer, where = _mostly(share), f"{low:.3g} to {high:.3g}"
    if answer == "contradicted" and not ((possible >= low) & (possible <= high)).any():
        return "undecided", f"; no level that was run could show a change at {where}"
    has_below, has_above = bool((possible < low).any()) or levels[0] == 0.0, bool((possible > high).any())
    lacking = [word for word, has in (("below", has_below), ("above", has_above)) if not has]
    if answer == "supported" and lacking:
        return "undecided", f"; no level that was run could show a change {' or '.join(lacking)} {where}"
    return answer, ""
