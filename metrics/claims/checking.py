"""Claims held against scores: which statements a claim makes of which panels, and the verdict on it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np

from .panel import Panel, Rule
from .predicates import Answer, Outcome, all_of, most_of

PanelName: TypeAlias = tuple[str, str]
"""Experiment, a name in `EXPERIMENTS`, and measure, a name in `METRICS`."""


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One statement about one panel or two."""

    predicate: Callable[..., Outcome]
    """Called with the panels and the parameters."""
    panels: tuple[PanelName, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])
    views: tuple[Callable[[Panel], Panel], ...] = ()
    """Applied to each panel first, in this order: its rise, its slope, ..."""

    def outcome(self, panels: Mapping[PanelName, Panel], rule: Rule) -> Outcome:
        """Return what comes of it; undecided where scores are missing."""
        absent = [" ".join(name) for name in self.panels if name not in panels]
        if absent:
            why = f"no scores of {', '.join(absent)}"
            return Outcome(answer="undecided", statistic=np.nan, effect=np.nan, n_runs=0, why=why)
        seen = [panels[name] for name in self.panels]
        for view in self.views:
            seen = [view(panel) for panel in seen]
        rules = {"rule": rule} if seen else {}  # what follows from formulas alone has no runs to compare
        return self.predicate(*seen, **self.parameters, **rules)


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim: the statements that it consists of."""

    name: str
    text: str
    """What is claimed, in our words."""
    figure: str
    """Where it is shown."""
    statements: tuple[Statement, ...]
    needs: Literal["all", "most"] = "all"
    """How many of the statements must hold."""

    @property
    def panels(self) -> tuple[PanelName, ...]:
        """Experiments and measures that are needed, each once."""
        return tuple(dict.fromkeys(name for statement in self.statements for name in statement.panels))


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What scores say of a claim."""

    claim: str
    answer: Answer
    """By paired bootstrap intervals, our rule."""
    by_bands: Answer
    """By overlapping bands of two standard deviations, the paper's rule."""
    statistic: float
    """What was decided on, by our rule; `why` says what it is."""
    effect: float
    """Size of the difference or change, as a share of the largest mean in the panel; NaN where there is none."""
    n_runs: int
    """Smallest number of runs behind any number that was used; 0 for formulas and missing scores."""
    why: str


def check_claim(claim: Claim, panels: Mapping[PanelName, Panel]) -> Verdict:
    """Hold one claim against scores.

    Args:
        claim: One of `CLAIMS`, or of your own.
        panels: (experiment, measure) -> scores of all policies. Statements whose panels are missing are undecided.

    Raises:
        CurveError: A panel lacks a policy that the claim speaks of.
    """
    join = all_of if claim.needs == "all" else most_of
    rules: tuple[Rule, Rule] = ("intervals", "bands")
    ours, bands = (join([statement.outcome(panels, rule) for statement in claim.statements]) for rule in rules)
    return Verdict(
        claim=claim.name,
        answer=ours.answer,
        by_bands=bands.answer,
        statistic=ours.statistic,
        effect=ours.effect,
        n_runs=ours.n_runs,
        why=ours.why,
    )
