"""Statements about the order of policies in two panels: the same, the opposite, or one that has nothing to do with it.

All rest on Kendall's tau between two orders: 1 if all pairs of policies stand alike in both, -1 if all stand the other
way round. A pair has an order in a panel if one of the two is higher at more levels than the other: by intervals where
the means are further apart than the margin, by bands where the bands do not overlap. Tau is that of the pairs which
have an order in both panels; these must be half of all pairs or more, else the answer is undecided. For orders that
have nothing to do with each other they must be `ORDERED`: where policies tie, an order is neither tied to another nor
free.
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
ORDERED = 2.0 / 3.0
"""Share of pairs that must have an order in both panels where orders have nothing to do with each other (our choice).
One of four policies apart from three that tie is half: in every other case chance puts it at the same end or the other.
"""
SAME = 5.0 / 6.0
"""Above this tau four policies without ties have the same order. Of 24 random orders one has that, four reach 2/3."""


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
        least: `SAME`, or `LOOSE` for orders that go with each other and need not be the same. A single random order
            passes the latter in four of 24 cases, so a claim needs several panels of that kind.
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
    """Whether policies have the opposite order in two panels: as `same_order`, with tau of the other sign."""

    def decide(tau: float, lower: float, upper: float) -> Answer:
        return _is_above(least, -tau, -upper, -lower)

    return _of_tau(first, second, policies, better, rule, decide, f"below {-least:.2g} is the opposite order")


def unrelated(first: Panel, second: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the order in one panel has nothing to do with that in the other: tau lies within `LOOSE` of 0.

    Contradicted if its interval leaves out 0 on either side: the opposite order is a strong tie, too. By bands, if tau
    itself is beyond `LOOSE`. Undecided if fewer than `ORDERED` of the pairs have an order in both.
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
    """Order of each pair, 1 if the first is higher, -1 if the second is, 0 if neither at more levels than the other."""
    found = np.array([signs(panel, first, second, "bands") for first, second in every_pair(policies)])
    return np.sign((found == 1.0).sum(axis=1) - (found == -1.0).sum(axis=1))


def _by_means(means: FloatArray, margins: FloatArray) -> FloatArray:
    """The same by means beyond the margins, (..., P, L) and (L,) to (..., pairs)."""
    above, below = np.triu_indices(means.shape[-2], k=1)
    gaps = means[..., above, :] - means[..., below, :]
    return np.sign((np.sign(gaps) * (np.abs(gaps) > margins)).sum(axis=-1))


def _tau(first: FloatArray, second: FloatArray) -> FloatArray:
    """Kendall's tau of two orders, (..., pairs) each to (...); 0 where no pair has an order in both."""
    agree = first * second
    return agree.sum(axis=-1) / np.maximum(1.0, np.abs(agree).sum(axis=-1))
