"""What runs of the paper's sets say of its claims and of its intuitions, under all rules and in all readings."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

import polars as pl
import polars.selectors as cs

from swarm_forage_env._internal.fields import instance
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study import StudySpec, is_set_of_paper, left_out, load_study
from swarm_forage_env.studies.study_file import PAPER

from ..checks import CurveError
from ..claims import CLAIMS, INTUITIONS, MARGINS, Claim, Panel, PanelName, Verdict, check_claims
from ..claims.contrast import Answer as ClaimAnswer
from ..claims.panel import TRIED
from ..claims.verdict import Reading
from .study_numbers import StudyPanel, study_panels

EVERY: dict[str, Claim] = {**CLAIMS, **INTUITIONS}
ANSWERS: tuple[str, ...] = get_args(ClaimAnswer)
WAITS = "no runs"
"""The answer of claims about runs that are missing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyVerdict(Answer):
    """The claims and intuitions of the paper held against studies."""

    tables: "tuple[StudyTable, ...]"
    panels: tuple[StudyPanel, ...] = ()
    """Those of all studies."""
    frame: pl.DataFrame = field(default_factory=pl.DataFrame)
    """One row per claim, rules and reading (`metrics.claims.verdict.Reading`): the answer, how many statements hold,
    how many comparisons are as claimed, reversed, tied and open, and the answers by other margins. `is_main` marks the
    reading that answers a claim: shares for flexibility and robustness, else amounts."""
    parts: pl.DataFrame = field(default_factory=pl.DataFrame)
    """One row per statement of each of them: the mean of its contrast over runs, in the unit of the measure, interval,
    Cohen's d, p value after Holm's correction within the family, margin, and number of runs."""

    @property
    def rules(self) -> tuple[str, ...]:
        """Those that some study has."""
        return tuple(dict.fromkeys(rules for table in self.tables for rules in table.spec.rules))

    def counts(self, rules: str) -> dict[str, int]:
        """Return answer -> how many claims of the paper have it in their main reading."""
        mine = self.frame.filter(pl.col("claim").is_in([*CLAIMS]), pl.col("is_main"), rules=rules)
        answers = Counter(mine["answer"])
        return {word: answers[word] for word in ANSWERS}

    def at_a_glance(self, claims: Mapping[str, Claim]) -> list[tuple[str, ...]]:
        """Return a row per claim: its name, its text, and its answer in each reading under each of the rules."""
        found = {tuple(key): answer for *key, answer in self.frame.select("claim", "rules", "reading", "answer").rows()}
        readings = [(rules, reading) for rules in self.rules for reading in get_args(Reading)]
        return [(name, claim.text, *(found.get((name, *of), "") for of in readings)) for name, claim in claims.items()]

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
        counts = [{"rules": rules, **self.counts(rules)} for rules in self.rules]
        sheets = [Sheet(title="how many claims", frame=pl.DataFrame(counts))]
        header = (
            "claim",
            "the paper",
            *(f"{rules}: {reading}" for rules in self.rules for reading in get_args(Reading)),
        )
        for title, claims in (("all claims at a glance", CLAIMS), ("what the paper expected", INTUITIONS)):
            rows = self.at_a_glance(claims)
            shown = [row for row in rows if {*row[2:]} - {WAITS, ""}]
            notes = [f"{len(rows) - len(shown)} of {len(rows)} wait for runs."] if len(shown) < len(rows) else []
            sheets.append(Sheet.of(title=title, header=header, rows=shown, notes=notes))
        main = self.frame.filter("is_main")
        behind = main.filter(pl.col("answer") != WAITS).select("claim", "rules", "reading", "answer", "n_runs", "why")
        waiting: dict[str, dict[str, None]] = {}
        for name, why in main.filter(answer=WAITS).select("claim", "why").iter_rows():
            waiting.setdefault(why, {})[name] = None
        lines = [f"  {', '.join(names)}: {why}" for why, names in waiting.items()]
        title = "These claims and intuitions (H) wait:" if lines else "No claim waits for runs."
        return [*sheets, Sheet(title="what is behind the answers", frame=behind), Sheet(title=title, notes=lines)]

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values; numbers that do not exist are None."""
        claims, parts = (
            each.with_columns(pl.when(cs.float().is_finite()).then(cs.float())).to_dicts()
            for each in (self.frame, self.parts)
        )
        return {
            "studies": [{"name": table.spec.name, "versions": [*map(dict, table.versions)]} for table in self.tables],
            "counts": {rules: self.counts(rules) for rules in self.rules},
            "claims": claims,
            "statements": parts,
        }


def _remarks_on(spec: "StudySpec") -> Iterator[str]:
    """Yield how a study differs from the paper's."""
    if not is_set_of_paper(spec):
        yield "other settings than those of the paper's set with this name"
        return
    seconds, whole = spec.length.horizon_s, load_study(spec.name, PAPER).length.horizon_s
    less = [f"runs of {seconds:,g} s instead of {whole:,g} s"] if seconds != whole else []
    less += [f"without {axis} {', '.join(values)}" for axis, values in left_out(spec).items()]
    if less:
        yield f"budget {spec.budget}, {', '.join(less)}"


def verdict(*tables: "StudyTable", tell: Callable[[str], None] | None = None) -> StudyVerdict:
    """Hold the claims of the paper, and its intuitions, against runs of its sets.

    Args:
        tables: From `swarm_forage_env.read_study`. Runs of a set under different rules may be in different studies.
        tell: Called with words about what is under way: with many runs it takes a while.

    Raises:
        CurveError: a study twice under the same rules, one of none of the paper's sets, or without its policies.
    """
    for table in tables:
        instance("a study", table, StudyTable, hint="; read_study(path) reads one")
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
    for table in tables:
        if tell is not None:
            tell(f"scoring {table.spec.name}")
        panels += study_panels(table)[0]
    rows: list[dict[str, Any]] = []
    parts: list[dict[str, Any]] = []
    for rules in dict.fromkeys(rules for table in tables for rules in table.spec.rules):
        shown = {
            panel.name: panel.for_claims()
            for panel in panels
            if panel.rules == rules and panel.name.experiment and panel.measure in MARGINS
        }
        for reading in get_args(Reading):
            found = check_claims(EVERY, shown, reading=reading)
            others = _by_margins(shown, reading)
            for claim in (one for one in EVERY.values() if reading != "shares" or one.has_shares):
                about = {"claim": claim.name, "rules": rules, "reading": reading}
                rows.append({**about, **_row(claim, reading, found[claim.name]), **others.get(claim.name, {})})
                parts += [{**about, **row} for row in _rows(found[claim.name])]
    return StudyVerdict(
        tables=tables,
        panels=tuple(panels),
        frame=pl.DataFrame(rows, infer_schema_length=None),
        parts=pl.DataFrame(parts, infer_schema_length=None),
    )


def _by_margins(panels: Mapping[PanelName, Panel], reading: Reading) -> dict[str, dict[str, str]]:
    """Return claim -> its answers by the margins that are tried; bands have none."""
    tried = TRIED if reading != "bands" else ()
    found = {f"at_{margin:g}": check_claims(EVERY, panels, reading=reading, margin=margin) for margin in tried}
    return {name: {column: given[name].answer for column, given in found.items()} for name in EVERY}


def _row(claim: Claim, reading: Reading, of: Verdict) -> dict[str, Any]:
    claimed, turned, tied, still_open = of.counts
    return {
        "family": claim.family,
        "is_main": reading == ("shares" if claim.has_shares else "amounts"),
        "answer": of.answer,
        "n_held": of.n_held,
        "n_statements": len(of.parts),
        "claimed": claimed,
        "reversed": turned,
        "tied": tied,
        "open": still_open,
        "n_runs": min((part.contrast.n_runs if part.contrast else 0 for part in of.parts), default=0),
        "why": of.why,
    }


def _rows(of: Verdict) -> Iterator[dict[str, Any]]:
    for part in of.parts:
        claimed, turned, tied, still_open = part.counts
        yield {
            "statement": part.statement.words,
            "kind": part.statement.kind,
            "where": part.statement.where,
            "answer": part.answer,
            **part.numbers(),
            "why": part.why,
            "claimed": claimed,
            "reversed": turned,
            "tied": tied,
            "open": still_open,
        }
