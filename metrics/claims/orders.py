"""Rules about two panels: the order of policies in both, and in which of them more differs; see `rules`.

Kendall's tau of the orders of policies in two panels is 1 if all pairs have the same order in both, -1 if all have the
opposite order. A pair has an order in a panel if one policy is higher at more levels than the other: by intervals where
the means are further apart than the margin, by bands where the bands do not overlap. Tau counts only pairs that have an
order in both panels. If these are fewer than half of all pairs, the answer is undecided; for unrelated orders they must
be `ORDERED` of the pairs, because policies that tie do not show whether two orders are related.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.special import stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from ..curves import FloatArray
from .panel import (
    LEAST_RUNS,
    MANY,
    Panel,
    Rule,
    bounds,
    mean_over_runs,
    order,
    resampled_means,
    std_over_runs,
)
from .rules import Answer, Names, Outcome, Pairs, at_scored_levels, within

MORE = 0.1
"""One panel has more differences than another if it has them in this share of comparisons more (our choice)."""
CLEAR = 2.0
"""Student's t at which the clarity of a difference is a half: about where the difference becomes significant."""
LOOSE = 0.5
"""Largest absolute value of Kendall's tau between unrelated orders (our choice)."""
ORDERED = 2.0 / 3.0
"""Share of pairs that must have an order in both panels if the orders are unrelated (our choice). If one of four
policies stands apart and three tie, half of the pairs have an order, and chance alone gives tau 1 or -1."""
SAME = 5.0 / 6.0
"""Above this tau, four policies without ties have the same order. One of 24 random orders does, and four reach 2/3."""


def same_order(
    first: Panel,
    second: Panel,
    *,
    policies: Names,
    better: tuple[int, int] = (1, 1),
    least: float = SAME,
    rule: Rule = "intervals",
) -> Outcome:
    """Whether policies have the same order in two panels: tau is above `least`, and surely above 0.

    Contradicted if it is surely at most `LOOSE`, and at most 0 where `least` is no more than `LOOSE`.

    Args:
        first: One panel.
        second: The other; levels and runs may differ.
        policies: Policies to order, two or more.
        better: 1 or -1 for each panel: whether higher or lower is better there; (1, -1) asks for the opposite order.
        least: `SAME`, or `LOOSE` for orders that only have to be similar. A single random order passes `LOOSE` in four
            of 24 cases, so a claim needs several such panels.
        rule: As everywhere.
    """

    def decide(tau: float, lower: float, upper: float) -> Answer:
        if tau > least and lower > 0.0:
            return "supported"
        return "contradicted" if upper <= (LOOSE if least > LOOSE else 0.0) else "undecided"

    turned = "" if better[0] == better[1] else ", the second turned round"
    return _of_tau(first, second, policies, better, rule, decide, f"above {least:.2g} is the same order{turned}")


def unrelated(first: Panel, second: Panel, *, policies: Names, rule: Rule = "intervals") -> Outcome:
    """Whether the orders in two panels are unrelated: tau lies within `LOOSE` of 0.

    Contradicted by intervals if the interval of tau leaves out 0 on either side, because opposite orders are related,
    too; by bands, if tau is beyond `LOOSE`. Undecided if fewer than `ORDERED` of the pairs have an order in both.
    """

    def decide(_: float, lower: float, upper: float) -> Answer:
        if within((lower, upper), -LOOSE, LOOSE) == "supported":
            return "supported"
        return "contradicted" if lower > 0.0 or upper < 0.0 else "undecided"

    limit = f"within {LOOSE:g} of 0 is unrelated"
    return _of_tau(first, second, policies, (1, 1), rule, decide, limit, needed=ORDERED)


def _of_tau(
    first: Panel,
    second: Panel,
    policies: Names,
    better: tuple[int, int],
    rule: Rule,
    decide: Callable[[float, float, float], Answer],
    limit: str,
    *,
    needed: float = MANY,
) -> Outcome:
    """Decide on Kendall's tau of two panels and the bounds of its interval; by bands both are tau.

    `needed`: share of the pairs that must have an order in both panels.
    """
    parts = _both_scored(first, second, policies, rule)
    if isinstance(parts, Outcome):
        return parts
    n_runs = min(part.n_runs(policies) for part in parts)
    ordered = [_ordered(part, policies, side, rule) for part, side in zip(parts, better, strict=True)]
    found, drawn = zip(*ordered, strict=True)
    n_ordered, n_pairs = int((found[0] * found[1] != 0.0).sum()), found[0].size
    if n_ordered < needed * n_pairs:
        why = f"{n_ordered} of {n_pairs} pairs have an order in both panels; {needed:.0%} of them are needed"
        return Outcome("undecided", n_runs=n_runs, why=why)
    tau = float(_tau(*found))
    lower, upper = (tau, tau) if rule == "bands" else bounds(_tau(*drawn))
    interval = f"{lower:.2f} to {upper:.2f}, " if rule == "intervals" else ""
    why = f"Kendall's tau of the two orders is {tau:.2f} ({interval}of {n_ordered} of {n_pairs} pairs); {limit}"
    return Outcome(decide(tau, lower, upper), tau, n_runs=n_runs, why=why)


def _both_scored(first: Panel, second: Panel, policies: Names, rule: Rule) -> tuple[Panel, Panel] | Outcome:
    a, b = (at_scored_levels(panel, policies, rule) for panel in (first, second))
    return a if isinstance(a, Outcome) else b if isinstance(b, Outcome) else (a, b)


def _ordered(panel: Panel, policies: Names, better: int, rule: Rule) -> tuple[FloatArray, FloatArray]:
    """Order of each pair of policies, (pairs,): 1 if the first is better at more levels; and in resamples, (B, pairs).

    By bands, the resamples are the order itself.
    """
    if rule == "bands":
        seen = better * np.sign(order(panel, tuple(combinations(policies, 2)), rule))
        known = np.where(np.isnan(seen), 0.0, seen)
        return np.sign(known.sum(axis=-1)), np.sign(known.sum(axis=-1))[None]
    above, below = np.triu_indices(len(policies), k=1)

    def by_means(means: FloatArray) -> FloatArray:
        gaps = means[..., above, :] - means[..., below, :]
        return np.sign((np.sign(gaps) * (np.abs(gaps) > panel.tie_margins)).sum(axis=-1))

    means, drawn = resampled_means(panel.of(policies) * better, panel.confidence)
    return by_means(means), by_means(drawn)


def _tau(first: FloatArray, second: FloatArray) -> FloatArray:
    """Kendall's tau of two orders, (..., pairs) each to (...); 0 where no pair has an order in both."""
    agree = first * second
    return agree.sum(axis=-1) / np.maximum(1.0, np.abs(agree).sum(axis=-1))


def differs_more(few: Panel, many: Panel, *, pairs: Pairs, rule: Rule = "intervals") -> Outcome:
    """Whether the second panel has more pairs and levels that differ than the first.

    The rule looks at equally many runs of both panels. By intervals, it weights each comparison with its clarity, t^2 /
    (t^2 + 4), which is a half where the difference becomes significant and grows with the difference. Supported if the
    gain in mean clarity is surely above 0, contradicted if it is surely below `MORE`. By bands, the share of
    comparisons that differ must rise, or fall, by `MORE`.
    """
    names = sorted({name for pair in pairs for name in pair})
    parts = _both_scored(few, many, names, rule)
    if isinstance(parts, Outcome):
        return parts
    # Intervals narrow with the number of runs, so more runs alone would make more differences.
    complete = [np.flatnonzero(np.isfinite(part.of(names)).all(axis=(0, 1))) for part in parts]
    n_equal = min(map(len, complete))
    equal = [
        replace(part, scores={name: part.scores[name][:, runs[:n_equal]] for name in names})
        for part, runs in zip(parts, complete, strict=True)
    ]
    n_runs = equal[0].n_runs(names)
    if n_runs < LEAST_RUNS[rule]:
        return Outcome("undecided", n_runs=n_runs, why=f"{n_runs} runs of each panel, {LEAST_RUNS[rule]} are needed")
    if rule == "bands":
        shares = [float((np.abs(order(panel, pairs, rule)) == 1.0).mean()) for panel in equal]
        gain, words = shares[1] - shares[0], "of the comparisons differ"
        answer: Answer = "supported" if gain >= MORE else "contradicted" if gain <= -MORE else "undecided"
        ends = ""
    else:
        shares, deviations = zip(*(_clarity(panel, pairs) for panel in equal), strict=True)
        gain, words = shares[1] - shares[0], "clear are the differences"
        half = float(stdtrit(n_runs - 1.0, 0.5 + 0.5 * few.confidence) * np.hypot(*deviations))
        answer = "supported" if gain > half else "contradicted" if gain + half < MORE else "undecided"
        ends = f", {gain:.0%} more ({gain - half:.0%} to {gain + half:.0%})"
    why = f"{shares[1]:.0%} {words}, {shares[0]:.0%} in the first panel{ends}, of {n_runs} runs each; "
    return Outcome(answer, gain, n_runs=n_runs, why=f"{why}{MORE:.0%} more count as more")


def _clarity(panel: Panel, pairs: Pairs) -> tuple[float, float]:
    """Mean clarity of the comparisons in a panel, and its standard deviation by the jackknife.

    The jackknife leaves out one run of one policy at all levels, because levels may share the run that they are
    compared with.
    """
    scores = {name: panel.scores[name] for name in sorted({name for pair in pairs for name in pair})}
    variance = 0.0
    for name, values in scores.items():
        n_runs = values.shape[-1]
        fewer = [{**scores, name: np.delete(values, run, axis=-1)} for run in range(n_runs)]
        variance += (n_runs - 1.0) * float(np.var([_mean_clarity(some, pairs) for some in fewer]))
    return _mean_clarity(scores, pairs), variance**0.5


def _mean_clarity(scores: Mapping[str, FloatArray], pairs: Pairs) -> float:
    gaps = np.array([mean_over_runs(scores[a]) - mean_over_runs(scores[b]) for a, b in pairs])
    of_mean = {name: std_over_runs(values) ** 2 / np.isfinite(values).sum(axis=-1) for name, values in scores.items()}
    noise = np.array([of_mean[a] + of_mean[b] for a, b in pairs])
    with np.errstate(divide="ignore", invalid="ignore"):  # equal runs are as clear as can be, or no difference at all
        clarity = np.where(gaps == 0.0, 0.0, gaps**2 / (gaps**2 + CLEAR**2 * noise))
    return float(mean_over_runs(clarity.ravel()))
