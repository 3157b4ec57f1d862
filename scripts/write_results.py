"""docs/results.md with its pictures and data: what runs of the paper's sets say of its claims.

    scripts/write_results                    from the packed runs of docs/results
    scripts/write_results --check            say whether page and tables are those of these runs; exit 1 if not

    docs/results/<set>.parquet   the runs of a set: a packed study
    docs/results/runs.csv        one row per set: how many runs, what made them, hours
    docs/results/measures.csv    one row per measure, rules, policy and level: mean over runs with its interval
    docs/results/verdicts.csv    one row per claim, rules and form of the measures: the answer, and why

Needs the extra "plots". The interpreter is $PYTHON, else that of the active environment or of .venv, else python3.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import polars as pl
import polars.selectors as cs
from PIL import Image

from metrics import verdict
from metrics.claims import CLAIMS, INTUITIONS, Claim
from metrics.scoring import StudyFigure, StudyVerdict, draw_figure, study_figures
from metrics.scoring.study_verdict import ANSWERS, BANDS, OURS, RELATIVELY, VARIANTS, claims_about
from swarm_forage_env import read_study

DOCS = Path(__file__).resolve().parent.parent / "docs"
DATA, PICTURES, PAGE = "results", Path("images/results"), "results.md"
COLOURS = 64
"""Of a picture; with more, its file is several times as large and looks the same."""
SIGNIFICANT = 6
"""Digits of numbers in the tables."""
INTRODUCTION = f"""Each claim of the paper is held against these runs, under both [readings](readings.md) of its rules.
A claim that is contradicted is a result like any other. [metrics.md](metrics.md#the-papers-claims) says how claims are
decided, and [which rules were changed](metrics.md#rules-that-changed-after-runs-were-seen) after runs were seen.

The runs lie beside this page: [runs]({DATA}/runs.csv), [every measure with its interval]({DATA}/measures.csv),
[every verdict with its reason]({DATA}/verdicts.csv). `swarm-forage study verdict docs/{DATA}/*.parquet` gives the
answers, `scripts/write_results` this page."""


def runs(results: StudyVerdict, hours: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    """Yield one row per set: how many runs it has, in all and per condition, and what made them."""
    for table in results.tables:
        done = table.places()["done"].to_list()
        made = sorted({dict(versions).get("swarm-forage-env", "") for versions in table.versions})
        counts = {"runs": sum(done), "fewest": min(n for n in done if n), "most": max(done)}
        about = {"set": table.spec.name, "title": table.spec.title, "rules": " ".join(table.spec.rules)}
        yield {**about, **counts, "version": " ".join(made), "hours": hours.get(table.spec.name)}


def measures(results: StudyVerdict) -> Iterator[dict[str, Any]]:
    """Yield one row per measure, in its corrected form, policy and level at which it has a number."""
    for table, panels in zip(results.tables, results.scored, strict=True):
        for figure in study_figures(panels):
            first = figure.panels[0]
            if first.variant != "corrected":
                continue
            about = {"set": table.spec.name, "measure": first.measure, "form": first.form, "unit": first.unit}
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
            }


def page(results: StudyVerdict, folder: Path | None) -> str:
    """Draw the pictures into a folder, if there is one, and return the page."""
    counts = [
        (rules, variant, *results.counts(rules, variant).values()) for rules in results.rules for variant in VARIANTS
    ]
    columns = [f"{rules}: {word}" for rules in results.rules for word in (BANDS, OURS, RELATIVELY)]
    parts = [
        "# Results",
        INTRODUCTION,
        "## The answers",
        rows(("rules", "measures", *ANSWERS, "waiting for runs"), counts),
        "The paper's bands are two standard deviations of runs to either side of the mean; two policies differ where "
        "they do not overlap. Ours is by intervals; claims about flexibility and robustness are answered relative to "
        "performance, too. A tie is the answer where a claim says that there is a difference.",
        rows(("claim", "the paper", *columns), [_answers(results, claim) for claim in CLAIMS.values()]),
        "## What the paper expected",
        "Its tables of intuitions, written before its experiments, in our words.",
        rows(("name", "expected", *columns), [_answers(results, claim) for claim in INTUITIONS.values()]),
        "## Figures",
        "Those that claims are about, under the described rules. All others: `swarm-forage study plot`.",
        *figures(results, folder),
    ]
    return "\n\n".join(parts) + "\n"


def _answers(results: StudyVerdict, claim: Claim) -> tuple[str, ...]:
    return (claim.name, claim.text, *(cell for rules in results.rules for cell in results.cells(claim, rules)))


def figures(results: StudyVerdict, folder: Path | None) -> Iterator[str]:
    """Draw the pictures into a folder, if there is one; yields the parts of the page that show them."""
    for table, panels in zip(results.tables, results.scored, strict=True):
        shown = [
            figure
            for figure in study_figures(panels)
            if (figure.panels[0].variant, figure.panels[0].rules) == ("corrected", table.spec.rules[0])
            and claims_about(figure.panels)
        ]
        if shown:
            yield f"### {table.spec.name}: {table.spec.title}"
        for figure in shown:
            path = PICTURES / f"{figure.name}.png"
            if folder is not None:
                _draw(figure, folder / path)
            yield f"![{figure.title}]({path.as_posix()})"
            yield f"Claims: {', '.join(claims_about(figure.panels))}."


def _draw(figure: StudyFigure, file: Path) -> None:
    draw_figure(figure, [file])
    with Image.open(file) as picture:
        fewer = picture.convert("RGB").quantize(COLOURS)
    fewer.save(file, optimize=True)


def rows(header: Sequence[str], lines: Sequence[Sequence[Any]]) -> str:
    """Return a table of Markdown."""
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in (header, ["---"] * len(header), *lines))


def written(results: StudyVerdict, pictures: Path | None) -> dict[str, str]:
    """Return file in docs -> its text, and draw the pictures into a folder, if there is one."""
    old = pl.read_csv(DOCS / DATA / "runs.csv").filter(pl.col("hours").is_not_null())
    hours = dict(zip(old["set"].to_list(), old["hours"].to_list(), strict=True))
    tables = {"runs": runs(results, hours), "measures": measures(results), "verdicts": verdicts(results)}
    return {PAGE: page(results, pictures), **{f"{DATA}/{name}.csv": _csv(lines) for name, lines in tables.items()}}


def _csv(lines: Iterator[Mapping[str, Any]]) -> str:
    frame = pl.DataFrame(list(lines), infer_schema_length=None)
    frame = frame.with_columns(cs.float().round_sig_figs(SIGNIFICANT), cs.string().replace("", None))
    text = StringIO()
    frame.fill_nan(None).write_csv(text)
    return text.getvalue()


def main(words: Sequence[str] | None = None) -> int:
    """Write what the options ask for; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if page or tables differ")
    is_check = parser.parse_args(words).check
    tables = [read_study(file) for file in sorted((DOCS / DATA).glob("*.parquet"))]
    files = written(verdict(*tables), None if is_check else DOCS)
    others = [name for name, text in files.items() if (DOCS / name).read_text(encoding="utf-8") != text]
    if is_check:
        print(f"not those of the runs in docs/{DATA}: {', '.join(others)}" if others else "as the runs have it")
        return int(bool(others))
    for name in others:
        (DOCS / name).write_text(files[name], encoding="utf-8")
    print(f"written: {', '.join(others) or 'nothing new'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
