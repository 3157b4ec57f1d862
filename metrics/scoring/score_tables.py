"""Tables of scores: of one policy, or of several, with which is better and whether the difference is significant."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env._internal.wording import counted, limits, percent, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.answer import Answer, Sheet

from ..catalog import METRICS
from ..checks import CurveError
from ..curves import FloatArray
from ..significance import SIGNIFICANT, holm, paired_p
from ..statistics import Summary, aggregate
from .plots import draw_scores
from .scores import BAND, DOUBTFUL, HEADER, Score, spread

if TYPE_CHECKING:
    import polars as pl


TEST = (
    "Differences: first policy minus second, runs paired by seed, mean with half of Student's 95 % interval. "
    "* = significant: two-sided paired t test, p at most 0.05 after Holm's correction over all levels and pairs of "
    "policies of a measure. Relative = per unit of the performance compared with, tested as a measure of its own: "
    "amounts and distances grow with performance, so a swarm that does little has little to lose."
)
"""How differences are tested, as a text for readers."""
VALUES = (
    "Values: mean over seeds with half of Student's 95 % interval; in brackets the mean relative to the performance "
    "compared with, of raw_performance the share of the limit that is estimated for the world; ! = runs are missing; "
    f"{DOUBTFUL} = misleads, a note says why. Noise floor: what two runs of the undisturbed swarm score by chance."
)
BANDS = "In square brackets: mean minus and plus two standard deviations of single runs."
PAIRS_PER_TABLE = 6
"""Pairs of policies side by side; more go into further tables."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreTable(Answer):
    """All scores of one policy in one scenario."""

    policy: str
    scenario: str
    """The world for people: the scenario, and what differs from its preset; empty if it is not known."""
    scores: tuple[Score, ...]
    missing: Mapping[str, str] = field(default_factory=dict[str, str])
    """Measure -> why it could not be computed."""
    failures: tuple[str, ...] = ()
    """Why runs failed, a line per reason."""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """How the runs were made: budget, length, seeds, folder."""
    band: bool = False
    """Whether the authors' bands stand beside the intervals."""

    def __getitem__(self, measure: str) -> tuple[Score, ...]:
        """Return the scores of one measure.

        Raises:
            KeyError: there are none; the message says why.
        """
        found = tuple(score for score in self.scores if score.measure == measure)
        if not found:
            raise KeyError(f"No score for {measure!r}: {self.missing.get(measure, 'it was not asked for')}")
        return found

    def notes(self) -> tuple[str, ...]:
        """Return all notes: those of scores, missing measures, failed runs."""
        noted = [f"{places}: {note}" for note, places in self._places_of_notes().items()]
        absent = [f"{measure} is not computed: {reason}" for measure, reason in self.missing.items()]
        return (*noted, *absent, *(f"failed: {failure}" for failure in self.failures))

    def _places_of_notes(self) -> dict[str, str]:
        """Note -> the scores that have it, in words, so that a note of many scores appears once."""
        levels: dict[str, dict[str, list[str]]] = {}
        for score in self.scores:
            if score.note:
                levels.setdefault(score.note, {}).setdefault(score.label, []).append(score.at)
        return {
            note: "; ".join(f"{measure}, {', '.join(places)}" for measure, places in places_of.items())
            for note, places_of in levels.items()
        }

    def to_frame(self) -> "pl.DataFrame":
        """Return one row per score; `per_seed` and `beside` do not fit into a row and are only in `to_mapping`."""
        import polars as pl

        rows: list[dict[str, Any]] = []
        for score in self.scores:
            row = score.to_mapping()
            del row["per_seed"], row["beside"]
            for name in ("relative", "of_mean_curves"):
                values = row.pop(name) or [None, None, None]
                row |= dict(zip((name, f"{name}_lower", f"{name}_upper"), values, strict=True))
            row |= dict(zip(("two_sd_lower", "two_sd_upper"), row.pop("two_sd"), strict=True))
            row["n_robots"] = " ".join(map(str, score.n_robots))
            rows.append({"policy": self.policy, "scenario": self.scenario, **row})
        return pl.DataFrame(rows, infer_schema_length=None)

    def to_mapping(self) -> dict[str, Any]:
        """Return the table as plain values, ready for JSON."""
        return {
            "policy": self.policy,
            "scenario": self.scenario,
            "settings": dict(self.settings),
            "scores": [score.to_mapping() for score in self.scores],
            "missing": dict(self.missing),
            "failures": list(self.failures),
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return scores and notes."""
        place = HEADER.index("95 % interval") + 1
        header = (*HEADER[:place], BAND, *HEADER[place:]) if self.band else HEADER
        rows = [score.cells(band=self.band) for score in self.scores]
        scores = Sheet(title=title([self]), header=header, rows=rows)
        return scores, Sheet(notes=self.notes())

    @property
    def has_picture(self) -> bool:
        """Whether a score has runs."""
        return any(score.per_seed for score in self.scores)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the scores, see `draw_scores`."""
        draw_scores([self], path, band=self.band, style=style)


def title(tables: Sequence[ScoreTable]) -> str:
    """Return who was scored, where, and how much was run: "crw in warehouse_small, budget quick, 4 seeds, 4,000 s"."""
    words = ", ".join(table.policy for table in tables)
    scenario, settings = tables[0].scenario, tables[0].settings
    if scenario:
        words += f" in {scenario}"
    if settings.get("performance", "collected") != "collected":
        words += f", performance {settings['performance']}"
    if "budget" in settings:
        seeds = counted(len(settings["seeds"]), "seed")
        words += f", budget {settings['budget']}, {seeds}, {settings['horizon_s']:,g} s"
    return words


@dataclass(frozen=True, kw_only=True, eq=False)
class Difference:
    """Score of one policy minus that of another, at one level of one measure."""

    measure: str
    label: str
    """Name of the measure with its variant and form, as in `Score.label`."""
    at: str
    n_robots: tuple[int, ...]
    first: str
    second: str
    is_relative: bool
    """Whether scores relative to performance are compared, or the scores themselves."""
    summary: Summary
    """Mean difference of runs with the same seed, with its interval."""
    p: float
    """p value of the paired t test; NaN where there is none (fewer than two pairs, infinite scores)."""
    p_holm: float = math.nan
    """The same after Holm's correction over all levels and pairs of policies of the measure; relative scores have a
    correction of their own."""

    @property
    def key(self) -> tuple[str, str, bool, str, str, tuple[int, ...]]:
        """Which policies are compared, and in which score."""
        return self.first, self.second, self.is_relative, self.label, self.at, self.n_robots

    @property
    def is_significant(self) -> bool:
        """Whether p_holm is at most `SIGNIFICANT`."""
        return self.p_holm <= SIGNIFICANT

    @property
    def better(self) -> str:
        """The better policy if the difference is significant, else empty."""
        if not self.is_significant:
            return ""
        return self.first if (self.summary.mean > 0.0) == METRICS[self.measure].higher_is_better else self.second

    def cell(self) -> str:
        """Return the difference as a text, with its half interval and a star if it is significant."""
        return spread(self.summary, is_share=self.is_relative) + (" *" if self.is_significant else "")

    def to_mapping(self) -> dict[str, Any]:
        """Return the difference as plain values."""
        return {
            "measure": self.measure,
            "label": self.label,
            "at": self.at,
            "n_robots": list(self.n_robots),
            "first": self.first,
            "second": self.second,
            "relative": self.is_relative,
            "difference": plain(self.summary.mean),
            "lower": plain(self.summary.lower),
            "upper": plain(self.summary.upper),
            "n_pairs": self.summary.n_used,
            "p": plain(self.p),
            "p_holm": plain(self.p_holm),
            "significant": self.is_significant,
            "better": self.better,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison(Answer):
    """Score tables side by side, with the differences between all pairs of policies; one table is shown as it is."""

    tables: tuple[ScoreTable, ...]
    differences: tuple[Difference, ...] = ()

    @property
    def policies(self) -> tuple[str, ...]:
        """Names of the policies, in the order given."""
        return tuple(table.policy for table in self.tables)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs of policies that are compared."""
        return tuple(combinations(self.policies, 2))

    def rows(self) -> tuple[Score, ...]:
        """Return one score per row, of the first policy that has it."""
        rows = {score.key: score for table in reversed(self.tables) for score in reversed(table.scores)}
        ordered = dict.fromkeys(score.key for table in self.tables for score in table.scores)
        return tuple(rows[key] for key in ordered)

    def score(self, policy: str, row: Score) -> Score | None:
        """Return the score of a policy in a row, None if it has none."""
        table = next(table for table in self.tables if table.policy == policy)
        return next((score for score in table.scores if score.key == row.key), None)

    def difference(self, pair: tuple[str, str], row: Score, *, is_relative: bool = False) -> Difference | None:
        """Return the difference of a pair of policies in a row, None where there is nothing to compare."""
        key = (*pair, is_relative, *row.key)
        return next((d for d in self.differences if d.key == key), None)

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON."""
        tables = [table.to_mapping() for table in self.tables]
        if len(tables) == 1:
            return {"tables": tables}
        return {"test": TEST, "tables": tables, "differences": [one.to_mapping() for one in self.differences]}

    @property
    def band(self) -> bool:
        """Whether the authors' bands stand beside the values."""
        return any(table.band for table in self.tables)

    def value_rows(self) -> list[tuple[str, ...]]:
        """Return the values side by side as texts, a row of headings first; distances have a row of noise floors."""
        lines = [("measure", "at", "better", *self.policies)]
        for row in self.rows():
            scores = [self.score(policy, row) for policy in self.policies]
            better = "higher" if row.higher_is_better else "lower"
            lines.append((row.label, row.at, better, *(_cell(score, band=self.band) for score in scores)))
            if any(score is not None and score.noise_floor is not None for score in scores):
                lines.append(
                    (
                        f"{row.label}, noise floor",
                        row.at,
                        "",
                        *(score.floor_cell() if score else "-" for score in scores),
                    )
                )
        return lines

    def difference_rows(self, pairs: Sequence[tuple[str, str]] | None = None) -> list[tuple[str, ...]]:
        """Return the differences of pairs of policies (default: all) as texts, a row of headings first."""
        pairs = self.pairs if pairs is None else pairs
        lines = [("measure", "at", *(f"{first} - {second}" for first, second in pairs))]
        for row in self.rows():
            for is_relative in (False, True):
                found = [self.difference(pair, row, is_relative=is_relative) for pair in pairs]
                if any(found):
                    name = f"{row.label}, relative" if is_relative else row.label
                    lines.append((name, row.at, *("-" if d is None else d.cell() for d in found)))
        return lines

    def notes(self) -> tuple[str, ...]:
        """Return notes to the scores, policy by policy; a note that holds for all of them appears once."""
        per_table = [table.notes() for table in self.tables]
        shared = [note for note in per_table[0] if all(note in notes for notes in per_table)]
        own = [
            f"{table.policy}: {note}"
            for table, notes in zip(self.tables, per_table, strict=True)
            for note in notes
            if note not in shared
        ]
        return (*shared, *own)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return values, differences and notes."""
        if len(self.tables) == 1:
            return self.tables[0].sheets()
        header, *rows = self.value_rows()
        about = (VALUES, BANDS) if self.band else (VALUES,)
        parts = [Sheet(title=title(self.tables), header=header, rows=rows, notes=about)]
        for start in range(0, len(self.pairs), PAIRS_PER_TABLE):
            header, *rows = self.difference_rows(self.pairs[start : start + PAIRS_PER_TABLE])
            is_last = start + PAIRS_PER_TABLE >= len(self.pairs)
            parts.append(Sheet(header=header, rows=rows, notes=(TEST,) if is_last else ()))
        return *parts, Sheet(notes=self.notes())

    @property
    def has_picture(self) -> bool:
        """Whether a score has runs."""
        return any(table.has_picture for table in self.tables)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the scores of all policies, see `draw_scores`."""
        draw_scores(self.tables, path, band=self.band, style=style)


def side_by_side(tables: Sequence[ScoreTable]) -> Comparison:
    """Return tables as one answer; several are compared, see `compare_tables`."""
    return Comparison(tables=tuple(tables)) if len(tables) == 1 else compare_tables(tables)


def compare_tables(tables: Sequence[ScoreTable]) -> Comparison:
    """Compare score tables of the same experiments: all pairs of policies, row by row, runs paired by seed.

    Raises:
        CurveError: fewer than two tables, two of the same name, or tables of different performances.
    """
    names = [table.policy for table in tables]
    if len(names) < 2 or len(set(names)) < len(names):
        raise CurveError(f"Expected two or more policies of different names to compare, got {', '.join(names)}.")
    performances = [table.settings.get("performance") for table in tables]
    if len(set(performances)) > 1:
        told = ", ".join(f"{named} of {name}" for name, named in zip(names, performances, strict=True))
        raise CurveError(f"Expected tables of one performance to compare, got {told}; score them by the same.")
    scores = {table.policy: {score.key: score for score in table.scores} for table in tables}
    found = [
        difference
        for first, second in combinations(names, 2)
        for key, score in scores[first].items()
        if key in scores[second]
        for difference in _differences(score, scores[second][key], first, second)
    ]
    families: dict[tuple[str, bool], list[int]] = {}
    for index, one in enumerate(found):
        families.setdefault((one.label, one.is_relative), []).append(index)
    for family in families.values():
        corrected = holm(np.array([found[index].p for index in family]))
        for index, p_holm in zip(family, corrected.tolist(), strict=True):
            found[index] = replace(found[index], p_holm=p_holm)
    return Comparison(tables=tuple(tables), differences=tuple(found))


def _differences(score: Score, other: Score, first: str, second: str) -> Iterator[Difference]:
    """One score of two policies, itself and relative to performance, before the correction."""
    kinds = ((False, score.per_seed, other.per_seed), (True, score.relative_per_seed, other.relative_per_seed))
    for is_relative, mine, theirs in kinds:
        if mine and theirs:
            values = _paired_differences(mine, theirs)
            is_known = values.size > 0 and bool(np.isfinite(values).all())
            yield Difference(
                measure=score.measure,
                label=score.label,
                at=score.at,
                n_robots=score.n_robots,
                first=first,
                second=second,
                is_relative=is_relative,
                summary=aggregate(values) if is_known else Summary.without_interval(n_used=values.size),
                p=paired_p(values),
            )


def _paired_differences(first: Mapping[int, float], second: Mapping[int, float]) -> FloatArray:
    """Differences of runs with the same seed, without those in which a score does not exist."""
    with np.errstate(invalid="ignore"):
        values = np.array([first[seed] - second[seed] for seed in first if seed in second], dtype=np.float64)
    undefined = [math.isnan(first[seed]) or math.isnan(second[seed]) for seed in first if seed in second]
    return values[~np.array(undefined, dtype=bool)]


def _cell(score: Score | None, *, band: bool) -> str:
    """Value with its half interval, relative to performance, its band, and marks for missing runs and doubt."""
    if score is None:
        return "-"
    relative = score.relative_cell() if score.relative is None else percent(score.relative.mean)
    relative = relative and f" ({relative})"
    deviations = f" [{limits(*score.band)}]" if band and score.summary.n_used > 1 else ""
    marks = (" !" if score.is_partial else "") + (f" {DOUBTFUL}" if score.is_doubtful else "")
    return spread(score.summary) + relative + deviations + marks
