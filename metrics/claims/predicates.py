"""What a claim can say of curves in a figure: few general statements, each with one of three answers.

A statement about several levels is supported if it holds at more than half of them and contradicted if it fails at more
than half; else it is undecided. The thresholds are the same for every claim, and none was chosen with results in view.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from metrics.checks import check_option
from metrics.curves import FloatArray

from .panel import (
    MIN_PAIRS,
    Levels,
    Panel,
    Rule,
    bounds,
    mean_over_runs,
    of_equal_runs,
    resampled_runs,
    signs,
    std_over_runs,
)

Answer: TypeAlias = Literal["supported", "contradicted", "undecided"]
BoolArray: TypeAlias = NDArray[np.bool_]
Pairs: TypeAlias = Sequence[tuple[str, str]]

FLAT = 0.25
"""Largest spread of a curve that is roughly constant, and largest width of a narrow band, as a share of the panel's
scale (our choice)."""
LINEAR = 0.9
"""Share of the variance between levels that a line explains where growth is nearly linear (our choice)."""
MANY = 0.5
"""Share of levels that is most of them."""
MORE = 0.1
"""Share of comparisons by which one panel has more differences than another (our choice)."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one statement."""

    answer: Answer
    statistic: float
    """What was decided on; `why` says what it is."""
    effect: float
    """Size of the difference or change, as a share of the panel's scale; NaN where a statement has none."""
    n_runs: int
    """Smallest number of runs behind any number that was used."""
    why: str


def ties(panel: Panel, *, pairs: Pairs, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether pairs of policies mostly tie: at more than half of the levels, all pairs counted together."""
    part = panel.part(levels)
    found = np.array([signs(part, first, second, rule) for first, second in pairs])
    gaps = np.array([part.scores[a] - part.scores[b] for a, b in pairs])
    return _by_majority(
        found == 0.0,
        np.abs(found) == 1.0,
        "comparisons tie",
        effect=float(mean_over_runs(np.abs(mean_over_runs(gaps)).ravel())) / part.scale,
        n_runs=part.n_runs({name for pair in pairs for name in pair}),
    )


def stays_alike(first: Panel, second: Panel, *, policy: str, rule: Rule = "intervals") -> Outcome:
    """Whether a policy scores alike in two panels of the same levels and runs: it ties with itself at most levels."""
    both = Panel(levels=first.levels, scores={"first": first.scores[policy], "second": second.scores[policy]})
    outcome = ties(both, pairs=(("first", "second"),), rule=rule)
    return replace(outcome, why=f"{policy} in both panels: {outcome.why}")


def differ(panel: Panel, *, pairs: Pairs, levels: Levels = "all", rule: Rule = "intervals") -> Outcome:
    """Whether pairs of policies mostly differ; the contrary of `ties`."""
    return contrary(ties(panel, pairs=pairs, levels=levels, rule=rule))


def is_higher(
    panel: Panel, *, upper: Sequence[str], lower: Sequence[str], levels: Levels = "all", rule: Rule = "intervals"
) -> Outcome:
    """Whether each of some policies is higher than each of others, at more than half of the levels.

    A level speaks against it if one of the pairs ties or is the other way round.
    """
    part = panel.part(levels)
    found = np.array([signs(part, above, below, rule) for above in upper for below in lower])
    gap = mean_over_runs(part.of(upper)).mean(axis=0) - mean_over_runs(part.of(lower)).mean(axis=0)
    return _by_majority(
        np.all(found == 1.0, axis=0),
        np.any(found <= 0.0, axis=0),
        f"levels have {' and '.join(upper)} above {' and '.join(lower)}",
        effect=float(mean_over_runs(gap)) / part.scale,
        n_runs=part.n_runs((*upper, *lower)),
    )


def is_not_higher(
    panel: Panel, *, first: str, second: str, levels: Levels = "all", rule: Rule = "intervals"
) -> Outcome:
    """Whether a policy is no higher than another: lower or tied at more than half of the levels."""
    part = panel.part(levels)
    found = signs(part, first, second, rule)
    gap = mean_over_runs(part.scores[first]) - mean_over_runs(part.scores[second])
    return _by_majority(
        found <= 0.0,
        found == 1.0,
        f"levels have {first} no higher than {second}",
        effect=float(mean_over_runs(gap)) / part.scale,
        n_runs=part.n_runs((first, second)),
    )


def is_constant(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether each policy is roughly constant over the levels.

    By intervals: its largest less its smallest mean is at most `FLAT` of the scale. By bands: one height lies within
    the bands of all levels.
    """
    return all_of([_constancy(panel, policy, rule) for policy in policies])


def varies(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether each policy varies with the level: for each the contrary of `is_constant`."""
    return all_of([contrary(_constancy(panel, policy, rule)) for policy in policies])


def is_narrow(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the bands of policies, four standard deviations wide, are at most `FLAT` of the scale, mean of levels."""
    return all_of([_narrowness(panel, policy, rule) for policy in policies])


def is_wide(panel: Panel, *, policies: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the bands of policies are wider than that; for each the contrary of `is_narrow`."""
    return all_of([contrary(_narrowness(panel, policy, rule)) for policy in policies])


def is_wider(panel: Panel, *, upper: Sequence[str], lower: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether each of some policies scatters more between runs than each of others."""
    return all_of([_compared(panel, a, b, std_over_runs, "scatter", rule) for a in upper for b in lower])


def reaches_higher(panel: Panel, *, upper: Sequence[str], lower: Sequence[str], rule: Rule = "intervals") -> Outcome:
    """Whether the upper edges of the bands of some policies are above those of others."""

    def edge(values: FloatArray) -> FloatArray:
        return mean_over_runs(values) + 2.0 * std_over_runs(values)

    return all_of([_compared(panel, a, b, edge, "upper edge", rule) for a in upper for b in lower])


def differs_more(few: Panel, many: Panel, *, pairs: Pairs, rule: Rule = "intervals") -> Outcome:
    """Whether the second panel has more pairs and levels that differ than the first, by `MORE` of all comparisons.

    Of both, equally many runs are looked at: as many as the panel with fewer of them has.
    """
    names = {name for pair in pairs for name in pair}
    shares: list[float] = []
    equal = of_equal_runs(few, many, names)
    for panel in equal:
        found = np.array([signs(panel, first, second, rule) for first, second in pairs])
        shares.append(float((np.abs(found) == 1.0).mean()))
    gain, n_runs = shares[1] - shares[0], equal[0].n_runs(names)
    answer: Answer = "supported" if gain >= MORE else "contradicted" if gain <= -MORE else "undecided"
    if n_runs < (2 if rule == "bands" else MIN_PAIRS):
        answer = "undecided"
    why = f"{shares[1]:.0%} of the comparisons differ, {shares[0]:.0%} in the first panel, of {n_runs} runs each"
    return Outcome(answer=answer, statistic=gain, effect=np.nan, n_runs=n_runs, why=why)


def against_limit(resampled: FloatArray, limit: float) -> Answer:
    """Return whether the interval of a resampled number is at or below a limit (supported) or above (contradicted)."""
    lower, upper = bounds(resampled)
    return "supported" if upper <= limit else "contradicted" if lower > limit else "undecided"


def contrary(outcome: Outcome) -> Outcome:
    """Return the outcome of the contrary statement; what is undecided stays so."""
    turned: dict[Answer, Answer] = {"supported": "contradicted", "contradicted": "supported", "undecided": "undecided"}
    return replace(outcome, answer=turned[outcome.answer])


def all_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return one outcome for several statements that must all hold: one that fails contradicts them."""
    answers = [outcome.answer for outcome in outcomes]
    answer: Answer = "supported" if set(answers) == {"supported"} else "undecided"
    return _joined(outcomes, "contradicted" if "contradicted" in answers else answer)


def most_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return one outcome for several statements of which more than half must hold."""
    answers = [outcome.answer for outcome in outcomes]
    choices: tuple[Answer, Answer] = ("supported", "contradicted")
    most: list[Answer] = [choice for choice in choices if answers.count(choice) > MANY * len(answers)]
    answer: Answer = most[0] if most else "undecided"
    return _joined(outcomes, answer)


def _joined(outcomes: Sequence[Outcome], answer: Answer) -> Outcome:
    """The outcome that speaks loudest for the answer, with the reasons of all."""
    if len(outcomes) == 1:
        return outcomes[0]
    speaking = [outcome for outcome in outcomes if outcome.answer == answer] or list(outcomes)
    return Outcome(
        answer=answer,
        statistic=sum(outcome.answer == "supported" for outcome in outcomes) / len(outcomes),
        effect=speaking[0].effect,
        n_runs=min(outcome.n_runs for outcome in outcomes),
        why="; ".join(f"{outcome.answer}: {outcome.why}" for outcome in outcomes),
    )


def _by_majority(holds: BoolArray, fails: BoolArray, what: str, *, effect: float, n_runs: int) -> Outcome:
    """Outcome of a statement from where it holds and where it fails, boolean arrays of the same shape."""
    total, n_for, n_against = holds.size, int(holds.sum()), int(fails.sum())
    answer: Answer = "supported" if n_for > MANY * total else "undecided"
    if n_against > MANY * total:
        answer = "contradicted"
    why = f"{n_for} of {total} {what}, {n_against} do not, {total - n_for - n_against} open"
    return Outcome(answer=answer, statistic=n_for / total, effect=effect, n_runs=n_runs, why=why)


def _constancy(panel: Panel, policy: str, rule: Rule) -> Outcome:
    check_option("rule", rule, Rule)
    (values,) = panel.of((policy,))
    means, deviations = mean_over_runs(values), std_over_runs(values)
    spread = float(means.max() - means.min()) / panel.scale
    n_runs = panel.n_runs((policy,))
    answer: Answer = "undecided"
    if rule == "bands" and n_runs > 1:
        is_flat = (means - 2.0 * deviations).max() <= (means + 2.0 * deviations).min()
        answer = "supported" if is_flat else "contradicted"
    elif rule == "intervals" and (drawn := resampled_runs(values)) is not None:
        resampled = mean_over_runs(drawn)
        answer = against_limit((resampled.max(axis=1) - resampled.min(axis=1)) / panel.scale, FLAT)
    why = f"means of {policy} spread over {spread:.2f} of the scale"
    return Outcome(answer=answer, statistic=spread, effect=spread, n_runs=n_runs, why=why)


def _narrowness(panel: Panel, policy: str, rule: Rule) -> Outcome:
    check_option("rule", rule, Rule)
    (values,) = panel.of((policy,))
    widths = 4.0 * std_over_runs(values) / panel.scale
    width, n_runs = float(widths.mean()), panel.n_runs((policy,))
    answer: Answer = "undecided"
    if rule == "bands" and n_runs > 1:
        answer = "supported" if (widths <= FLAT).mean() > MANY else "contradicted"
    elif rule == "intervals" and (drawn := resampled_runs(values)) is not None:
        answer = against_limit(4.0 * std_over_runs(drawn).mean(axis=1) / panel.scale, FLAT)
    why = f"bands of {policy} are {width:.2f} of the scale wide"
    return Outcome(answer=answer, statistic=width, effect=width, n_runs=n_runs, why=why)


def _compared(
    panel: Panel, first: str, second: str, of_runs: Callable[[FloatArray], FloatArray], what: str, rule: Rule
) -> Outcome:
    """Whether a statistic of the runs is larger for the first policy; by intervals its mean over the levels."""
    check_option("rule", rule, Rule)
    both = panel.of((first, second))
    at_levels = of_runs(both)
    gap = float((at_levels[0] - at_levels[1]).mean()) / panel.scale
    n_runs = panel.n_runs((first, second))
    answer: Answer = "undecided"
    if rule == "bands" and n_runs > 1:
        answer = "supported" if (at_levels[0] > at_levels[1]).mean() > MANY else "contradicted"
    elif rule == "intervals" and (drawn := resampled_runs(both)) is not None:
        resampled = of_runs(drawn).mean(axis=2)
        answer = against_limit((resampled[:, 1] - resampled[:, 0]) / panel.scale, 0.0)
    why = f"{what} of {first} less that of {second} is {gap:.2f} of the scale"
    return Outcome(answer=answer, statistic=gap, effect=gap, n_runs=n_runs, why=why)


def every_pair(policies: Sequence[str]) -> Pairs:
    """Return all pairs of policies."""
    return tuple(combinations(policies, 2))
