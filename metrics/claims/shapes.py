"""Statements about the shape of curves: from where on they change, how steep and how straight they are, their order."""

from collections.abc import Mapping, Sequence

import numpy as np

from metrics.checks import CurveError, check_option
from metrics.curves import FloatArray

from .panel import CONFIDENCE, TIE, Panel, Rule, bounds, mean_over_runs, resampled_runs, std_over_runs
from .predicates import LINEAR, Answer, Outcome, all_of, contrary

ZERO = "zero"
"""Name of the policy that `with_zero` adds."""
MIN_LEVELS = 4
"""A broken line needs two levels on either side of its bend, which may share one, and one more to be judged by."""


def rise_of(panel: Panel) -> Panel:
    """Return a panel of one level: the score at the last level less that at the first, run by run."""
    return _reduced(panel, {name: values[-1] - values[0] for name, values in panel.scores.items()})


def slope_of(panel: Panel) -> Panel:
    """Return a panel of one level: the slope of the line through the scores of each run, times the span of levels."""
    x = panel.levels - panel.levels.mean()
    span = panel.levels[-1] - panel.levels[0]
    return _reduced(panel, {name: span * (x @ values) / (x @ x) for name, values in panel.scores.items()})


def bend_of(panel: Panel) -> Panel:
    """Return a panel of one level: how much steeper the upper half of the levels is than the lower, run by run.

    Both slopes are multiplied by the span of all levels; of an odd number the middle level belongs to both halves.

    Raises:
        CurveError: Fewer than three levels.
    """
    half = (panel.levels.size + 1) // 2
    if panel.levels.size < 3:
        raise CurveError(f"Expected three or more levels for a bend, got {panel.levels.size}.")
    span = panel.levels[-1] - panel.levels[0]

    def slope(kept: slice, values: FloatArray) -> FloatArray:
        x = panel.levels[kept] - panel.levels[kept].mean()
        return span * (x @ values[kept]) / (x @ x)

    upper, lower = slice(panel.levels.size - half, None), slice(None, half)
    return _reduced(panel, {name: slope(upper, v) - slope(lower, v) for name, v in panel.scores.items()})


def with_zero(panel: Panel) -> Panel:
    """Return the panel with a policy `zero` that always scores 0, to hold others against."""
    first = next(iter(panel.scores.values()))
    return Panel(levels=panel.levels, scores={**panel.scores, ZERO: np.zeros_like(first)})


def _reduced(panel: Panel, scores: Mapping[str, FloatArray]) -> Panel:
    return Panel(levels=panel.levels[-1:], scores={name: values[None] for name, values in scores.items()})


def changes_within(
    panel: Panel, *, policies: Sequence[str], between: tuple[float, float], rule: Rule = "intervals"
) -> Outcome:
    """Whether each policy changes its behaviour from a level between two values on.

    By intervals: two lines that meet at one of the inner levels are fitted to the means. The change must be real (the
    slope differs before and after, with its interval), and 95 % of the resamples must have the bend between the two
    values; it is contradicted if at most 5 % have it there, or if the slope changes by less than `TIE`. By bands: the
    first level whose band does not overlap that of the first level lies between the values.
    """
    return all_of([_change(panel, policy, between, rule) for policy in policies])


def changes_before(panel: Panel, *, first: str, others: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether a policy changes at a lower level than each of others; where each changes is as in `changes_within`."""
    return all_of([_earlier(panel, first, other, rule) for other in others])


def is_linear(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether each policy grows nearly linearly with the level.

    A rising line explains `LINEAR` of the variance between the means; by intervals with its interval, by bands alone.
    """
    return all_of([_straightness(panel, policy, rule) for policy in policies])


def same_order(
    first: Panel,
    second: Panel,
    *,
    policies: Sequence[str],
    better: tuple[int, int] = (1, 1),
    rule: Rule = "intervals",
) -> Outcome:
    """Whether policies have the same order in two panels: Kendall's tau of their mean ranks over levels is above 0.

    By intervals: its interval over resampled runs is above 0, contradicted if none of it is. By bands: the tau itself
    is above 0.5, contradicted if it is at most 0.

    Args:
        first: One panel.
        second: The other; levels and runs may differ.
        policies: Policies to order, two or more.
        better: 1 or -1 for each panel: whether higher or lower is better there.
        rule: As everywhere.
    """
    check_option("rule", rule, Rule)
    panels = [panel.of(policies) * side for panel, side in zip((first, second), better, strict=True)]
    tau = float(_tau(*(_mean_ranks(mean_over_runs(values)) for values in panels)))
    drawn = [resampled_runs(values) for values in panels]
    n_runs = min(first.n_runs(policies), second.n_runs(policies))
    answer: Answer = "undecided"
    if rule == "bands" and n_runs > 1:
        answer = "supported" if tau > 0.5 else "contradicted" if tau <= 0.0 else "undecided"
    elif rule == "intervals" and drawn[0] is not None and drawn[1] is not None:
        resampled = _tau(*(_mean_ranks(mean_over_runs(values)) for values in drawn if values is not None))
        lower, upper = bounds(resampled)
        answer = "supported" if lower > 0.0 else "contradicted" if upper <= 0.0 else "undecided"
    why = f"Kendall's tau of the two orders is {tau:.2f}"
    return Outcome(answer=answer, statistic=tau, effect=np.nan, n_runs=n_runs, why=why)


def not_same_order(
    first: Panel,
    second: Panel,
    *,
    policies: Sequence[str],
    better: tuple[int, int] = (1, 1),
    rule: Rule = "intervals",
) -> Outcome:
    """Whether the order in one panel says nothing of that in the other; the contrary of `same_order`."""
    return contrary(same_order(first, second, policies=policies, better=better, rule=rule))


def broken_line(levels: FloatArray, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit two lines that meet at an inner level, by least squares.

    Args:
        levels: Rising, (L,), L >= `MIN_LEVELS`.
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
    """First level whose band does not overlap that of the first level; infinite if none."""
    (values,) = panel.of((policy,))
    means, deviations = mean_over_runs(values), std_over_runs(values)
    apart = np.abs(means - means[0]) > 2.0 * (deviations + deviations[0])
    return float(panel.levels[apart][0]) if apart.any() else np.inf


def _bends(panel: Panel, policy: str) -> tuple[FloatArray, FloatArray] | None:
    """Bends and changes of slope over the span, as shares of the scale, of resampled curves; None: too few levels."""
    (values,) = panel.of((policy,))
    drawn = resampled_runs(values)
    if drawn is None or panel.levels.size < MIN_LEVELS:
        return None
    bends, changes = broken_line(panel.levels, mean_over_runs(drawn))
    return bends, changes * (panel.levels[-1] - panel.levels[0]) / panel.scale


def _change(panel: Panel, policy: str, between: tuple[float, float], rule: Rule) -> Outcome:
    check_option("rule", rule, Rule)
    n_runs = panel.n_runs((policy,))
    low, high = between
    if rule == "bands":
        onset = _onset(panel, policy)
        answer: Answer = "undecided" if n_runs < 2 else "supported" if low <= onset <= high else "contradicted"
        why = f"band of {policy} leaves that of the first level at {onset:.3g}"
        return Outcome(answer=answer, statistic=onset, effect=np.nan, n_runs=n_runs, why=why)
    found = _bends(panel, policy)
    if found is None:
        why = f"too few levels or runs of {policy}"
        return Outcome(answer="undecided", statistic=np.nan, effect=np.nan, n_runs=n_runs, why=why)
    bends, changes = found
    inside = float(((bends >= low) & (bends <= high)).mean())
    lower, upper = bounds(changes)
    if lower >= -TIE and upper <= TIE:
        answer = "contradicted"
    elif lower <= 0.0 <= upper:
        answer = "undecided"
    else:
        answer = "supported" if inside >= CONFIDENCE else "contradicted" if inside <= 1.0 - CONFIDENCE else "undecided"
    middle, effect = float(np.median(bends)), float(np.median(changes))
    why = f"slope of {policy} changes at {middle:.3g}, in {inside:.0%} of the resamples between {low:g} and {high:g}"
    return Outcome(answer=answer, statistic=middle, effect=effect, n_runs=n_runs, why=why)


def _earlier(panel: Panel, first: str, second: str, rule: Rule) -> Outcome:
    check_option("rule", rule, Rule)
    n_runs = panel.n_runs((first, second))
    answer: Answer = "undecided"
    if rule == "bands":
        onsets = _onset(panel, first), _onset(panel, second)
        if n_runs > 1:
            answer = "supported" if onsets[0] < onsets[1] else "contradicted"
        why = f"band of {first} leaves that of the first level at {onsets[0]:.3g}, that of {second} at {onsets[1]:.3g}"
        return Outcome(answer=answer, statistic=onsets[0], effect=np.nan, n_runs=n_runs, why=why)
    mine, theirs = _bends(panel, first), _bends(panel, second)
    if mine is None or theirs is None:
        why = f"too few levels or runs of {first} or {second}"
        return Outcome(answer=answer, statistic=np.nan, effect=np.nan, n_runs=n_runs, why=why)
    before = float((mine[0] < theirs[0]).mean())
    answer = "supported" if before >= CONFIDENCE else "contradicted" if before <= 1.0 - CONFIDENCE else "undecided"
    why = f"{first} changes before {second} in {before:.0%} of the resamples"
    return Outcome(answer=answer, statistic=before, effect=np.nan, n_runs=n_runs, why=why)


def _straightness(panel: Panel, policy: str, rule: Rule) -> Outcome:
    check_option("rule", rule, Rule)
    (values,) = panel.of((policy,))
    explained, rise = _line(panel.levels, mean_over_runs(values)[None])
    n_runs = panel.n_runs((policy,))
    answer: Answer = "undecided"
    if rule == "bands" and n_runs > 1:
        answer = "supported" if explained[0] >= LINEAR and rise[0] > 0.0 else "contradicted"
    elif rule == "intervals" and (drawn := resampled_runs(values)) is not None:
        share, rises = _line(panel.levels, mean_over_runs(drawn))
        (low, high), (flattest, steepest) = bounds(share), bounds(rises)
        answer = "supported" if low >= LINEAR and flattest > 0.0 else "undecided"
        if high < LINEAR or steepest <= 0.0:
            answer = "contradicted"
    why = f"a line explains {explained[0]:.2f} of the variance of {policy}"
    return Outcome(
        answer=answer, statistic=float(explained[0]), effect=float(rise[0]) / panel.scale, n_runs=n_runs, why=why
    )


def _line(levels: FloatArray, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Share of variance that a line explains, and its rise over the span, of curves (B, L); (B,) each."""
    x, y = levels - levels.mean(), means - means.mean(axis=1, keepdims=True)
    slope = y @ x / (x @ x)
    with np.errstate(divide="ignore", invalid="ignore"):  # a curve without any variance
        return slope**2 * (x @ x) / (y**2).sum(axis=1), slope * (levels[-1] - levels[0])


def _mean_ranks(means: FloatArray) -> FloatArray:
    """Rank of each policy, mean over levels; (..., P, L) to (..., P)."""
    return (means[..., :, None, :] > means[..., None, :, :]).sum(axis=-2).mean(axis=-1)


def _tau(first: FloatArray, second: FloatArray) -> FloatArray:
    """Kendall's tau of two orders, (..., P) each to (...); pairs that tie in one of them count 0."""
    above, below = np.triu_indices(first.shape[-1], k=1)
    agree = np.sign(first[..., above] - first[..., below]) * np.sign(second[..., above] - second[..., below])
    return agree.mean(axis=-1)
