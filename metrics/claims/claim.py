"""Claims compared with scores: which statements a claim makes about which panels, and the verdict on it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple, cast

from ..controllers import PAPER_POLICIES
from ..curves import Form
from .panel import Panel, Rule, judged_together
from .rules import Answer, Outcome, all_of, most_of


class PanelName(NamedTuple):
    """What a panel shows."""

    experiment: str
    """Name in `EXPERIMENTS`."""
    measure: str
    """Name of the measure."""
    form: Form = "marginal"
    """Form of a measure that compares two sizes: with the next smaller swarm, or with lone robots."""
    is_relative: bool = False
    """Whether scores are divided by the performance that they are compared with."""
    of_mean_curves: bool = False
    """Whether it shows the measure of mean curves, so that chance adds less to distances."""

    @property
    def words(self) -> str:
        """The name for people."""
        relative, means = "relative" if self.is_relative else "", "of mean curves" if self.of_mean_curves else ""
        words = (self.experiment, self.measure, "" if self.form == "marginal" else self.form, relative, means)
        return " ".join(word for word in words if word).replace("_", " ")


DISTANCES = ("reactivity", "adaptability", "noise_robustness")
RELATIVE_TOO = (*DISTANCES, "population_robustness")
"""Measures in amounts of performance, which rank policies by how much they do. Claims about them are also judged
relative to performance."""
RELATIVE = "relative to performance"
"""Name of these verdicts among the others."""


def _relative(name: PanelName) -> PanelName:
    return name._replace(is_relative=True) if name.measure in RELATIVE_TOO else name


def _of_mean_curves(name: PanelName) -> PanelName:
    return name._replace(of_mean_curves=True) if name.measure in DISTANCES else name


def _recorded(name: PanelName) -> PanelName:
    is_expected = name.measure == "population_robustness"
    return name._replace(measure=f"recorded_{name.measure}") if is_expected else name


READINGS: Mapping[str, Callable[[PanelName], PanelName]] = {
    RELATIVE: _relative,
    "of mean curves": _of_mean_curves,
    f"of mean curves, {RELATIVE}": lambda name: _of_mean_curves(_relative(name)),
    "with the robots recorded at work": _recorded,
    f"with the robots recorded at work, {RELATIVE}": lambda name: _recorded(_relative(name)),
}
"""Another reading of measures, in words -> function from the name of a panel to the name of the panel in this reading.
It returns the same name if the panel does not have this reading."""


@dataclass(frozen=True)
class Statement:
    """One statement about one or two panels."""

    rule: Callable[..., Outcome]
    """Called with the panels and the parameters."""
    panels: tuple[PanelName, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])
    views: tuple[Callable[[Panel], Panel], ...] = ()
    """Functions that change each panel first, in this order: to its rise, its slope, ..."""

    @property
    def policies(self) -> tuple[str, ...]:
        """Policies of the paper that its parameters name, also in nested lists."""
        return tuple(name for name in PAPER_POLICIES if name in _words_in(list(self.parameters.values())))

    def outcome(self, panels: Mapping[PanelName, Panel], rule: Rule) -> Outcome:
        """Return the answer to it; the reason names the panels."""
        absent = [name.words for name in self.panels if name not in panels]
        if absent:
            return Outcome("no scores", why=f"no scores of {', '.join(absent)}")
        seen = judged_together([panels[name] for name in self.panels], self.policies)
        for view in self.views:
            seen = [view(panel) for panel in seen]
        rules = {"rule": rule} if seen else {}  # what follows from formulas alone has no runs to compare
        outcome = self.rule(*seen, **self.parameters, **rules)
        return _placed(outcome, " and ".join(name.words for name in self.panels)) if seen else outcome


def _words_in(value: Any) -> set[str]:
    if isinstance(value, str):
        return {value}
    entries = cast("Sequence[Any]", value) if isinstance(value, list | tuple) else ()
    return {word for entry in entries for word in _words_in(entry)}


def _placed(outcome: Outcome, where: str) -> Outcome:
    """Return the outcome with the place before its reason, or before the reasons of its parts."""
    parts = tuple(_placed(part, where) for part in outcome.parts)
    return replace(outcome, parts=parts, why=outcome.why if parts else f"{where}: {outcome.why}")


@dataclass(frozen=True)
class Claim:
    """One claim: the statements that it consists of."""

    name: str
    text: str
    """What is claimed, in our words."""
    figure: str
    """Figure of the paper that shows it."""
    statements: tuple[Statement, ...] = ()
    needs: Literal["all", "most"] = "all"
    """How many of the statements must hold."""
    otherwise: Mapping[str, tuple[Statement, ...]] = field(default_factory=dict[str, tuple[Statement, ...]])
    """Another meaning of the claim, in words -> its statements. The paper's text, captions, file names or program
    disagree on what such a claim means."""
    vague: str = ""
    """Why no run can answer the claim, which its text alone shows; empty for a claim with statements."""

    @property
    def panels(self) -> tuple[PanelName, ...]:
        """Panels that its statements need, each once; `other_panels` has those of `otherwise`."""
        return _panels_of(self.statements)

    @property
    def other_panels(self) -> tuple[PanelName, ...]:
        """Panels that only `otherwise` needs."""
        needed = _panels_of([statement for statements in self.otherwise.values() for statement in statements])
        return tuple(name for name in needed if name not in self.panels)


def read_otherwise(claim: Claim) -> dict[str, Claim]:
    """Return the claim in each of `READINGS` that changes it, by the words of the reading."""
    found: dict[str, Claim] = {}
    for words, read in READINGS.items():
        statements = tuple(replace(one, panels=tuple(map(read, one.panels))) for one in claim.statements)
        if all(statements != other.statements for other in (claim, *found.values())):
            found[words] = replace(claim, statements=statements, otherwise={})
    return found


def _panels_of(statements: Iterable[Statement]) -> tuple[PanelName, ...]:
    return tuple(dict.fromkeys(name for statement in statements for name in statement.panels))


@dataclass(frozen=True, kw_only=True)
class Verdict(Outcome):
    """What scores say about a claim: by intervals, our rule, if nothing else is said.

    `why` has one line per statement.
    """

    claim: str
    by_bands: Answer
    """Answer by bands of two standard deviations that overlap or not, the paper's rule."""
    otherwise: Mapping[str, "Verdict"] = field(default_factory=dict[str, "Verdict"])
    """Verdicts on other meanings of the claim and on its other readings (`READINGS`), where there are scores."""


def check_claim(claim: Claim, panels: Mapping[PanelName, Panel] | Mapping[tuple[str, str], Panel]) -> Verdict:
    """Test a claim with scores.

    Args:
        claim: One of `CLAIMS`, or your own.
        panels: (experiment, measure), (experiment, measure, form) or `PanelName` -> scores of all policies.

    Raises:
        CurveError: A panel lacks a policy that the claim names.
    """
    if claim.vague:
        return Verdict(claim=claim.name, answer="too vague", by_bands="too vague", why=claim.vague)
    by_name = {PanelName(*cast("tuple[Any, ...]", name)): panel for name, panel in panels.items()}
    meanings = {**claim.otherwise, **{words: read.statements for words, read in read_otherwise(claim).items()}}
    others = {words: _verdict(claim, statements, by_name) for words, statements in meanings.items()}
    scored = {words: verdict for words, verdict in others.items() if verdict.answer != "no scores"}
    return replace(_verdict(claim, claim.statements, by_name), otherwise=scored)


def _verdict(claim: Claim, statements: tuple[Statement, ...], panels: Mapping[PanelName, Panel]) -> Verdict:
    rules: tuple[Rule, Rule] = ("intervals", "bands")
    joined = all_of if claim.needs == "all" else most_of
    ours, bands = (joined([statement.outcome(panels, rule) for statement in statements]) for rule in rules)
    return Verdict(
        claim=claim.name,
        answer=ours.answer,
        by_bands=bands.answer,
        statistic=ours.statistic,
        effect=ours.effect,
        n_runs=ours.n_runs,
        why="\n".join(ours.lines),
    )
