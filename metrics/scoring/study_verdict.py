"""What runs of the paper's sets say of its claims and of its intuitions, under all rules and in all variants."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, get_args

import polars as pl
import polars.selectors as cs

from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.studies.study import is_set_of_paper, left_out, load_study
from swarm_forage_env.studies.study_file import PAPER

from ..checks import CurveError
from ..claims import CLAIMS, INTUITIONS, Claim, PanelName, check_claim
from ..claims.claim import RELATIVE, read_otherwise
from ..claims.rules import Answer as ClaimAnswer
from ..curves import Variant
from .measures import MEASURES
from .study_numbers import Key, StudyPanel, study_panels

if TYPE_CHECKING:
    from swarm_forage_env.studies.results import StudyTable
    from swarm_forage_env.studies.study import StudySpec

VARIANTS: tuple[Variant, ...] = ("corrected", "paper")
WAITS = "waits"
"""What stands in place of an answer for which runs are missing."""
ANSWERS: tuple[str, ...] = (*get_args(ClaimAnswer), WAITS)
COLUMNS = ("the paper's bands", "ours", "ours, relative")
"""Columns of the table that says it all, under each of the rules."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyVerdict(Answer):
    """The claims and intuitions of the paper held against studies."""

    tables: "tuple[StudyTable, ...]"
    panels: tuple[StudyPanel, ...] = ()
    """Those of all studies, in all variants."""
    frame: pl.DataFrame = field(default_factory=pl.DataFrame)
    """One row per claim, rules, variant of the measures and sense of the words, first those that need no runs, which
    have no rules; then the same of the intuitions, by corrected measures only. The sense is empty for what the paper
    says. `answer` is by intervals, our rule; `why` has one line per statement, or the runs that an answer waits for."""

    @property
    def rules(self) -> tuple[str, ...]:
        """Those that some study has."""
        return tuple(dict.fromkeys(rules for table in self.tables for rules in table.spec.rules))

    def counts(self, rules: str, variant: str) -> dict[str, int]:
        """Return answer -> how many claims have it by these rules; those that no run answers are in the corrected."""
        mine = self.frame.filter(pl.col("claim").is_in([*CLAIMS]), pl.col("rules").is_in([rules, ""]))
        answers = Counter(mine.filter(sense="", measures=variant)["answer"])
        return {word: answers[word] for word in ANSWERS}

    def at_a_glance(self, claims: Mapping[str, Claim]) -> list[tuple[str, ...]]:
        """Return a row per claim: its name, its text, and `COLUMNS` under each of the rules, measures corrected."""
        rows = self.frame.filter(measures="corrected").select("claim", "rules", "sense", "by_bands", "answer").rows()
        found = {(name, rules, sense): answers for name, rules, sense, *answers in rows}

        def cells(claim: Claim) -> Iterator[str]:
            for rules in self.rules:
                key = (claim.name, rules if claim.panels else "")
                yield from (*found[*key, ""], found.get((*key, RELATIVE), ("", ""))[1])

        return [(name, claim.text, *cells(claim)) for name, claim in claims.items()]

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know of the studies."""
        told: dict[str, dict[str, None]] = {}
        for table in self.tables:
            for words in _remarks_on(table.spec):
                told.setdefault(words, {})[table.spec.name] = None
        return tuple(f"{', '.join(names)}: {words}" for words, names in told.items())

    def sheets(self) -> Sequence[Sheet]:
        """Return how many have which answer, all claims at a glance, what is behind each answer, and what waits."""
        counts = [{"rules": rules, **self.counts(rules, "corrected")} for rules in self.rules]
        sheets = [Sheet(title="how many claims, measures corrected", frame=pl.DataFrame(counts))]
        header = ("claim", "the paper", *(f"{rules}: {word}" for rules in self.rules for word in COLUMNS))
        for title, claims in (("all claims at a glance", CLAIMS), ("what the paper expected", INTUITIONS)):
            rows = self.at_a_glance(claims)
            shown = [row for row in rows if {*row[2:]} - {WAITS, ""}]
            notes = [f"{len(rows) - len(shown)} of {len(rows)} wait for runs."] if len(shown) < len(rows) else []
            sheets.append(Sheet.of(title=title, header=header, rows=shown, notes=notes))
        behind = self.frame.filter(pl.col("answer") != WAITS).drop("text", "figure")
        waiting: dict[str, dict[str, None]] = {}
        for name, why in self.frame.filter(answer=WAITS).select("claim", "why").iter_rows():
            waiting.setdefault(why, {})[name] = None
        lines = [f"  {', '.join(names)}: for {why}" for why, names in waiting.items()]
        title = "These claims and intuitions (H) wait:" if lines else "No claim waits for runs."
        return [*sheets, Sheet(title="what is behind the answers", frame=behind), Sheet(title=title, notes=lines)]

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values; numbers that do not exist are None."""
        return {
            "studies": [{"name": table.spec.name, "versions": [*map(dict, table.versions)]} for table in self.tables],
            "counts": {rules: self.counts(rules, "corrected") for rules in self.rules},
            "claims": self.frame.with_columns(pl.when(cs.float().is_finite()).then(cs.float())).to_dicts(),
        }


def _remarks_on(spec: "StudySpec") -> Iterator[str]:
    """Yield how a study differs from the paper's, and whether it was judged several times."""
    if is_set_of_paper(spec):
        seconds, whole = spec.length.horizon_s, load_study(spec.name, PAPER).length.horizon_s
        less = [f"runs of {seconds:,g} s instead of {whole:,g} s"] if seconds != whole else []
        less += [f"without {axis} {', '.join(values)}" for axis, values in left_out(spec).items()]
        if less:
            yield f"budget {spec.budget}, {', '.join(less)}"
    else:
        yield "other settings than those of the paper's set with this name"
    if spec.run.looks:
        yield (
            f"judged after {', '.join(map(str, spec.run.looks))} runs, and stopped where claims were decided; "
            "intervals are wider, so that all looks together are wrong once in twenty"
        )


def verdict(*tables: "StudyTable", tell: Callable[[str], None] | None = None) -> StudyVerdict:
    """Hold the claims of the paper, and its intuitions, against runs of its sets.

    A claim is left out in a variant that none of its measures has.

    Args:
        tables: From `swarm_forage_env.read_study`. Runs of a set under different rules may be in different studies.
        tell: Called with words about what is under way: with many runs it takes minutes.

    Raises:
        CurveError: a study twice under the same rules, one of none of the paper's sets, or without its policies.
    """
    under = [f"{table.spec.name} ({rules})" for table in tables for rules in table.spec.rules]
    if len(set(under)) < len(under):
        raise CurveError(f"Expected each study once under the same rules, got {', '.join(under)}.")
    sets = {name.experiment.split()[0] for claim in CLAIMS.values() for name in claim.panels}
    for spec in (table.spec for table in tables):
        if spec.name not in sets:
            raise CurveError(
                f"Expected studies of the paper's sets, {', '.join(sorted(sets))}, which its claims are about; got "
                f"study {spec.name!r}. 'swarm-forage study plot' takes any study."
            )
    panels: list[StudyPanel] = []
    reasons: dict[tuple[str, Key], str] = {}
    for table in tables:
        if tell is not None:
            tell(f"scoring {table.spec.name}")
        found, missing = study_panels(table, VARIANTS)
        panels += found
        reasons |= {(table.spec.name, key): why for key, why in missing.items()}
    by_name = {(panel.rules, panel.variant, panel.name): panel for panel in panels}
    every = dict.fromkeys(rules for table in tables for rules in table.spec.rules)
    rows: list[dict[str, Any]] = []
    for claims, variants in ((CLAIMS.values(), VARIANTS), (INTUITIONS.values(), VARIANTS[:1])):
        for claim in (one for one in claims if not one.panels):
            rows += _rows(claim, "", "corrected", {}, {})
        for rules, variant, claim in product(every, variants, claims):
            if any(_variant_of(name, variant) == variant for name in claim.panels):
                rows += _rows(claim, rules, variant, by_name, reasons)
    frame = pl.DataFrame(rows, infer_schema_length=None)
    return StudyVerdict(tables=tables, panels=tuple(panels), frame=frame)


def _variant_of(name: PanelName, variant: Variant) -> Variant:
    """Return the variant of a measure that is used: this one if it has it, else the corrected one."""
    return variant if variant in MEASURES[name.measure].variants else "corrected"


def _rows(
    claim: Claim,
    rules: str,
    variant: Variant,
    panels: Mapping[tuple[str, str, PanelName], StudyPanel],
    reasons: Mapping[tuple[str, Key], str],
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a claim, answered with panels by rules, variant and name; or one with what it waits for."""
    about = {"claim": claim.name, "text": claim.text, "figure": claim.figure, "rules": rules, "measures": variant}
    names = [*claim.panels, *claim.other_panels]
    for one in read_otherwise(claim).values():
        names += one.panels
    shown = {
        name: panels.get((rules, _variant_of(name, variant), name._replace(is_relative=False, of_mean_curves=False)))
        for name in names
    }
    lacks = [name for name in claim.panels if shown[name] is None]
    if lacks:
        keys: list[tuple[str, Key]] = [
            (name.experiment.split()[0], (name.measure, _variant_of(name, variant), name.form)) for name in lacks
        ]
        why = "; ".join(dict.fromkeys(reasons[key] for key in keys if key in reasons))
        runs = ", ".join(dict.fromkeys(name.experiment for name in lacks))
        runs += f" ({rules}, {variant}: {why})" if why else ""
        yield {**about, "sense": "", "answer": WAITS, "by_bands": WAITS, "why": runs}
        return
    found = {name: panel.for_claims(name) for name, panel in shown.items() if panel is not None}
    verdict = check_claim(claim, {name: panel for name, panel in found.items() if panel is not None})
    for sense, one in {"": verdict, **verdict.otherwise}.items():
        told = ("answer", "by_bands", "statistic", "effect", "n_runs", "why")
        yield {**about, "sense": sense, **{name: getattr(one, name) for name in told}}
