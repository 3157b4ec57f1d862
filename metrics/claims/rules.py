"""What a claim can say about panels: rules that answer by numbers, under `intervals` (ours) or `bands` (the paper's).

Three kinds of number decide. At each level, the order of two policies (`panel.order`); a statement holds if it holds at
more than half of the levels (`by_levels`). Of each curve, a number with an interval between two bounds (`within`): how
far it spreads, how wide its band is; `shapes` has its bends and slopes. Of two panels, see `orders`. The thresholds are
the same for every claim. docs/metrics.md tells which rules changed after runs were seen.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import inf, nan
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..curves import FloatArray
from ..population import availability, ratio_for_team
from .panel import (
    CONFIDENCE,
    LEAST_RUNS,
    MANY,
    TIE,
    Levels,
    Panel,
    Rule,
    bounds,
    intervals_of,
    mean_over_runs,
    order,
    resampled_deviations,
    resampled_means,
    std_over_runs,
)

Answer: TypeAlias = Literal["supported", "contradicted", "tie", "too vague", "undecided", "no scores"]
"""`tie`: the claim says that there is a difference, but what it compares ties. `too vague`: its text does not say which
runs would contradict it, so no rule looks at runs. `undecided`: the runs leave it open. `no scores`: runs are missing,
or a measure does not have a finite value."""
Names: TypeAlias = Sequence[str]
Pairs: TypeAlias = Sequence[tuple[str, str]]
BoolArray: TypeAlias = NDArray[np.bool_]

FLAT = 0.25
"""Largest spread of a curve that is roughly constant, largest width of a narrow band, and largest small lead, as a
share of the panel's scale (our choice)."""
MIN_CONSTANT = 4
"""Levels that a constant curve needs so that one of them may be wild (our choice: three others still show a curve)."""
WIDER = 1.5
"""Ratio of the widths of two bands at which one looks wider (our choice)."""


@dataclass(frozen=True)
class Outcome:
    """The answer to one statement or to several, with its reason."""

    answer: Answer
    statistic: float = nan
    """Number that decides; `why` says what it is. For several statements, the share of them that holds."""
    effect: float = nan
    """Size of the difference or change, as a share of the panel's scale; NaN where a statement has none. For several
    statements, the median of those with this answer."""
    n_runs: int = 0
    """Smallest number of runs behind any number that the rule used; 0 for formulas and missing scores."""
    why: str = ""
    """What the rule found, and what it compared this with."""
    parts: tuple["Outcome", ...] = field(default=(), repr=False)
    """The outcomes of the single statements, if there are several."""

    @property
    def lines(self) -> tuple[str, ...]:
        """The reasons: one line, or one per part with its answer."""
        return tuple(f"{part.answer}: {part.why}" for part in self.parts) or (self.why,)


def all_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return one outcome for several statements that must all hold: a single one that fails or ties decides."""
    answers = [outcome.answer for outcome in outcomes]
    worst_first: tuple[Answer, ...] = ("contradicted", "tie", "no scores", "undecided", "supported")
    return _joined(outcomes, next(answer for answer in worst_first if answer in answers))


def most_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return one outcome for several statements of which more than half must hold."""
    answers = [outcome.answer for outcome in outcomes]
    open_answer: Answer = "no scores" if "no scores" in answers else "undecided"
    votes = (answers.count("supported"), answers.count("contradicted"), answers.count("tie"))
    return _joined(outcomes, _of_most(*votes, total=len(answers)) or open_answer)


def _of_most(n_for: int, n_against: int, n_tied: int, *, total: int) -> Answer | None:
    """The answer that more than half of the votes give, if any; ties also count against a statement."""
    if n_for > MANY * total:
        return "supported"
    if n_tied > MANY * total:
        return "tie"
    return "contradicted" if n_against + n_tied > MANY * total else None


def _joined(outcomes: Sequence[Outcome], answer: Answer) -> Outcome:
    if len(outcomes) == 1:
        return outcomes[0]
    parts = tuple(leaf for outcome in outcomes for leaf in outcome.parts or (outcome,))
    effects = [part.effect for part in parts if part.answer == answer and np.isfinite(part.effect)]
    n_supported = sum(part.answer == "supported" for part in parts)
    effect = float(np.median(effects)) if effects else nan
    why = f"{n_supported} of {len(parts)} statements hold"
    return Outcome(answer, n_supported / len(parts), effect, min(part.n_runs for part in parts), why, parts)


def contrary(outcome: Outcome, supported: Answer = "contradicted") -> Outcome:
    """Return the outcome of the contrary statement, `supported` where this one is; open answers stay."""
    if outcome.parts:
        return all_of([contrary(part, supported) for part in outcome.parts])
    turned: dict[Answer, Answer] = {"supported": supported, "contradicted": "supported"}
    return replace(outcome, answer=turned.get(outcome.answer, outcome.answer))


def without(policies: Iterable[str]) -> Outcome:
    """Return the outcome where policies have no scores."""
    return Outcome("no scores", why=f"no scores of {' and '.join(policies)}")


# -------------------------------------------------------------------------------------------------------- two engines


def by_levels(
    panel: Panel,
    policies: Iterable[str],
    holds: BoolArray,
    fails: BoolArray,
    what: str,
    *,
    effect: float,
    tied: BoolArray | None = None,
    against: str = "do not",
) -> Outcome:
    """Return what most levels say: where a statement holds and fails, arrays of one shape.

    `tied`: where it fails only because what it compares ties.
    """
    n_runs = panel.n_runs(policies)
    if not n_runs:
        return without(policies)
    total, n_for, n_against = holds.size, int(holds.sum()), int(fails.sum())
    n_tied = 0 if tied is None else int(tied.sum())
    answer = _of_most(n_for, n_against - n_tied, n_tied, total=total) or "undecided"
    ties = f" ({n_tied} of them tie)" if n_tied else ""
    why = f"{n_for} of {total} {what}, {n_against} {against}{ties}, {total - n_for - n_against} open"
    return Outcome(answer, n_for / total, effect, n_runs, why)


def within(interval: tuple[float, float], low: float, high: float) -> Answer:
    """Return whether a number lies between two bounds, by its interval; a number without one has it at both ends."""
    lower, upper = interval
    if low <= lower and upper <= high:
        return "supported"
    return "contradicted" if upper < low or lower > high else "undecided"


def at_scored_levels(panel: Panel, policies: Names, rule: Rule) -> Panel | Outcome:
    """The panel at the levels with enough runs of policies, or the outcome if these are half of the levels or fewer."""
    counts = panel.runs_at_levels(policies)
    enough = counts >= LEAST_RUNS[rule]
    if not counts.any():
        return without(policies)
    if enough.mean() > MANY:
        return panel.at(enough)
    why = f"{(~enough).sum()} of {enough.size} levels have fewer than {LEAST_RUNS[rule]} runs with a score of "
    return Outcome("undecided", n_runs=panel.n_runs(policies), why=why + " and ".join(policies))


def of_curves(
    panel: Panel, groups: Iterable[Names], rule: Rule, judge: Callable[[Panel, FloatArray, Names], Outcome]
) -> Outcome:
    """What `judge` finds of each group of policies, which must all hold, at the levels with enough runs.

    `judge` takes the panel of these levels, the scores there, (P, L, R), and the policies.
    """

    def judged(policies: Names) -> Outcome:
        part = at_scored_levels(panel, policies, rule)
        if isinstance(part, Outcome):
            return part
        found = judge(part, part.of(policies), policies)
        n_out = panel.levels.size - part.levels.size
        left_out = f"; {n_out} of {panel.levels.size} levels left out: too few scores" if n_out else ""
        return replace(found, n_runs=part.n_runs(policies), why=found.why + left_out)

    return all_of([judged(policies) for policies in groups])


def alone(policies: Names) -> list[Names]:
    """Return each policy as a group of its own."""
    return [(policy,) for policy in policies]


# ------------------------------------------------------------------------------------------------- heights at levels


def ties(panel: Panel, *, pairs: Pairs, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether pairs of policies mostly tie: at more than half of the levels, all pairs counted together."""
    part, names = panel.part(levels), _names_in(pairs)
    found = order(part, pairs, rule)
    what = f"comparisons of {' and '.join(names)} tie"
    return by_levels(part, names, found == 0.0, np.abs(found) == 1.0, what, effect=_gap(part, pairs))


def differ(panel: Panel, *, pairs: Pairs, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether pairs of policies mostly differ: the contrary of `ties`."""
    return contrary(ties(panel, pairs=pairs, levels=levels, rule=rule), "tie")


def never_differ(panel: Panel, *, pairs: Pairs, n_panels: int = 1, rule: Rule = "intervals") -> Outcome:
    """Whether no pair of policies differs at any level.

    Supported if all comparisons tie. Contradicted if one differs: by intervals after Bonferroni's correction for the
    comparisons of `n_panels` panels, about which a claim says this, so that one difference by chance does not count.
    """
    names = _names_in(pairs)
    if not panel.n_runs(names):
        return without(names)
    found = order(panel, pairs, rule, n_tests=len(pairs) * panel.levels.size * n_panels)
    n_tied, n_apart = int((found == 0.0).sum()), int((np.abs(found) == 1.0).sum())
    answer: Answer = "contradicted" if n_apart else "supported" if n_tied == found.size else "undecided"
    why = f"{n_apart} of {found.size} comparisons differ, {n_tied} tie, {found.size - n_apart - n_tied} open"
    return Outcome(answer, n_apart / found.size, _gap(panel, pairs), panel.n_runs(names), why)


def _names_in(pairs: Pairs) -> list[str]:
    return sorted({name for pair in pairs for name in pair})


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


def is_higher(panel: Panel, *, upper: Names, lower: Names, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether each of some policies is higher than each of others, at more than half of the levels.

    A level counts against the statement if one of the pairs ties or has the opposite order. The answer is a tie if, at
    more than half of the levels, pairs tie and none has the opposite order.
    """
    part = panel.part(levels)
    found = order(part, tuple(product(upper, lower)), rule)
    return by_levels(
        part,
        (*upper, *lower),
        np.all(found == 1.0, axis=0),
        np.any(found <= 0.0, axis=0),
        f"levels have {' and '.join(upper)} above {' and '.join(lower)}",
        effect=_lead(part, upper, lower),
        tied=np.any(found == 0.0, axis=0) & ~np.any(found < 0.0, axis=0),
    )


def is_not_higher(panel: Panel, *, first: str, second: str, rule: Rule = "intervals") -> Outcome:
    """Whether a policy is no higher than another: lower or tied at more than half of the levels."""
    (found,) = order(panel, ((first, second),), rule)
    what, effect = f"levels have {first} no higher than {second}", _lead(panel, (first,), (second,))
    return by_levels(panel, (first, second), found <= 0.0, found == 1.0, what, effect=effect)


def _lead(panel: Panel, upper: Names, lower: Names) -> float:
    """Mean over policies and levels of some less that of others, as a share of the scale."""
    gap = mean_over_runs(panel.of(upper)).mean(axis=0) - mean_over_runs(panel.of(lower)).mean(axis=0)
    return float(mean_over_runs(gap)) / panel.scale


def leads_by_little(
    panel: Panel, *, leader: str, others: Names, levels: Levels = "all", rule: Rule = "intervals"
) -> Outcome:
    """Whether a policy is highest by a little, at more than half of the levels.

    Its lead over each of the others must surely be above 0, but may be smaller than `TIE`. Its lead over the best of
    them must be at most `FLAT` of the scale. A level counts against the statement if another policy is surely higher,
    or if the lead is surely larger than `FLAT`. By intervals, "surely" means the whole interval. By bands, it means
    that bands do not overlap, and the lead is the difference of the means.
    """
    part = panel.part(levels)
    pairs, limit = [(leader, other) for other in others], FLAT * part.scale
    means = mean_over_runs(part.of((leader, *others)))
    gaps: FloatArray = means[0] - means[1:]
    if rule == "intervals":
        ends = np.array([intervals_of(part, pair, part.confidence) for pair in pairs])  # (others, L, 2)
    else:
        apart = order(part, pairs, rule)
        ends = np.stack(
            [np.where(apart > 0.0, gaps, -inf), np.where(apart < 0.0, gaps, np.maximum(gaps, 0.0))], axis=-1
        )
    lower, upper = ends[..., 0], ends[..., 1]
    return by_levels(
        part,
        (leader, *others),
        np.all(lower > 0.0, axis=0) & (upper.min(axis=0) <= limit),
        np.any(upper < 0.0, axis=0) | np.all(lower > limit, axis=0),
        f"levels have {leader} above {' and '.join(others)} by at most {FLAT:g} of the scale",
        effect=float(mean_over_runs(gaps.min(axis=0))) / part.scale,
    )


# ------------------------------------------------------------------------------------------------------ single curves


def is_constant(panel: Panel, *, policies: Names, rule: Rule = "intervals") -> Outcome:
    """Whether each policy is roughly constant over the levels, or over all but one of `MIN_CONSTANT` or more.

    One wild level does not decide for all others, but a fall over several levels does. By intervals: the largest mean
    less the smallest is at most `FLAT` of the scale. By bands: one height lies within the bands of all these levels.
    """

    def judge(part: Panel, scores: FloatArray, names: Names) -> Outcome:
        (values,), (policy,) = scores, names
        means, drawn = resampled_means(values, part.confidence)
        every = np.ones((1, means.size), dtype=np.bool_)
        kept = list(every if means.size < MIN_CONSTANT else every ^ np.eye(means.size, dtype=np.bool_))
        spreads = np.array([np.ptp(means[some]) for some in kept]) / part.scale
        spread, where = float(spreads.min()), "all levels" + (" but one" if len(kept) > 1 else "")
        if rule == "bands":
            reach = 2.0 * std_over_runs(values)
            shared = any((means + reach)[some].min() >= (means - reach)[some].max() for some in kept)
            why = f"the bands of {policy} at {where} have {'a height in common' if shared else 'no common height'}"
            return Outcome("supported" if shared else "contradicted", spread, spread, why=why)
        # The spread of noisy means is too large, so its percentiles would be, too. The spread of what the runs add by
        # chance bounds it from both sides, for each choice of levels: a wild level may scatter more than the others.
        chances = [np.quantile(np.ptp((drawn - means)[:, some], axis=-1), CONFIDENCE) / part.scale for some in kept]
        interval = (max(0.0, float((spreads - chances).min())), float((spreads + chances).min()))
        why = f"means of {policy} at {where} spread over {spread:.2f} of the scale ({_ends(interval)}); {FLAT:g} is "
        return Outcome(within(interval, -inf, FLAT), spread, spread, why=why + "still constant")

    return of_curves(panel, alone(policies), rule, judge)


def varies(panel: Panel, *, policies: Names, rule: Rule = "intervals") -> Outcome:
    """Whether each policy varies with the level: the contrary of `is_constant` for each."""
    return contrary(is_constant(panel, policies=policies, rule=rule))


def is_narrow(panel: Panel, *, policies: Names, rule: Rule = "intervals") -> Outcome:
    """Whether the bands of policies, four standard deviations wide, are at most `FLAT` of the scale at most levels.

    By intervals, the rule looks at the median width over the levels, which one wild level does not change.
    """

    def judge(part: Panel, scores: FloatArray, names: Names) -> Outcome:
        (values,), (policy,) = scores, names
        found, drawn = resampled_deviations(values, part.confidence)
        width = 4.0 * float(np.median(found)) / part.scale
        if rule == "bands":
            share = float((4.0 * std_over_runs(values) / part.scale <= FLAT).mean())
            why = f"bands of {policy} are at most {FLAT:g} of the scale wide at {share:.0%} of levels"
            return Outcome("supported" if share > MANY else "contradicted", width, width, why=why)
        interval = bounds(4.0 * np.median(drawn, axis=-1) / part.scale)
        why = f"bands of {policy} are {width:.2f} of the scale wide ({_ends(interval)}); {FLAT:g} is still narrow"
        return Outcome(within(interval, -inf, FLAT), width, width, why=why)

    return of_curves(panel, alone(policies), rule, judge)


def is_wide(panel: Panel, *, policies: Names, rule: Rule = "intervals") -> Outcome:
    """Whether the bands of policies are wider than this: the contrary of `is_narrow` for each."""
    return contrary(is_narrow(panel, policies=policies, rule=rule))


def is_wider(panel: Panel, *, upper: Names, lower: Names, rule: Rule = "intervals") -> Outcome:
    """Whether the runs of each of some policies scatter more than the runs of each of others.

    By intervals: in the median over the levels. By bands: the band is `WIDER` times as wide at more than half of the
    levels. Contradicted if this holds for the other policy, else undecided.
    """

    def judge(part: Panel, values: FloatArray, names: Names) -> Outcome:
        found, drawn = resampled_deviations(values, part.confidence)
        if rule == "intervals":
            return _larger(part, names, found, drawn, "scatter")
        what = f"levels have the band of {names[0]} {WIDER:g} times as wide as that of {names[1]}"
        (a, b), effect = found, float((found[0] - found[1]).mean()) / part.scale
        return by_levels(part, names, a >= WIDER * b, b >= WIDER * a, what, effect=effect, against="the reverse")

    return of_curves(panel, tuple(product(upper, lower)), rule, judge)


def reaches_higher(panel: Panel, *, upper: Names, lower: Names, rule: Rule = "intervals") -> Outcome:
    """Whether the upper edges of the bands of some policies are above the upper edges of others.

    By intervals: in the median over the levels. By bands: the edge is above the other by `TIE` of the scale at more
    than half of the levels. Contradicted if this holds for the other policy, else undecided.
    """

    def judge(part: Panel, values: FloatArray, names: Names) -> Outcome:
        means, drawn = resampled_means(values, part.confidence)
        widths, drawn_widths = resampled_deviations(values, part.confidence)
        edges = means + 2.0 * widths
        if rule == "intervals":
            return _larger(part, names, edges, drawn + 2.0 * drawn_widths, "upper edge")
        gap = (edges[0] - edges[1]) / part.scale
        what = f"levels have the upper edge of {names[0]} {TIE:g} of the scale above that of {names[1]}"
        return by_levels(part, names, gap >= TIE, gap <= -TIE, what, effect=float(gap.mean()), against="the reverse")

    return of_curves(panel, tuple(product(upper, lower)), rule, judge)


def _larger(panel: Panel, names: Names, found: FloatArray, drawn: FloatArray, what: str) -> Outcome:
    """Whether a number at levels, (2, L), is larger for the first policy, in their median."""
    gap = float(np.median(found[0] - found[1])) / panel.scale
    interval = bounds(np.median(drawn[:, 0] - drawn[:, 1], axis=-1) / panel.scale)
    why = f"{what} of {names[0]} less that of {names[1]} is {gap:.2f} of the scale ({_ends(interval)}); "
    return Outcome(within(interval, 0.0, inf), gap, gap, why=why + "above 0 it is larger")


def _ends(interval: tuple[float, float]) -> str:
    return f"{interval[0]:.2f} to {interval[1]:.2f}"


# ----------------------------------------------------------------------------------------------------------- formulas


def availability_is(*, n: int, n_min: int, team: float, expected: float, within: float) -> Outcome:
    """Whether the availability of n_min of n robots with a mean team at work has an expected value, up to rounding."""
    p_v = availability(n, n_min, ratio_for_team(team))
    why = f"availability of {n_min} of {n} robots, mean team {team:g}, is {p_v:.4f}"
    return Outcome("supported" if abs(p_v - expected) <= within else "contradicted", p_v, why=why)


def is_less_available(*, few: int, many: int, needed: Sequence[tuple[int, int]], team: float) -> Outcome:
    """Whether a second swarm is less available than the first with the same mean team at work, for all robots needed.

    It then needs a larger team for the same availability. Availability is 1 where no robot is needed, so the curve of
    the second swarm has also dropped more steeply. `needed` has pairs: robots needed of the first and of the second.
    """
    ratio = ratio_for_team(team)
    robots = dict(zip((few, many), zip(*needed, strict=True), strict=True))
    found = {n: [availability(n, n_min, ratio) for n_min in robots[n]] for n in (many, few)}
    share = float(np.mean(np.array(found[many]) < found[few]))
    told = (
        f"{', '.join(f'{p_v:.4f}' for p_v in of)} for {', '.join(map(str, robots[n]))} of {n}"
        for n, of in found.items()
    )
    why = f"{'; '.join(told)}; mean team {team:g}"
    return Outcome("supported" if share == 1.0 else "contradicted", share, why=why)
