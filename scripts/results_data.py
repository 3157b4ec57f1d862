"""Data beside docs/results.md: packed runs, and what was computed of them as tables that any program reads.

    <set>.parquet   the runs of a set: a packed study
    runs.csv        one row per set: digest of its runs, how many, what made them, hours
    measures.csv    one row per measure, rules, policy and level: mean over runs with its interval
    verdicts.csv    one row per claim, rules and form of the measures: the answer, and what it was decided on
    undecided.csv   one row per undecided claim and rules: the runs of each condition, and what more would decide it

In the tables a set stands with the first digits of the digest of its runs, "S1a 3f2a9c1d".
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl
import polars.selectors as cs

from metrics.claims import Claim
from metrics.claims.checking import RELATIVE
from metrics.scoring import StudyVerdict, study_figures, what_would_decide
from metrics.scoring.outlook import words_of
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.studies.study_table import StudyTable, read_study

RUNS, MEASURES, VERDICTS, UNDECIDED = "runs.csv", "measures.csv", "verdicts.csv", "undecided.csv"
DATA = "results"
"""Folder of the files, beside the page."""
DIGITS = 8
"""Of a digest, where it names runs."""
SIGNIFICANT = 6
"""Digits of numbers in the tables."""


def ship(tables: Iterable[StudyTable], folder: Path) -> None:
    """Write the runs of studies into the folder, and what is known of all runs there into `RUNS`."""
    given = list(tables)
    names = [table.spec.name for table in given]
    for table in given:
        rules = "" if names.count(table.spec.name) == 1 else f"_{'_'.join(table.spec.rules)}"
        table.write(folder / f"{table.spec.name}{rules}.parquet")
    there = given + [table for table in shipped(folder) if table.spec.name not in names]
    _write(folder / RUNS, map(_about, sorted(there, key=lambda table: table.spec.name)))


def shipped(folder: Path) -> list[StudyTable]:
    """Return the studies whose runs lie in the folder, by name, with the hours that they took where `RUNS` has them."""
    times_s = _times(folder)
    tables = [read_study(file) for file in sorted(folder.glob("*.parquet"))]
    return [replace(table, wall_time_s=times_s.get(table.digest)) for table in tables]


def write_numbers(results: StudyVerdict, folder: Path) -> None:
    """Write `MEASURES`, `VERDICTS` and `UNDECIDED` of the studies."""
    _write(folder / MEASURES, measures(results))
    _write(folder / VERDICTS, verdicts(results))
    _write(folder / UNDECIDED, undecided(results))


def run_words(table: StudyTable) -> str:
    """Return how numbers name their runs: the set and the first digits of their digest."""
    return f"{table.spec.name} {table.digest[:DIGITS]}"


def measures(results: StudyVerdict) -> Iterator[dict[str, Any]]:
    """Yield one row per measure, in its corrected form, policy and level at which it has a number."""
    for table, panels in zip(results.tables, results.scored, strict=True):
        for figure in study_figures(panels):
            first = figure.panels[0]
            if first.variant != "corrected":
                continue
            about = {"runs": run_words(table), "measure": first.measure, "form": first.form, "unit": first.unit}
            for row in figure.to_frame().filter(pl.col("n_runs") > 0).iter_rows(named=True):
                others = " ".join(f"{name} {row[name]:g}" for name in first.others)
                place = {"rules": row["rules"], "others": others, "policy": row["policy"]}
                numbers = ("level", "n_runs", "mean", "lower", "upper", "sd")
                yield {**about, **place, "value": row[first.criterion], **{name: row[name] for name in numbers}}


def verdicts(results: StudyVerdict) -> Iterator[dict[str, Any]]:
    """Yield one row per claim or intuition, rules and form of the measures, and one per other sense of its words."""
    for one in (*results.judged, *results.expected):
        for sense, found in {"": one.verdict, **one.verdict.otherwise}.items():
            yield {
                "claim": one.claim.name,
                "text": one.claim.text,
                "figure": one.claim.figure,
                "rules": one.rules,
                "measures": one.variant if one.rules else "",
                "sense": sense,
                "answer": found.answer,
                "by_bands": found.by_bands,
                "statistic": found.statistic,
                "effect": found.effect,
                "n_runs": found.n_runs,
                "why": found.why,
                "runs": runs_of(one.claim, results),
            }


@cache  # the page and its table need it
def undecided(results: StudyVerdict) -> tuple[dict[str, Any], ...]:
    """Return one row per claim that is not decided, also relative to performance, and rules.

    `core_hours` is what runs lack up to `decided_after`, or up to `last_look` where no look is foreseen to decide.
    """
    outlook = what_would_decide(results)
    return tuple(
        {
            "claim": one.open.claim.name,
            "sense": RELATIVE if one.open.is_relative else "",
            "rules": one.rules,
            "runs": min(outlook.reached[line] for line in one.lines),
            "decided_after": one.open.n_runs,
            "last_look": outlook.looks[-1],
            "core_hours": None if one.seconds is None else one.seconds / 3600.0,
            "needs_runs_of": words_of(one.lines),
        }
        for one in outlook.wanted
        if one.open is not None
    )


def rows(header: Sequence[str], lines: Sequence[Sequence[Any]], right: Sequence[int] = ()) -> str:
    """Return a table of Markdown; `right` are the columns that are aligned to the right."""
    under = ["--:" if place in right else "---" for place in range(len(header))]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in (header, under, *lines))


def runs_of(claim: Claim, results: StudyVerdict) -> str:
    """Return the runs that a claim is held against."""
    sets = {panel.experiment.split()[0] for panel in claim.panels}
    return ", ".join(run_words(table) for table in results.tables if table.spec.name in sets)


def _about(table: StudyTable) -> dict[str, Any]:
    made = [dict(versions) for versions in table.versions]
    took = table.wall_time_s
    done = [state.n_runs[DONE] for state in table.place_states()]
    return {
        "set": table.spec.name,
        "title": table.spec.title,
        "digest": table.digest,
        "study_id": table.spec.study_id,
        "budget": table.spec.budget,
        "rules": " ".join(table.spec.rules),
        "runs": sum(done),
        "fewest": min(done),
        "most": max(done),
        **{name: " ".join(sorted({one.get(name, "") for one in made})) for name in ("swarm-forage-env", "code")},
        "hours": None if took is None else took / 3600.0,
    }


def _times(folder: Path) -> dict[str, float]:
    """Digest of runs -> seconds of one core that they took."""
    if not (folder / RUNS).is_file():
        return {}
    kept = pl.read_csv(folder / RUNS).filter(pl.col("hours").is_not_null())
    return {digest: 3600.0 * hours for digest, hours in zip(kept["digest"], kept["hours"], strict=True)}


def _write(file: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    frame = pl.DataFrame(list(rows), infer_schema_length=None)
    frame = frame.with_columns(cs.float().round_sig_figs(SIGNIFICANT), cs.string().replace("", None))
    with replacing(file) as draft:
        frame.fill_nan(None).write_csv(draft)
