"""Statements about the order of policies in two panels: the same, the opposite, or unrelated orders.

All use Kendall's tau between two orders: 1 if all pairs of policies have the same order in both panels, -1 if all have
the opposite order. A pair has an order in a panel if one policy is higher at more levels than the other: by intervals
where the means are further apart than the margin, by bands where the bands do not overlap. Tau counts only pairs that
have an order in both panels. If these are fewer than half of all pairs, the answer is undecided. For unrelated orders,
the share must be `ORDERED`, because policies that tie do not show whether two orders are related.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..checks import check_option
from ..curves import FloatArray
from .outcomes import Answer, Outcome, scored_levels
from .panel import MANY, Panel, Rule, bounds, resampled_means, signs
from .predicates import every_pair

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
    policies: Sequence[str],
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
        better: 1 or -1 for each panel: whether higher or lower is better there.
        least: `SAME`, or `LOOSE` for orders that only have to be similar. A single random order passes `LOOSE` in four
            of 24 cases, so a claim needs several such panels.
        rule: As everywhere.
    """

    def decide(tau: float, lower: float, upper: float) -> Answer:
        return _is_above(least, tau, lower, upper)

    return _of_tau(first, second, policies, better, rule, decide, f"above {least:.2g} is the same order")


def opposite_order(
    first: Panel,
    second: Panel,
    *,
    policies: Sequence[str],
    better: tuple[int, int] = (1, 1),
    least: float = SAME,
    rule: Rule = "intervals",
) -> Outcome:
    """Whether policies have the opposite order in two panels: `same_order` with the opposite sign of tau."""

    def decide(tau: float, lower: float, upper: float) -> Answer:
        return _is_above(least, -tau, -upper, -lower)

    return _of_tau(first, second, policies, better, rule, decide, f"below {-least:.2g} is the opposite order")


def unrelated(first: Panel, second: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the orders in two panels are unrelated: tau lies within `LOOSE` of 0.

    Contradicted by intervals if the interval of tau leaves out 0 on either side, because opposite orders are related,
    too; by bands, if tau is beyond `LOOSE`. Undecided if fewer than `ORDERED` of the pairs have an order in both.
    """

    def decide(_: float, lower: float, upper: float) -> Answer:
        if lower >= -LOOSE and upper <= LOOSE:
            return "supported"
        return "contradicted" if lower > 0.0 or upper < 0.0 else "undecided"

    limit = f"within {LOOSE:g} of 0 is unrelated"
    return _of_tau(first, second, policies, (1, 1), rule, decide, limit, needed=ORDERED)


def _is_above(least: float, tau: float, lower: float, upper: float) -> Answer:
    if tau > least and lower > 0.0:
        return "supported"
    return "contradicted" if upper <= (LOOSE if least > LOOSE else 0.0) else "undecided"


def _of_tau(
    first: Panel,
    second: Panel,
    policies: Sequence[str],
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
    check_option("rule", rule, Rule)
    parts: list[Panel] = []
    for panel in (first, second):
        part = scored_levels(panel, policies, rule)
        if isinstance(part, Outcome):
            return part
        parts.append(part)
    n_runs = min(part.n_runs(policies) for part in parts)
    if rule == "bands":
        found = [_by_bands(part, policies) * side for part, side in zip(parts, better, strict=True)]
        drawn = None
    else:
        curves = [
            resampled_means(part.of(policies) * side, part.confidence) for part, side in zip(parts, better, strict=True)
        ]
        found = [_by_means(means, part.tie_margins) for (means, _), part in zip(curves, parts, strict=True)]
        drawn = [_by_means(means, part.tie_margins) for (_, means), part in zip(curves, parts, strict=True)]
    n_ordered, n_pairs = int((found[0] * found[1] != 0.0).sum()), found[0].size
    if n_ordered < needed * n_pairs:
        why = f"{n_ordered} of {n_pairs} pairs have an order in both panels; {needed:.0%} of them are needed"
        return Outcome(answer="undecided", statistic=np.nan, effect=np.nan, n_runs=n_runs, why=why)
    tau = float(_tau(*found))
    lower, upper = (tau, tau) if drawn is None else bounds(_tau(*drawn))
    interval = f"{lower:.2f} to {upper:.2f}, " if drawn is not None else ""
    why = f"Kendall's tau of the two orders is {tau:.2f} ({interval}of {n_ordered} of {n_pairs} pairs); {limit}"
    return Outcome(answer=decide(tau, lower, upper), statistic=tau, effect=np.nan, n_runs=n_runs, why=why)


def _by_bands(panel: Panel, policies: Sequence[str]) -> FloatArray:
    """Order of each pair: 1 if the first is higher at more levels, -1 if the second is, else 0."""
    found = np.array([signs(panel, first, second, "bands") for first, second in every_pair(policies)])
    return np.sign((found == 1.0).sum(axis=1) - (found == -1.0).sum(axis=1))


def _by_means(means: FloatArray, margins: FloatArray) -> FloatArray:
    """Order of each pair by means beyond the margins, (..., P, L) and (L,) to (..., pairs)."""
    above, below = np.triu_indices(means.shape[-2], k=1)
    gaps = means[..., above, :] - means[..., below, :]
    return np.sign((np.sign(gaps) * (np.abs(gaps) > margins)).sum(axis=-1))


def _tau(first: FloatArray, second: FloatArray) -> FloatArray:
    """Kendall's tau of two orders, (..., pairs) each to (...); 0 where no pair has an order in both."""
    agree = first * second
    return agree.sum(axis=-1) / np.maximum(1.0, np.abs(agree).sum(axis=-1))
