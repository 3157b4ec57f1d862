"""What runs of the paper's sets say of its claims and of its intuitions, under all rules and in all variants."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, get_args

from swarm_forage_env._internal.wording import number, percent, plain
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.studies.study import is_set_of_paper, load_study
from swarm_forage_env.studies.study_file import PAPER

from ..checks import CurveError
from ..claims import CLAIMS, INTUITIONS, Claim, PanelName, Verdict, check_claim
from ..claims.claim import RELATIVE, read_otherwise
from ..claims.rules import Answer as ClaimAnswer
from ..controllers import PAPER_POLICIES as POLICIES
from ..curves import Variant
from .frame import label_of
from .measures import MEASURES
from .study_numbers import StudyPanel, StudyPanels, study_panels

if TYPE_CHECKING:
    from swarm_forage_env.studies.results import StudyTable
    from swarm_forage_env.studies.study import StudySpec

VARIANTS: tuple[Variant, ...] = ("corrected", "paper")
ANSWERS: tuple[ClaimAnswer, ...] = get_args(ClaimAnswer)
WAITS = "waits"
"""What stands in place of an answer for which runs are missing."""
HEADER = ("claim", "text", "by intervals", "relative", "by bands", "statistic", "effect", "runs", "why", "otherwise")
OURS, RELATIVELY, BANDS = "ours", "ours, relative", "the paper's bands"
"""Columns of the table that says it all, under each of the rules."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What studies say of one claim under one of the rules and in one variant."""

    claim: Claim
    rules: str
    """Empty for a claim that no run answers: about formulas, or too vague."""
    variant: Variant
    verdict: Verdict

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values; numbers that JSON does not have are None."""
        return {
            "claim": self.claim.name,
            "text": self.claim.text,
            "figure": self.claim.figure,
            "rules": self.rules,
            "variant": self.variant,
            **_plain(self.verdict),
            "otherwise": {words: _plain(verdict) for words, verdict in self.verdict.otherwise.items()},
        }


def _plain(verdict: Verdict) -> dict[str, Any]:
    return {
        "answer": verdict.answer,
        "by_bands": verdict.by_bands,
        "statistic": plain(verdict.statistic),
        "effect": plain(verdict.effect),
        "n_runs": verdict.n_runs,
        "why": verdict.why,
    }


@dataclass(frozen=True, kw_only=True)
class Waiting:
    """A claim that cannot be answered yet, under one of the rules and in one variant."""

    claim: Claim
    rules: str
    variant: Variant
    lacks: tuple[PanelName, ...]
    """Panels without scores."""
    reasons: tuple[str, ...]
    """Why they have none, where their study is there."""

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {
            "claim": self.claim.name,
            "text": self.claim.text,
            "rules": self.rules,
            "variant": self.variant,
            "lacks": [list(name) for name in self.lacks],
            "reasons": list(self.reasons),
        }


def why_no_claims(spec: "StudySpec") -> str:
    """Return why the claims cannot be held against a study; empty if they can."""
    name = spec.name
    if not claims_of(name):
        sets = {name.split()[0] for claim in CLAIMS.values() for name, *_ in claim.panels}
        return (
            f"Expected studies of the paper's sets, {', '.join(sorted(sets))}, which its claims are about; got study "
            f"{name!r}."
        )
    absent = [label for label in POLICIES if label not in {policy.label for policy in spec.policies}]
    if absent:
        return (
            f"Expected the policies {', '.join(POLICIES)} in study {name}, which the claims of the paper are about; "
            f"it has no {', '.join(absent)}."
        )
    return ""


def judge_claims(
    tables: "Sequence[StudyTable]",
    scored: Sequence[StudyPanels],
    variants: Sequence[Variant] = VARIANTS,
    claims: Mapping[str, Claim] = CLAIMS,
) -> tuple[tuple[Judged, ...], tuple[Waiting, ...]]:
    """Hold claims against studies; a claim is left out in a variant that none of its measures has.

    Args:
        tables: Studies, each once.
        scored: The panels of each in the same order, in these variants and the corrected one.
        variants: Which.
        claims: By name; those of the paper's text, or its `INTUITIONS`.

    Returns:
        The answered claims, by rules, variant and claim, those first that need no runs; and those that wait for runs.

    Raises:
        CurveError: a study twice under the same rules, one without the policies of the paper, or none of its sets.
    """
    names = [table.spec.name for table in tables]
    under = [f"{table.spec.name} ({rules})" for table in tables for rules in table.spec.rules]
    if len(set(under)) < len(under):
        raise CurveError(f"Expected each study once under the same rules, got {', '.join(under)}.")
    for reason in filter(None, (why_no_claims(table.spec) for table in tables)):
        raise CurveError(reason)
    found = _Found(
        panels={(panel.rules, panel.variant, panel.name): panel for one in scored for panel in one.panels},
        reasons={
            (name, *key): why for name, one in zip(names, scored, strict=True) for key, why in one.missing.items()
        },
    )
    judged = [
        Judged(claim=claim, rules="", variant="corrected", verdict=check_claim(claim, {}))
        for claim in claims.values()
        if not claim.panels
    ]
    waiting: list[Waiting] = []
    every = dict.fromkeys(rules for table in tables for rules in table.spec.rules)
    for rules, variant, claim in product(every, variants, claims.values()):
        if claim.panels and any(_variant_of(name.measure, variant) == variant for name in claim.panels):
            outcome = _judge(claim, rules, variant, found)
            if isinstance(outcome, Judged):
                judged.append(outcome)
            else:
                waiting.append(outcome)
    return tuple(judged), tuple(waiting)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """What studies have."""

    panels: Mapping[tuple[str, Variant, PanelName], StudyPanel]
    """By rules, variant and name."""
    reasons: Mapping[tuple[str, str, str], str]
    """Study, measure in a form of it, and variant -> why there are no scores."""


def _variant_of(measure: str, variant: Variant) -> Variant:
    """Return the variant of a measure that is used: this one if it has it, else the corrected one."""
    return variant if variant in MEASURES[measure].variants else "corrected"


def _judge(claim: Claim, rules: str, variant: Variant, found: _Found) -> Judged | Waiting:
    names = [*claim.panels, *claim.other_panels]
    names += [name for read in read_otherwise(claim).values() for name in read.panels]
    places: dict[PanelName, tuple[str, Variant, PanelName]] = {
        name: (rules, _variant_of(name.measure, variant), name._replace(is_relative=False, of_mean_curves=False))
        for name in names
    }
    lacks = tuple(name for name in claim.panels if places[name] not in found.panels)
    if not lacks:
        panels = {
            name: found.panels[place].for_claims(name)
            for name, place in places.items()
            if place in found.panels and found.panels[place].scores_of(name)
        }
        return Judged(claim=claim, rules=rules, variant=variant, verdict=check_claim(claim, panels))
    keys = [
        (name.experiment.split()[0], label_of(name.measure, "corrected", name.form), _variant_of(name.measure, variant))
        for name in lacks
    ]
    reasons = tuple(dict.fromkeys(found.reasons[key] for key in keys if key in found.reasons))
    return Waiting(claim=claim, rules=rules, variant=variant, lacks=lacks, reasons=reasons)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyVerdict(Answer):
    """Claims and intuitions that studies answer, and those that wait for runs."""

    tables: "tuple[StudyTable, ...]"
    scored: tuple[StudyPanels, ...] = ()
    """The panels of each, in all variants."""
    judged: tuple[Judged, ...] = ()
    waiting: tuple[Waiting, ...] = ()
    expected: tuple[Judged, ...] = ()
    """Intuitions, by corrected measures only."""
    expected_later: tuple[Waiting, ...] = ()
    is_short: bool = False
    """Whether `sheets` are the counts and the table that says it all, without what is behind the answers."""

    is_folded: bool = False
    """Whether `sheets` only count the claims that wait under all rules."""

    @property
    def rules(self) -> tuple[str, ...]:
        """Those that some study has."""
        return tuple(dict.fromkeys(rules for table in self.tables for rules in table.spec.rules))

    @property
    def found(self) -> dict[tuple[str, str, str], Verdict]:
        """Name of a claim or intuition, rules and variant -> what runs say of it; without rules what formulas say."""
        return {(one.claim.name, one.rules, one.variant): one.verdict for one in (*self.judged, *self.expected)}

    @property
    def later(self) -> dict[tuple[str, str, str], Waiting]:
        """The same of those that wait for runs."""
        return {(one.claim.name, one.rules, one.variant): one for one in (*self.waiting, *self.expected_later)}

    def counts(self, rules: str, variant: str) -> dict[str, int]:
        """Return answer -> how many claims have it by these rules; and how many wait for runs, as `WAITS`.

        Claims that no run answers are counted with the corrected measures, under all rules.
        """
        mine = [one.verdict for one in self.judged if one.rules in (rules, "") and one.variant == variant]
        answers = Counter(verdict.answer for verdict in mine)
        waiting = sum((one.rules, one.variant) == (rules, variant) for one in self.waiting)
        return {**{word: answers[word] for word in ANSWERS}, WAITS: waiting}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know of the studies."""
        others = [table.spec.name for table in self.tables if not is_set_of_paper(table.spec)]
        remarks = [f"{name} has the name of one of the paper's sets and other settings" for name in others]
        remarks += _other_than_the_paper([table.spec for table in self.tables if is_set_of_paper(table.spec)])
        several = [table.spec for table in self.tables if table.spec.run.looks]
        for looks in dict.fromkeys(spec.run.looks for spec in several):
            names = ", ".join(spec.name for spec in several if spec.run.looks == looks)
            remarks.append(
                f"{names}: judged after {', '.join(map(str, looks))} runs, and stopped where claims were decided; "
                "intervals are wider, so that all looks together are wrong once in twenty"
            )
        return tuple(remarks)

    def sheets(self) -> Sequence[Sheet]:
        """Return how many have which answer, all claims at a glance, what is behind each answer, and what waits."""
        return [self._counted(), *self._at_a_glance(), *([] if self.is_short else self._behind())]

    def _counted(self) -> Sheet:
        rows = [(rules, *map(str, self.counts(rules, "corrected").values())) for rules in self.rules]
        return Sheet.of(title="how many claims, measures corrected", header=("rules", *ANSWERS, WAITS), rows=rows)

    def _at_a_glance(self) -> Iterator[Sheet]:
        """Each claim with its answers under all rules, measures corrected; the same of the intuitions."""
        columns = [f"{rules}: {word}" for rules in self.rules for word in (BANDS, OURS, RELATIVELY)]
        for title, claims in (("all claims at a glance", CLAIMS), ("what the paper expected", INTUITIONS)):
            rows = [
                (name, claim.text, *(cell for rules in self.rules for cell in self.cells(claim, rules)))
                for name, claim in claims.items()
            ]
            folded = [row[0] for row in rows if self.is_folded and not {*row[2:]} - {WAITS, ""}]
            shown = [row for row in rows if row[0] not in folded]
            notes = [self._folded_words(folded, len(rows))] if folded else []
            yield Sheet.of(title=title, header=("claim", "the paper", *columns), rows=shown, notes=notes)

    def _folded_words(self, names: Sequence[str], n_all: int) -> str:
        lacks = {
            name.experiment.split()[0] for one in self.later.values() for name in one.lacks if one.claim.name in names
        }
        words = f"{len(names)} of {n_all} wait" + ("s" if len(names) == 1 else "")
        return f"{words} for runs of {', '.join(sorted(lacks))}."

    def cells(self, claim: Claim, rules: str) -> tuple[str, str, str]:
        """Return the answers to a claim by the paper's bands, by ours, and by ours relative to performance."""
        found = self.found.get((claim.name, rules if claim.panels else "", "corrected"))
        if found is None:
            return WAITS, WAITS, ""
        return found.by_bands, found.answer, relative_answer(found)

    def _behind(self) -> Sequence[Sheet]:
        """One table per rules and variant with what is behind the answers, and what waits for which runs."""
        groups: dict[tuple[str, str, str], list[Judged]] = {}
        for what, some in (("", self.judged), ("intuitions, ", self.expected)):
            for one in some:
                groups.setdefault((what, one.rules, one.variant), []).append(one)
        sheets: list[Sheet] = []
        for (what, rules, variant), some in groups.items():
            title = f"rules {rules}, measures {variant}" if rules else "without any run"
            sheets.append(Sheet.of(title=f"{what}{title}", header=HEADER, rows=[_row(one) for one in some]))
        first, *others = waiting_lines((*self.waiting, *self.expected_later))
        return [*sheets, Sheet(title=first, notes=others)]

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values; numbers that do not exist are None."""
        return {
            "studies": [
                {
                    "name": table.spec.name,
                    "budget": table.spec.budget,
                    "n_seeds": len(table.spec.seeds),
                    "versions": [dict(versions) for versions in table.versions],
                }
                for table in self.tables
            ],
            "counts": {rules: self.counts(rules, "corrected") for rules in self.rules},
            "verdicts": [one.to_mapping() for one in self.judged],
            "waiting": [one.to_mapping() for one in self.waiting],
            "intuitions": [one.to_mapping() for one in self.expected],
            "intuitions_waiting": [one.to_mapping() for one in self.expected_later],
        }


def _other_than_the_paper(specs: "Sequence[StudySpec]") -> Iterator[str]:
    """Yield what is shorter or less than in the paper, one line for each budget of its sets."""
    by_budget: dict[str, list[StudySpec]] = {}
    for spec in specs:
        by_budget.setdefault(spec.budget, []).append(spec)
    for budget, some in by_budget.items():
        words: dict[str, None] = {}
        for spec in some:
            whole = load_study(spec.name, PAPER, rules=spec.rules[:1])
            if spec.length.horizon_s != whole.length.horizon_s:
                words[f"runs of {spec.length.horizon_s:,g} s instead of {whole.length.horizon_s:,g} s"] = None
            for axis, planned in zip(spec.axes, whole.axes, strict=True):
                if len(axis.values) < len(planned.values):
                    fewer = f"{len(axis.values)} of {len(planned.values)} values of {axis.name}"
                    words[f"{spec.name} {fewer}" if len(some) > 1 else fewer] = None
        if words:
            names = ", ".join(dict.fromkeys(spec.name for spec in some))
            yield f"{names}, budget {budget}: {', '.join(words)}"


def verdict(*tables: "StudyTable", tell: Callable[[str], None] | None = None) -> StudyVerdict:
    """Hold the claims of the paper, and its intuitions, against runs of its sets.

    Args:
        tables: From `swarm_forage_env.read_study`. Runs of a set under different rules may be in different studies.
        tell: Called with words about what is under way: with many runs it takes minutes.

    Raises:
        CurveError: as in `judge_claims`.
    """
    refused = [why for table in tables if (why := why_no_claims(table.spec))]
    if refused:
        raise CurveError(f"{refused[0]} 'swarm-forage study plot' takes any study.")
    scored: list[StudyPanels] = []
    for table in tables:
        if tell is not None:
            tell(f"scoring {table.spec.name}")
        scored.append(study_panels(table, VARIANTS))
    judged, waiting = judge_claims(tables, scored)
    expected, expected_later = judge_claims(tables, scored, ("corrected",), INTUITIONS)
    return StudyVerdict(
        tables=tables,
        scored=tuple(scored),
        judged=judged,
        waiting=waiting,
        expected=expected,
        expected_later=expected_later,
    )


def claims_about(panels: Sequence[StudyPanel]) -> list[str]:
    """Return the claims of the paper that use one of these panels."""
    here = {panel.name for panel in panels}
    return [name for name, claim in CLAIMS.items() if not here.isdisjoint(claim.panels)]


def claims_of(name: str) -> list[str]:
    """Return the claims that a set has a figure of."""
    return [claim.name for claim in CLAIMS.values() if any(panel[0].split()[0] == name for panel in claim.panels)]


def waiting_lines(waiting: Sequence[Waiting]) -> list[str]:
    """Return which claims wait for what, those that wait for the same in one line."""
    claims: dict[str, dict[str, None]] = {}
    for one in waiting:
        words = f"for {', '.join(dict.fromkeys(name.experiment for name in one.lacks))}"
        if one.reasons:
            words += f" ({one.rules}, {one.variant}: {'; '.join(one.reasons)})"
        claims.setdefault(words, {})[one.claim.name] = None
    if not claims:
        return ["No claim waits for runs."]
    return [
        "These claims and intuitions (H) wait:",
        *(f"  {', '.join(names)}: {words}" for words, names in claims.items()),
    ]


def _row(one: Judged) -> tuple[str, ...]:
    found = one.verdict
    numbers = (number(found.statistic), percent(found.effect), str(found.n_runs))
    others = "\n".join(f"{words}: {other.answer}" for words, other in found.otherwise.items() if words != RELATIVE)
    answers = (found.answer, relative_answer(found), found.by_bands)
    return (one.claim.name, one.claim.text, *answers, *numbers, found.why, others)


def relative_answer(found: Verdict) -> str:
    """Return the answer relative to performance; empty where there is none."""
    return found.otherwise[RELATIVE].answer if RELATIVE in found.otherwise else ""
