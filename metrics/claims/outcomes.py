"""The answer to one statement, and how the answers to several become one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..checks import check_option
from .panel import LEAST_RUNS, MANY, Panel, Rule

Answer: TypeAlias = Literal["supported", "contradicted", "tie", "too vague", "undecided", "no scores"]
"""`tie`: the claim says that there is a difference, but what it compares ties. `too vague`: its text does not say which
runs would contradict it, so the rule does not look at runs. `undecided`: the runs leave it open. `no scores`: runs are
missing, or a measure does not have a finite value."""
BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The answer to one statement or to several, with its reason."""

    answer: Answer
    statistic: float
    """Number that decides; `why` says what it is."""
    effect: float
    """Size of the difference or change, as a share of the panel's scale; NaN where a statement has none."""
    n_runs: int
    """Smallest number of runs behind any number that the rule used."""
    why: str
    """What the rule found, and what it compared this with."""
    parts: tuple["Outcome", ...] = field(default=(), repr=False)
    """The outcomes of the single statements, if there are several."""

    @property
    def lines(self) -> tuple[str, ...]:
        """The reasons: one line, or one per part with its answer."""
        return tuple(f"{part.answer}: {part.why}" for part in self.parts) or (self.why,)


def without_scores(what: str) -> Outcome:
    """Return the outcome of a statement about something that has no scores."""
    return Outcome(answer="no scores", statistic=np.nan, effect=np.nan, n_runs=0, why=f"no scores of {what}")


def scored_levels(panel: Panel, policies: Sequence[str], rule: Rule) -> Panel | Outcome:
    """Return the panel with the levels at which all of some policies have enough runs, if they are most of the levels.

    Args:
        panel: All levels.
        policies: Policies that must have scores.
        rule: Decides how many runs are enough.

    Returns:
        The panel, or the outcome of a statement about it if half of the levels or more have too few runs.
    """
    check_option("rule", rule, Rule)
    counts = panel.runs_at_levels(policies)
    enough = counts >= LEAST_RUNS[rule]
    names = " and ".join(policies)
    if not counts.any():
        return without_scores(names)
    if enough.mean() > MANY:
        return panel.at(enough)
    why = f"{(~enough).sum()} of {enough.size} levels have fewer than {LEAST_RUNS[rule]} runs with a score of {names}"
    n_runs = panel.n_runs(policies)
    return Outcome(answer="undecided", statistic=np.nan, effect=np.nan, n_runs=n_runs, why=why)


def where_scored(panel: Panel, policies: Sequence[str], rule: Rule, judge: Callable[[Panel], Outcome]) -> Outcome:
    """Return what `judge` finds in the `scored_levels`; the reason says how many levels are left out."""
    part = scored_levels(panel, policies, rule)
    if isinstance(part, Outcome):
        return part
    outcome, n_out = judge(part), panel.levels.size - part.levels.size
    if n_out == 0:
        return outcome
    return replace(outcome, why=f"{outcome.why}; {n_out} of {panel.levels.size} levels left out: too few scores")


def within_limit(interval: tuple[float, float], limit: float) -> Answer:
    """Return whether an interval is at or below a limit (supported) or above (contradicted)."""
    lower, upper = interval
    return "supported" if upper <= limit else "contradicted" if lower > limit else "undecided"


def contrary(outcome: Outcome) -> Outcome:
    """Return the outcome of the contrary statement; answers other than supported and contradicted stay."""
    turned: dict[Answer, Answer] = {"supported": "contradicted", "contradicted": "supported"}
    return replace(outcome, answer=turned.get(outcome.answer, outcome.answer))


def all_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return one outcome for several statements that must all hold: a single one that fails or ties decides."""
    answers = [outcome.answer for outcome in outcomes]
    order: tuple[Answer, ...] = ("contradicted", "tie", "no scores", "undecided", "supported")
    return _joined(outcomes, next(answer for answer in order if answer in answers))


def most_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return one outcome for several statements of which more than half must hold."""
    answers = [outcome.answer for outcome in outcomes]
    counts = [answers.count(answer) for answer in ("supported", "contradicted", "tie")]
    answer: Answer = "no scores" if "no scores" in answers else "undecided"
    return _joined(outcomes, _of_most(*counts, total=len(answers)) or answer)


def _of_most(n_for: int, n_against: int, n_tied: int, *, total: int) -> Answer | None:
    """The answer that more than half of the votes give, if any; ties also count against a statement."""
    if n_for > MANY * total:
        return "supported"
    if n_tied > MANY * total:
        return "tie"
    return "contradicted" if n_against + n_tied > MANY * total else None


def _joined(outcomes: Sequence[Outcome], answer: Answer) -> Outcome:
    """One outcome: its statistic is the share of supported parts, its effect the median of parts with this answer."""
    if len(outcomes) == 1:
        return outcomes[0]
    parts = tuple(leaf for outcome in outcomes for leaf in outcome.parts or (outcome,))
    effects = [part.effect for part in parts if part.answer == answer and np.isfinite(part.effect)]
    n_supported = sum(part.answer == "supported" for part in parts)
    return Outcome(
        answer=answer,
        statistic=n_supported / len(parts),
        effect=float(np.median(effects)) if effects else np.nan,
        n_runs=min(part.n_runs for part in parts),
        why=f"{n_supported} of {len(parts)} statements hold",
        parts=parts,
    )


def by_majority(
    holds: BoolArray,
    fails: BoolArray,
    what: str,
    *,
    effect: float,
    n_runs: int,
    against: str = "do not",
    tied: BoolArray | None = None,
) -> Outcome:
    """Outcome of a statement from where it holds and where it fails, boolean arrays of the same shape.

    `tied`: where it fails only because what it compares ties.
    """
    total, n_for, n_against = holds.size, int(holds.sum()), int(fails.sum())
    n_tied = 0 if tied is None else int(tied.sum())
    answer = _of_most(n_for, n_against - n_tied, n_tied, total=total) or "undecided"
    ties = f" ({n_tied} of them tie)" if n_tied else ""
    why = f"{n_for} of {total} {what}, {n_against} {against}{ties}, {total - n_for - n_against} open"
    return Outcome(answer=answer, statistic=n_for / total, effect=effect, n_runs=n_runs, why=why)
