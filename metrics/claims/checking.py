"""Claims held against scores: which statements a claim makes of which panels, and the verdict on it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any, Literal, NamedTuple, TypeAlias, cast

from ..controllers import PAPER_POLICIES
from ..curves import Form
from .looks import at_last_look
from .outcomes import Answer, Outcome, all_of, most_of, without_scores
from .panel import Panel, Rule


class PanelName(NamedTuple):
    """What a panel shows."""

    experiment: str
    """In `EXPERIMENTS`."""
    measure: str
    """In `METRICS`."""
    form: Form = "marginal"
    """Of a measure that compares two sizes."""
    is_relative: bool = False
    """Whether scores are shares of the performance that they are compared with."""
    of_mean_curves: bool = False
    """Whether it shows the measure of the mean curves, which leaves less of what chance adds to distances."""

    @property
    def words(self) -> str:
        """The name for people."""
        relative, means = "relative" if self.is_relative else "", "of mean curves" if self.of_mean_curves else ""
        words = (self.experiment, self.measure, "" if self.form == "marginal" else self.form, relative, means)
        return " ".join(word for word in words if word).replace("_", " ")


Place: TypeAlias = tuple[str, str] | tuple[str, str, Form] | PanelName
"""A panel: experiment, measure, and the form if it is not the marginal one; or its whole name."""
DISTANCES = ("reactivity", "adaptability", "noise_robustness")
RELATIVE_TOO = (*DISTANCES, "population_robustness")
"""Measures in amounts of performance that rank policies by how much they do: claims about them are judged relative to
performance, too."""
RELATIVE = "relative to performance"
"""Name of these verdicts among the others."""


def named(place: Place) -> PanelName:
    """Return the name of a panel."""
    if isinstance(place, PanelName):
        return place
    return PanelName(place[0], place[1], place[2] if len(place) == 3 else "marginal")


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
"""How else measures can be read, in words -> what makes the name of a panel that of the panel read so, which is the
same name where it cannot be."""


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One statement about one panel or two."""

    predicate: Callable[..., Outcome]
    """Called with the panels and the parameters."""
    panels: tuple[PanelName, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])
    views: tuple[Callable[[Panel], Panel], ...] = ()
    """Applied to each panel first, in this order: its rise, its slope, ..."""

    @property
    def policies(self) -> tuple[str, ...]:
        """Policies that it speaks of: those of the paper among its parameters, in any depth."""
        return tuple(name for name in PAPER_POLICIES if name in _words_in(list(self.parameters.values())))

    def outcome(self, panels: Mapping[PanelName, Panel], rule: Rule) -> Outcome:
        """Return what comes of it, with the names of the panels in its reason."""
        absent = [name.words for name in self.panels if name not in panels]
        if absent:
            return without_scores(", ".join(absent))
        seen = at_last_look([panels[name] for name in self.panels], self.policies)
        for view in self.views:
            seen = [view(panel) for panel in seen]
        rules = {"rule": rule} if seen else {}  # what follows from formulas alone has no runs to compare
        outcome = self.predicate(*seen, **self.parameters, **rules)
        return _placed(outcome, " and ".join(name.words for name in self.panels)) if seen else outcome


def _words_in(value: Any) -> set[str]:
    if isinstance(value, str):
        return {value}
    entries = cast("Sequence[Any]", value) if isinstance(value, list | tuple) else ()
    return {word for entry in entries for word in _words_in(entry)}


def _placed(outcome: Outcome, where: str) -> Outcome:
    """Return the outcome with the place before its reason, or that of each of its parts."""
    parts = tuple(_placed(part, where) for part in outcome.parts)
    return replace(outcome, parts=parts, why=outcome.why if parts else f"{where}: {outcome.why}")


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim: the statements that it consists of."""

    name: str
    text: str
    """What is claimed, in our words."""
    figure: str
    """Where it is shown."""
    statements: tuple[Statement, ...] = ()
    needs: Literal["all", "most"] = "all"
    """How many of the statements must hold."""
    otherwise: Mapping[str, tuple[Statement, ...]] = field(default_factory=dict[str, tuple[Statement, ...]])
    """Where the paper's words, its captions, its file names or its program disagree on what was meant: what else the
    claim may mean, in words -> statements of that."""
    vague: str = ""
    """Of a claim without statements, why no run can answer it, told from its text alone."""

    @property
    def panels(self) -> tuple[PanelName, ...]:
        """Panels that are needed, each once; without those of `otherwise`."""
        return _panels_of(self.statements)

    @property
    def other_panels(self) -> tuple[PanelName, ...]:
        """Panels that only `otherwise` needs."""
        needed = _panels_of([statement for statements in self.otherwise.values() for statement in statements])
        return tuple(name for name in needed if name not in self.panels)


def read_otherwise(claim: Claim) -> dict[str, Claim]:
    """Return what a claim says in each of `READINGS` that makes a difference, by the words of the reading."""
    found: dict[str, Claim] = {}
    for words, read in READINGS.items():
        statements = tuple(replace(one, panels=tuple(map(read, one.panels))) for one in claim.statements)
        if all(statements != other.statements for other in (claim, *found.values())):
            found[words] = replace(claim, statements=statements, otherwise={})
    return found


def _panels_of(statements: Iterable[Statement]) -> tuple[PanelName, ...]:
    return tuple(dict.fromkeys(name for statement in statements for name in statement.panels))


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What scores say of a claim."""

    claim: str
    answer: Answer
    """By intervals, our rule."""
    by_bands: Answer
    """By overlapping bands of two standard deviations, the paper's rule."""
    statistic: float
    """What was decided on, by our rule, and `why` says what it is; of several statements the share that holds."""
    effect: float
    """Size of the difference or change, as a share of the largest mean in the panel; of several statements the median
    of those with this answer; NaN where there is none."""
    n_runs: int
    """Smallest number of runs behind any number that was used; 0 for formulas and missing scores."""
    why: str
    """What was found and the limit that it was held against; one line per statement."""
    otherwise: Mapping[str, "Verdict"] = field(default_factory=dict[str, "Verdict"])
    """Verdicts on what else the claim may mean, and on how else it can be read (`READINGS`); those without any scores
    are left out."""


def check_claim(claim: Claim, panels: Mapping[PanelName, Panel] | Mapping[tuple[str, str], Panel]) -> Verdict:
    """Hold one claim against scores.

    Args:
        claim: One of `CLAIMS`, or of your own.
        panels: (experiment, measure), (experiment, measure, form) or `PanelName` -> scores of all policies.

    Raises:
        CurveError: A panel lacks a policy that the claim speaks of.
    """
    if claim.vague:
        return _told(claim, Outcome(answer="too vague", statistic=nan, effect=nan, n_runs=0, why=claim.vague))
    by_name = {named(name): panel for name, panel in panels.items()}
    others = {words: _verdict(claim, statements, by_name) for words, statements in claim.otherwise.items()}
    others |= {words: _verdict(claim, read.statements, by_name) for words, read in read_otherwise(claim).items()}
    scored = {words: verdict for words, verdict in others.items() if verdict.answer != "no scores"}
    return replace(_verdict(claim, claim.statements, by_name), otherwise=scored)


def joined(claim: Claim, outcomes: Sequence[Outcome]) -> Outcome:
    """Return the outcome of a claim from those of its statements."""
    return all_of(outcomes) if claim.needs == "all" else most_of(outcomes)


def _verdict(claim: Claim, statements: tuple[Statement, ...], panels: Mapping[PanelName, Panel]) -> Verdict:
    rules: tuple[Rule, Rule] = ("intervals", "bands")
    ours, bands = (joined(claim, [statement.outcome(panels, rule) for statement in statements]) for rule in rules)
    return _told(claim, ours, bands)


def _told(claim: Claim, ours: Outcome, bands: Outcome | None = None) -> Verdict:
    """The verdict of an outcome by our rule and one by the paper's, or of one that needs no rule."""
    return Verdict(
        claim=claim.name,
        answer=ours.answer,
        by_bands=(bands or ours).answer,
        statistic=ours.statistic,
        effect=ours.effect,
        n_runs=ours.n_runs,
        why="\n".join(ours.lines),
    )
