"""What a claim can say about the heights of curves in a figure: a few general statements, each with an answer.

A statement about several levels is supported if it holds at more than half of them, contradicted if it fails at more
than half, and else undecided. The thresholds are the same for every claim.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TypeAlias

import numpy as np
from scipy.special import stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from ..curves import FloatArray
from .outcomes import (
    Answer,
    BoolArray,
    Outcome,
    all_of,
    by_majority,
    contrary,
    scored_levels,
    where_scored,
    within_limit,
    without_scores,
)
from .panel import (
    CONFIDENCE,
    LEAST_RUNS,
    MANY,
    TIE,
    Levels,
    Panel,
    Rule,
    bounds,
    interval_of,
    mean_over_runs,
    of_equal_runs,
    resampled_deviations,
    resampled_means,
    signs,
    std_over_runs,
)

Pairs: TypeAlias = Sequence[tuple[str, str]]

FLAT = 0.25
"""Largest spread of a curve that is roughly constant, largest width of a narrow band, and largest small lead, as a
share of the panel's scale (our choice)."""
MORE = 0.1
"""One panel has more differences than another if it has them in this share of comparisons more (our choice)."""
CLEAR = 2.0
"""Student's t at which the clarity of a difference is a half: about where the difference becomes significant."""
MIN_CONSTANT = 4
"""Levels that a constant curve needs so that one of them may be wild (our choice: three others still show a curve)."""
WIDER = 1.5
"""Ratio of the widths of two bands at which one looks wider (our choice)."""


def ties(panel: Panel, *, pairs: Pairs, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether pairs of policies mostly tie: at more than half of the levels, all pairs counted together."""
    part = panel.part(levels)
    names = sorted({name for pair in pairs for name in pair})
    if not part.n_runs(names):
        return without_scores(" and ".join(names))
    found = np.array([signs(part, first, second, rule) for first, second in pairs])
    return by_majority(
        found == 0.0,
        np.abs(found) == 1.0,
        f"comparisons of {' and '.join(names)} tie",
        effect=_gap(part, pairs),
        n_runs=part.n_runs(names),
    )


def never_differ(panel: Panel, *, pairs: Pairs, n_panels: int = 1, rule: Rule = "intervals") -> Outcome:
    """Whether no pair of policies differs at any level.

    Supported if all comparisons tie. Contradicted if one differs: by intervals after Bonferroni's correction, so that
    one difference by chance among many comparisons does not count.

    Args:
        panel: The scores.
        pairs: Of policies.
        n_panels: Number of panels about which a claim says this; a difference in one of them contradicts the claim.
        rule: As everywhere.
    """
    names = sorted({name for pair in pairs for name in pair})
    if not panel.n_runs(names):
        return without_scores(" and ".join(names))
    n_tests = len(pairs) * panel.levels.size * n_panels
    found = np.array([signs(panel, first, second, rule, n_tests) for first, second in pairs])
    n_tied, n_apart = int((found == 0.0).sum()), int((np.abs(found) == 1.0).sum())
    answer: Answer = "contradicted" if n_apart else "supported" if n_tied == found.size else "undecided"
    why = f"{n_apart} of {found.size} comparisons differ, {n_tied} tie, {found.size - n_apart - n_tied} open"
    return Outcome(
        answer=answer, statistic=n_apart / found.size, effect=_gap(panel, pairs), n_runs=panel.n_runs(names), why=why
    )


def _gap(panel: Panel, pairs: Pairs) -> float:
    """Mean distance between the means of pairs, as a share of the scale."""
    gaps = np.array([mean_over_runs(panel.scores[a]) - mean_over_runs(panel.scores[b]) for a, b in pairs])
    return float(mean_over_runs(np.abs(gaps).ravel())) / panel.scale


def stays_alike(first: Panel, second: Panel, *, policy: str, rule: Rule = "intervals") -> Outcome:
    """Whether a policy ties with itself, at most levels, in two panels with the same levels and runs."""
    scores = {"first": first.scores[policy], "second": second.scores[policy]}
    both = replace(first, scores=scores, margins=np.maximum(first.tie_margins, second.tie_margins))
    outcome = ties(both, pairs=(("first", "second"),), rule=rule)
    return replace(outcome, why=f"{policy} in both panels: {outcome.why}")


def differ(panel: Panel, *, pairs: Pairs, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether pairs of policies mostly differ: the contrary of `ties`."""
    outcome = ties(panel, pairs=pairs, levels=levels, rule=rule)
    return replace(outcome, answer="tie") if outcome.answer == "supported" else contrary(outcome)


def is_higher(
    panel: Panel, *, upper: Sequence[str], lower: Sequence[str], levels: Levels = "all", rule: Rule = "intervals"
) -> Outcome:
    """Whether each of some policies is higher than each of others, at more than half of the levels.

    A level counts against the statement if one of the pairs ties or has the opposite order. The answer is a tie if, at
    more than half of the levels, pairs tie and none has the opposite order.
    """
    part = panel.part(levels)
    names = (*upper, *lower)
    if not part.n_runs(names):
        return without_scores(" and ".join(names))
    found = np.array([signs(part, above, below, rule) for above in upper for below in lower])
    gap = mean_over_runs(part.of(upper)).mean(axis=0) - mean_over_runs(part.of(lower)).mean(axis=0)
    return by_majority(
        np.all(found == 1.0, axis=0),
        np.any(found <= 0.0, axis=0),
        f"levels have {' and '.join(upper)} above {' and '.join(lower)}",
        effect=float(mean_over_runs(gap)) / part.scale,
        n_runs=part.n_runs(names),
        tied=np.any(found == 0.0, axis=0) & ~np.any(found < 0.0, axis=0),
    )


def leads_by_little(
    panel: Panel, *, leader: str, others: Sequence[str], levels: Levels = "all", rule: Rule = "intervals"
) -> Outcome:
    """Whether a policy is highest by a little, at more than half of the levels.

    Its lead over each of the others must surely be above 0, but may be smaller than `TIE`. Its lead over the best of
    them must be at most `FLAT` of the scale. A level counts against the statement if another policy is surely higher,
    or if the lead is surely larger than `FLAT`. By intervals, "surely" means the whole interval. By bands, it means
    that bands do not overlap, and the lead is the difference of the means.
    """
    part = panel.part(levels)
    names = (leader, *others)
    if not part.n_runs(names):
        return without_scores(" and ".join(names))
    leads = np.array([_leads(part, leader, other, rule) for other in others])  # (others, L, 2)
    lower, upper = leads[..., 0], leads[..., 1]
    limit = FLAT * part.scale
    means = mean_over_runs(part.of(names))
    smallest = float(mean_over_runs((means[0] - means[1:]).min(axis=0))) / part.scale
    return by_majority(
        np.all(lower > 0.0, axis=0) & (upper.min(axis=0) <= limit),
        np.any(upper < 0.0, axis=0) | np.all(lower > limit, axis=0),
        f"levels have {leader} above {' and '.join(others)} by at most {FLAT:g} of the scale",
        effect=smallest,
        n_runs=part.n_runs(names),
    )


def _leads(panel: Panel, leader: str, other: str, rule: Rule) -> FloatArray:
    """Bounds of the lead at each level, (L, 2): NaN where there are too few runs."""
    a, b = panel.of((leader, other))
    if rule == "intervals":
        known = ((x[np.isfinite(x)], y[np.isfinite(y)]) for x, y in zip(a, b, strict=True))
        return np.array([interval_of(x, y, panel.confidence) for x, y in known])
    gap = mean_over_runs(a) - mean_over_runs(b)
    apart = signs(panel, leader, other, rule)
    return np.stack([np.where(apart > 0.0, gap, -np.inf), np.where(apart < 0.0, gap, np.maximum(gap, 0.0))], axis=1)


def is_not_higher(
    panel: Panel, *, first: str, second: str, levels: Levels = "all", rule: Rule = "intervals"
) -> Outcome:
    """Whether a policy is no higher than another: lower or tied at more than half of the levels."""
    part = panel.part(levels)
    if not part.n_runs((first, second)):
        return without_scores(f"{first} and {second}")
    found = signs(part, first, second, rule)
    gap = mean_over_runs(part.scores[first]) - mean_over_runs(part.scores[second])
    return by_majority(
        found <= 0.0,
        found == 1.0,
        f"levels have {first} no higher than {second}",
        effect=float(mean_over_runs(gap)) / part.scale,
        n_runs=part.n_runs((first, second)),
    )


def is_constant(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether each policy is roughly constant over the levels, or over all but one of `MIN_CONSTANT` or more.

    One wild level does not decide for all others, but a fall over several levels does. By intervals: the largest mean
    less the smallest is at most `FLAT` of the scale. By bands: one height lies within the bands of all these levels.
    """
    return all_of([_constancy(panel, policy, rule) for policy in policies])


def varies(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether each policy varies with the level: the contrary of `is_constant` for each."""
    return all_of([contrary(_constancy(panel, policy, rule)) for policy in policies])


def is_narrow(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the bands of policies, four standard deviations wide, are at most `FLAT` of the scale at most levels.

    By intervals, the rule looks at the median width over the levels, which one wild level does not change.
    """
    return all_of([_narrowness(panel, policy, rule) for policy in policies])


def is_wide(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the bands of policies are wider than this: the contrary of `is_narrow` for each."""
    return all_of([contrary(_narrowness(panel, policy, rule)) for policy in policies])


def is_wider(panel: Panel, *, upper: Sequence[str], lower: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the runs of each of some policies scatter more than the runs of each of others.

    By intervals: in the median over the levels. By bands: the band is `WIDER` times as wide at more than half of the
    levels. Contradicted if this holds for the other policy, else undecided.
    """
    return all_of([_more_scatter(panel, a, b, rule) for a in upper for b in lower])


def reaches_higher(panel: Panel, *, upper: Sequence[str], lower: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the upper edges of the bands of some policies are above the upper edges of others.

    By intervals: in the median over the levels. By bands: the edge is above the other by `TIE` of the scale at more
    than half of the levels. Contradicted if this holds for the other policy, else undecided.
    """
    return all_of([_higher_edge(panel, a, b, rule) for a in upper for b in lower])


def differs_more(few: Panel, many: Panel, *, pairs: Pairs, rule: Rule = "intervals") -> Outcome:
    """Whether the second panel has more pairs and levels that differ than the first.

    The rule looks at equally many runs of both panels. By intervals, it weights each comparison with its clarity, t^2 /
    (t^2 + 4), which is a half where the difference becomes significant and grows with the difference. Supported if the
    gain in mean clarity is surely above 0, contradicted if it is surely below `MORE`. By bands, the share of
    comparisons that differ must rise, or fall, by `MORE`.
    """
    names = sorted({name for pair in pairs for name in pair})
    parts: list[Panel] = []
    for panel in (few, many):
        part = scored_levels(panel, names, rule)
        if isinstance(part, Outcome):
            return part
        parts.append(part)
    equal = of_equal_runs(parts[0], parts[1], names)
    n_runs = equal[0].n_runs(names)
    if n_runs < LEAST_RUNS[rule]:
        why = f"{n_runs} runs of each panel, {LEAST_RUNS[rule]} are needed"
        return Outcome(answer="undecided", statistic=np.nan, effect=np.nan, n_runs=n_runs, why=why)
    if rule == "bands":
        shares = [_share_apart(panel, pairs) for panel in equal]
        gain, words = shares[1] - shares[0], "of the comparisons differ"
        answer: Answer = "supported" if gain >= MORE else "contradicted" if gain <= -MORE else "undecided"
        ends = ""
    else:
        clarities = [_clarity(panel, pairs) for panel in equal]
        shares, deviations = zip(*clarities, strict=True)
        gain, words = shares[1] - shares[0], "clear are the differences"
        half = float(stdtrit(n_runs - 1.0, 0.5 + 0.5 * few.confidence) * np.hypot(*deviations))
        answer = "supported" if gain > half else "contradicted" if gain + half < MORE else "undecided"
        ends = f", {gain:.0%} more ({gain - half:.0%} to {gain + half:.0%})"
    why = (
        f"{shares[1]:.0%} {words}, {shares[0]:.0%} in the first panel{ends}, of {n_runs} runs each; "
        f"{MORE:.0%} more count as more"
    )
    return Outcome(answer=answer, statistic=gain, effect=np.nan, n_runs=n_runs, why=why)


def _share_apart(panel: Panel, pairs: Pairs) -> float:
    """Share of comparisons whose bands do not overlap."""
    return float((np.abs([signs(panel, first, second, "bands") for first, second in pairs]) == 1.0).mean())


def _clarity(panel: Panel, pairs: Pairs) -> tuple[float, float]:
    """Mean clarity of the comparisons in a panel, and its standard deviation by the jackknife.

    The jackknife leaves out one run of one policy at all levels, because levels may share the run that they are
    compared with.
    """
    names = sorted({name for pair in pairs for name in pair})
    scores = {name: panel.scores[name] for name in names}
    found = _mean_clarity(scores, pairs)
    variance = 0.0
    for name in names:
        n_runs = scores[name].shape[-1]
        fewer = [{**scores, name: np.delete(scores[name], run, axis=-1)} for run in range(n_runs)]
        variance += (n_runs - 1.0) * float(np.var([_mean_clarity(some, pairs) for some in fewer]))
    return found, variance**0.5


def _mean_clarity(scores: Mapping[str, FloatArray], pairs: Pairs) -> float:
    gaps = np.array([mean_over_runs(scores[a]) - mean_over_runs(scores[b]) for a, b in pairs])
    of_mean = {name: std_over_runs(values) ** 2 / np.isfinite(values).sum(axis=-1) for name, values in scores.items()}
    noise = np.array([of_mean[a] + of_mean[b] for a, b in pairs])
    with np.errstate(divide="ignore", invalid="ignore"):  # equal runs are as clear as can be, or no difference at all
        clarity = np.where(gaps == 0.0, 0.0, gaps**2 / (gaps**2 + CLEAR**2 * noise))
    return float(mean_over_runs(clarity.ravel()))


def every_pair(policies: Sequence[str]) -> Pairs:
    """Return all pairs of policies."""
    return tuple(combinations(policies, 2))


def _constancy(panel: Panel, policy: str, rule: Rule) -> Outcome:
    def judge(part: Panel) -> Outcome:
        (values,) = part.of((policy,))
        means, drawn = resampled_means(values, part.confidence)
        kept = _but_one(means.size)
        spreads = np.array([np.ptp(means[some]) for some in kept]) / part.scale
        spread, n_runs = float(spreads.min()), part.n_runs((policy,))
        words = "all levels" if len(kept) == 1 else "all levels but one"
        if rule == "bands":
            reach = 2.0 * std_over_runs(values)
            shared = any((means + reach)[some].min() >= (means - reach)[some].max() for some in kept)
            answer: Answer = "supported" if shared else "contradicted"
            why = f"the bands of {policy} at {words} have {'a height in common' if shared else 'no common height'}"
            return Outcome(answer=answer, statistic=spread, effect=spread, n_runs=n_runs, why=why)
        # The spread of noisy means is too large, so its percentiles would be, too. The spread of what the runs add by
        # chance bounds it from both sides, for each choice of levels: a wild level may scatter more than the others.
        chances = [np.quantile(np.ptp((drawn - means)[:, some], axis=-1), CONFIDENCE) / part.scale for some in kept]
        interval = (max(0.0, float((spreads - chances).min())), float((spreads + chances).min()))
        why = (
            f"means of {policy} at {words} spread over {spread:.2f} of the scale ({_ends(interval)}); {FLAT:g} is "
            "still constant"
        )
        return Outcome(answer=within_limit(interval, FLAT), statistic=spread, effect=spread, n_runs=n_runs, why=why)

    return where_scored(panel, (policy,), rule, judge)


def _but_one(n_levels: int) -> list[BoolArray]:
    """Return masks of the levels over which a curve has to be constant: all but each one; all if there are few."""
    every = np.ones((1, n_levels), dtype=np.bool_)
    return list(every if n_levels < MIN_CONSTANT else every ^ np.eye(n_levels, dtype=np.bool_))


def _narrowness(panel: Panel, policy: str, rule: Rule) -> Outcome:
    def judge(part: Panel) -> Outcome:
        (values,) = part.of((policy,))
        found, drawn = resampled_deviations(values, part.confidence)
        width, n_runs = 4.0 * float(np.median(found)) / part.scale, part.n_runs((policy,))
        if rule == "bands":
            widths = 4.0 * std_over_runs(values) / part.scale
            answer: Answer = "supported" if (widths <= FLAT).mean() > MANY else "contradicted"
            why = f"bands of {policy} are at most {FLAT:g} of the scale wide at {(widths <= FLAT).mean():.0%} of levels"
            return Outcome(answer=answer, statistic=width, effect=width, n_runs=n_runs, why=why)
        interval = bounds(4.0 * np.median(drawn, axis=-1) / part.scale)
        why = f"bands of {policy} are {width:.2f} of the scale wide ({_ends(interval)}); {FLAT:g} is still narrow"
        return Outcome(answer=within_limit(interval, FLAT), statistic=width, effect=width, n_runs=n_runs, why=why)

    return where_scored(panel, (policy,), rule, judge)


def _more_scatter(panel: Panel, first: str, second: str, rule: Rule) -> Outcome:
    def judge(part: Panel) -> Outcome:
        found, drawn = resampled_deviations(part.of((first, second)), part.confidence)
        if rule == "bands":
            wider, narrower = found[0] >= WIDER * found[1], found[1] >= WIDER * found[0]
            what = f"levels have the band of {first} {WIDER:g} times as wide as that of {second}"
            return _by_sight(part, (first, second), found, wider, narrower, what)
        return _by_draws(part, (first, second), found, drawn, "scatter")

    return where_scored(panel, (first, second), rule, judge)


def _higher_edge(panel: Panel, first: str, second: str, rule: Rule) -> Outcome:
    def judge(part: Panel) -> Outcome:
        both = part.of((first, second))
        means, drawn_means = resampled_means(both, part.confidence)
        widths, drawn_widths = resampled_deviations(both, part.confidence)
        edges = means + 2.0 * widths
        if rule == "bands":
            gap, limit = edges[0] - edges[1], TIE * part.scale
            what = f"levels have the upper edge of {first} {TIE:g} of the scale above that of {second}"
            return _by_sight(part, (first, second), edges, gap >= limit, gap <= -limit, what)
        return _by_draws(part, (first, second), edges, drawn_means + 2.0 * drawn_widths, "upper edge")

    return where_scored(panel, (first, second), rule, judge)


def _by_sight(
    panel: Panel,
    names: tuple[str, str],
    found: FloatArray,
    holds: BoolArray,
    fails: BoolArray,
    what: str,
) -> Outcome:
    """Whether the first of two values is larger at most levels, or the second; `found` holds both, (2, L)."""
    gap = float((found[0] - found[1]).mean()) / panel.scale
    return by_majority(holds, fails, what, effect=gap, n_runs=panel.n_runs(names), against="the reverse")


def _by_draws(panel: Panel, names: tuple[str, str], found: FloatArray, drawn: FloatArray, what: str) -> Outcome:
    """Whether a statistic at levels, (2, L), is larger for the first of two policies, in the median over levels."""
    gap = float(np.median(found[0] - found[1])) / panel.scale
    lower, upper = bounds(np.median(drawn[:, 0] - drawn[:, 1], axis=-1) / panel.scale)
    answer: Answer = "supported" if lower >= 0.0 else "contradicted" if upper < 0.0 else "undecided"
    ends = _ends((lower, upper))
    why = f"{what} of {names[0]} less that of {names[1]} is {gap:.2f} of the scale ({ends}); above 0 it is larger"
    return Outcome(answer=answer, statistic=gap, effect=gap, n_runs=panel.n_runs(names), why=why)


def _ends(interval: tuple[float, float]) -> str:
    return f"{interval[0]:.2f} to {interval[1]:.2f}"
