"""Statements about the order of policies in two panels: the same, the opposite, or one that has nothing to do with it.

All rest on Kendall's tau between two orders: 1 if all pairs of policies stand alike in both, -1 if all stand the other
way round. By intervals the order in a panel is that of the mean ranks over the levels. By bands a pair has an order in
a panel if its bands are apart, in the same direction, at more than half of the levels; tau is that of the pairs which
have an order in both panels, and must be those of more than half of all pairs, else the answer is undecided.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..checks import check_option
from ..curves import FloatArray
from .outcomes import Answer, Outcome, scored_levels
from .panel import MANY, Panel, Rule, bounds, resampled_means, signs
from .predicates import every_pair

LOOSE = 0.5
"""Largest Kendall's tau, up or down, of orders that are not tied to each other (our choice)."""


def same_order(
    first: Panel,
    second: Panel,
    *,
    policies: Sequence[str],
    better: tuple[int, int] = (1, 1),
    rule: Rule = "intervals",
) -> Outcome:
    """Whether policies have the same order in two panels: the interval of tau is above 0, by bands tau above `LOOSE`.

    Contradicted if none of it is above 0.

    Args:
        first: One panel.
        second: The other; levels and runs may differ.
        policies: Policies to order, two or more.
        better: 1 or -1 for each panel: whether higher or lower is better there.
        rule: As everywhere.
    """

    def decide(lower: float, upper: float) -> Answer:
        least = LOOSE if rule == "bands" else 0.0
        return "supported" if lower > least else "contradicted" if upper <= 0.0 else "undecided"

    return _of_tau(first, second, policies, better, rule, decide, "above 0 is the same order")


def opposite_order(
    first: Panel,
    second: Panel,
    *,
    policies: Sequence[str],
    better: tuple[int, int] = (1, 1),
    rule: Rule = "intervals",
) -> Outcome:
    """Whether policies have the opposite order in two panels; as `same_order`, below 0 and below minus `LOOSE`."""

    def decide(lower: float, upper: float) -> Answer:
        most = -LOOSE if rule == "bands" else 0.0
        return "supported" if upper < most else "contradicted" if lower >= 0.0 else "undecided"

    return _of_tau(first, second, policies, better, rule, decide, "below 0 is the opposite order")


def unrelated(first: Panel, second: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the order in one panel has nothing to do with that in the other: tau lies within `LOOSE` of 0.

    Contradicted if its interval leaves out 0 on either side: the opposite order is a strong tie, too. By bands, if tau
    itself is beyond `LOOSE`.
    """

    def decide(lower: float, upper: float) -> Answer:
        if lower >= -LOOSE and upper <= LOOSE:
            return "supported"
        return "contradicted" if lower > 0.0 or upper < 0.0 else "undecided"

    return _of_tau(first, second, policies, (1, 1), rule, decide, f"within {LOOSE:g} of 0 is unrelated")


def _of_tau(
    first: Panel,
    second: Panel,
    policies: Sequence[str],
    better: tuple[int, int],
    rule: Rule,
    decide: Callable[[float, float], Answer],
    limit: str,
) -> Outcome:
    """Decide on Kendall's tau of two panels and its interval; by bands the interval is tau alone."""
    check_option("rule", rule, Rule)
    parts: list[Panel] = []
    for panel in (first, second):
        part = scored_levels(panel, policies, rule)
        if isinstance(part, Outcome):
            return part
        parts.append(part)
    n_runs = min(part.n_runs(policies) for part in parts)
    if rule == "bands":
        signs_of = [_signs_by_bands(part, policies) * side for part, side in zip(parts, better, strict=True)]
        ordered = np.all(np.array(signs_of) != 0.0, axis=0)
        n_ordered, n_pairs = int(ordered.sum()), ordered.size
        if n_ordered <= MANY * n_pairs:
            why = f"bands put {n_ordered} of {n_pairs} pairs in order in both panels; more than half are needed"
            return Outcome(answer="undecided", statistic=np.nan, effect=np.nan, n_runs=n_runs, why=why)
        tau = float((signs_of[0] * signs_of[1])[ordered].mean())
        lower = upper = tau
        interval = f"of {n_ordered} of {n_pairs} pairs"
    else:
        curves = [resampled_means(part.of(policies) * side) for part, side in zip(parts, better, strict=True)]
        tau = float(_tau(*(_mean_ranks(means) for means, _ in curves)))
        lower, upper = bounds(_tau(*(_mean_ranks(drawn) for _, drawn in curves)))
        interval = f"{lower:.2f} to {upper:.2f}"
    why = f"Kendall's tau of the two orders is {tau:.2f} ({interval}); {limit}"
    return Outcome(answer=decide(lower, upper), statistic=tau, effect=np.nan, n_runs=n_runs, why=why)


def _signs_by_bands(panel: Panel, policies: Sequence[str]) -> FloatArray:
    """Order of each pair, 1 if the first is higher, -1 if the second is, 0 if neither at more than half of levels."""
    found = np.array([signs(panel, first, second, "bands") for first, second in every_pair(policies)])
    return ((found == 1.0).mean(axis=1) > MANY) * 1.0 - ((found == -1.0).mean(axis=1) > MANY)


def _mean_ranks(means: FloatArray) -> FloatArray:
    """Rank of each policy, mean over levels; (..., P, L) to (..., P)."""
    return (means[..., :, None, :] > means[..., None, :, :]).sum(axis=-2).mean(axis=-1)


def _tau(first: FloatArray, second: FloatArray) -> FloatArray:
    """Kendall's tau of two orders, (..., P) each to (...); pairs that tie in one of them count 0."""
    above, below = np.triu_indices(first.shape[-1], k=1)
    agree = np.sign(first[..., above] - first[..., below]) * np.sign(second[..., above] - second[..., below])
    return agree.mean(axis=-1)
