"""docs/results.md with its pictures: what runs of the paper's sets say of its claims.

    scripts/write_results DIR|FILE ...               from folders of studies, or from their packed files
    scripts/write_results --out FOLDER DIR|FILE ...  the same into another folder than docs

Folders also say how long the runs took; packed files do not.

Needs the extra "plots". The interpreter is $PYTHON, else that of the active environment or of .venv, else python3.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

from metrics.claims import CLAIMS, INTUITIONS
from metrics.scoring import Judged, StudyFigure, StudyPanels, Waiting, draw_figure, judge_claims, study_figures
from metrics.scoring.texts import counted, number, percent
from metrics.scoring.verdicts import VARIANTS
from swarm_forage_env import read_study
from swarm_forage_env.cli.study_page import command_of
from swarm_forage_env.cli.study_verdict import scored_studies, waiting_lines
from swarm_forage_env.study.studies import StudySpec
from swarm_forage_env.study.study_file import budget_names, is_set_of_paper, load_study, set_names
from swarm_forage_env.study.study_run import DONE
from swarm_forage_env.study.study_table import StudyTable

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = Path("images/results")
COLOURS = 64
"""Of a picture; with more, its file is several times as large and looks the same."""
ANSWERS = ("supported", "contradicted", "undecided")
SIGNS = {"supported": "✓", "contradicted": "✗", "undecided": "?"}

INTRODUCTION = """What these runs say of the paper's claims, under both [readings](readings.md) of its rules. This page
and its pictures are written by `scripts/write_results`; nothing in them is typed by hand, and no threshold was moved
after the runs were seen. A claim that is contradicted is a result like any other. How claims are decided is in
[metrics.md](metrics.md#the-papers-claims), how studies are run in [studies.md](studies.md)."""


class Results(NamedTuple):
    """What the page is made of."""

    tables: list[StudyTable]
    scored: list[StudyPanels]
    judged: Sequence[Judged]
    waiting: Sequence[Waiting]
    expected: Sequence[Judged]
    expected_later: Sequence[Waiting]

    @property
    def readings(self) -> list[str]:
        """Readings that some study has."""
        return list(dict.fromkeys(reading for table in self.tables for reading in table.spec.readings))


def gathered(places: Sequence[Path]) -> Results:
    """Read, score and judge studies; the order is that of their names."""
    tables = sorted((read_study(place) for place in places), key=lambda table: table.spec.name)
    scored = scored_studies(tables, VARIANTS)
    return Results(
        tables, scored, *judge_claims(tables, scored), *judge_claims(tables, scored, ("corrected",), INTUITIONS)
    )


def rows(header: Sequence[str], lines: Sequence[Sequence[Any]], right: Sequence[int] = ()) -> str:
    """Return a table of Markdown; `right` are the columns that are aligned to the right."""
    under = ["--:" if place in right else "---" for place in range(len(header))]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in (header, under, *lines))


def what_is_there(results: Results) -> str:
    """Return how many runs of the sets the page is of, and which sets and cells are not run yet, per budget."""
    return "\n\n".join(_of_budget(results, budget) for budget in dict.fromkeys(t.spec.budget for t in results.tables))


def plan_of(table: StudyTable) -> StudySpec:
    """Return the whole study of which a table may hold fewer seeds or one reading."""
    spec = table.spec
    if not is_set_of_paper(spec):
        return spec
    plan = load_study(spec.name, spec.budget)
    return plan if len(plan.seeds) >= len(spec.seeds) else replace(plan, seeds=spec.seeds)


def _of_budget(results: Results, budget: str) -> str:
    tables = {table.spec.name: table for table in results.tables if table.spec.budget == budget}
    plans = {name: load_study(name, budget) for name in set_names() if budget in budget_names(name)}
    plans |= {name: plan_of(table) for name, table in tables.items()}
    n_there, n_planned = 0, 0
    whole: list[str] = []
    nothing: list[str] = []
    in_part: list[str] = []
    for name, plan in sorted(plans.items()):
        done = [state.n_runs[DONE] for state in tables[name].cell_states()] if name in tables else []
        n_cells, n_seeds = len(plan.cells), len(plan.seeds)
        n_there += sum(done)
        n_planned += plan.n_runs
        n_whole, n_begun = (sum(count >= least for count in done) for least in (n_seeds, 1))
        if n_begun == 0:
            nothing.append(name)
        elif n_whole == n_cells:
            whole.append(name)
        else:
            in_part.append(
                f"\n- {name}: {n_whole:,} of {counted(n_cells, 'cell')} whole, with {counted(n_seeds, 'run')} each; "
                f"{n_begun - n_whole:,} begun, {n_cells - n_begun:,} not run"
            )
    of = f" of the paper's sets at budget `{budget}`" if budget else ""
    text = f"**This page is of {n_there:,} of {counted(n_planned, 'run')}{of}.**"
    for words, names in (("Sets with all runs", whole), ("Sets not run", nothing)):
        text += f" {words}: {', '.join(names) or 'none'}."
    return text + (" Sets of which runs are still to be made:\n" + "".join(in_part) if in_part else "")


def what_ran(results: Results) -> str:
    """Return the part on runs and what they took."""
    lines: list[tuple[Any, ...]] = []
    for table in results.tables:
        done = [state.n_runs[DONE] for state in table.cell_states()]
        took = "-" if table.wall_time_s is None else f"{table.wall_time_s / 3600.0:.2f}"
        where = (f"`{table.spec.name}`", table.spec.title, table.spec.budget, ", ".join(table.spec.readings))
        lines.append(
            (*where, f"{sum(done):,} of {plan_of(table).n_runs:,}", min(done), f"{table.spec.horizon_s:,.0f}", took)
        )
    known = [table.wall_time_s for table in results.tables if table.wall_time_s is not None]
    total = f"\n\nAll runs together took {sum(known) / 3600.0:.1f} hours." if known else ""
    header = ("set", "about", "budget", "readings", "runs", "fewest per cell", "length, s", "hours")
    return (
        "## What was run\n\n"
        f"{rows(header, lines, right=(4, 5, 6, 7))}\n\n"
        "Hours are those of one core by the clock, other work of the machine included; a dash where only a packed file "
        "was at hand, which does not keep them. Fewer than four runs of a cell decide nothing by intervals." + total
    )


def in_short(results: Results) -> str:
    """Return how many claims have which answer."""
    lines: list[tuple[Any, ...]] = []
    for reading in results.readings:
        for variant in VARIANTS:
            mine = [one.verdict for one in results.judged if (one.reading, one.variant) == (reading, variant)]
            counts = [sum(verdict.answer == word for verdict in mine) for word in ANSWERS]
            by_bands = [sum(verdict.by_bands == word for verdict in mine) for word in ANSWERS]
            waiting = sum((one.reading, one.variant) == (reading, variant) for one in results.waiting)
            lines.append((reading, variant, *counts, *by_bands, waiting))
    header = ("reading", "measures", *ANSWERS, *(f"{word} by bands" for word in ANSWERS), "waiting")
    return (
        f"## In short\n\n{rows(header, lines, right=range(2, 9))}\n\n"
        "By intervals, our rule, and by the paper's, overlapping bands of two standard deviations of runs. Two more "
        "claims, V1 and V2, follow from formulas alone; both rules are in the table below."
    )


def claims_table(results: Results) -> str:
    """Return all claims with their answers in each reading, measures corrected."""
    found = {(one.claim.name, one.reading): one.verdict for one in results.judged if one.variant == "corrected"}
    lines: list[tuple[str, ...]] = []
    for name, claim in CLAIMS.items():
        cells = [_answer(found.get((name, reading if claim.panels else ""))) for reading in results.readings]
        lines.append((name, claim.text, claim.figure, *cells))
    return (
        "## Claims\n\nMeasures corrected. In each cell: the answer by intervals, by the paper's bands in brackets; the "
        "statistic that it was decided on; the effect, as a share of the largest mean in the figure; the smallest "
        "number of runs behind a number.\n\n" + rows(("claim", "text", "figure", *results.readings), lines)
    )


def _answer(verdict: Any) -> str:
    if verdict is None:
        return "waits"
    parts = [f"{SIGNS[verdict.answer]} **{verdict.answer}** ({verdict.by_bands})", number(verdict.statistic)]
    return "<br>".join([*parts, percent(verdict.effect), counted(verdict.n_runs, "run")])


def reasons(results: Results) -> str:
    """Return why each answer is what it is."""
    lines: list[str] = []
    for name in CLAIMS:
        mine = [one for one in results.judged if one.claim.name == name and one.variant == "corrected"]
        lines += [
            f"- **{name}**" + (f", {one.reading}" if one.reading else "") + f": {one.verdict.why}" for one in mine
        ]
    return "## Why\n\nWhat the statistic of each claim is, in words.\n\n" + "\n".join(lines)


def what_hangs_on_what(results: Results) -> str:
    """Return the claims whose answer depends on the reading, on the form of the measures or on the rule."""
    answers = {(one.claim.name, one.reading, one.variant): one.verdict for one in results.judged if one.reading}
    lines: list[tuple[str, ...]] = []
    for name in CLAIMS:
        here = {key[1:]: verdict.answer for key, verdict in answers.items() if key[0] == name}
        by_reading = {
            reading: here[reading, "corrected"] for reading in results.readings if (reading, "corrected") in here
        }
        if len(set(by_reading.values())) > 1:
            words = ", ".join(f"{reading}: {answer}" for reading, answer in by_reading.items())
            lines.append((name, "the reading of the rules", words))
        for reading, base in by_reading.items():
            others = {v: here[reading, v] for v in VARIANTS if (reading, v) in here and here[reading, v] != base}
            if others:
                words = ", ".join(f"{variant}: {answer}" for variant, answer in {"corrected": base, **others}.items())
                lines.append((name, f"the form of the measure ({reading})", words))
            by_bands = answers[name, reading, "corrected"].by_bands
            if by_bands != base:
                lines.append((name, f"the rule ({reading})", f"intervals: {base}, bands: {by_bands}"))
    text = rows(("claim", "hangs on", "answers"), lines) if lines else "No answer does."
    return (
        "## Answers that hang on a slip\n\nThe paper's description and the authors' program differ "
        "([readings.md](readings.md)), and so do the measures as meant, as printed (`paper`) and as programmed "
        f"(`sierra`, [errata.md](errata.md)). These answers are not the same in all of them:\n\n{text}"
    )


def intuitions(results: Results) -> str:
    """Return what the paper expected, with the answers."""
    found = {(one.claim.name, one.reading): one.verdict for one in results.expected}
    lines = [
        (name, claim.figure.split(",")[0], claim.text, *(_answer(found.get((name, r))) for r in results.readings))
        for name, claim in INTUITIONS.items()
    ]
    return (
        "## What the paper expected\n\nIts tables of intuitions, written before its experiments, in our words, with "
        'what we take "modest" and "low" to mean. Left out: that STOCHM is congested near its caches, since no measure '
        f"says where time is lost.\n\n{rows(('name', 'where', 'expected', *results.readings), lines)}"
    )


def pictured(results: Results) -> Iterator[tuple[StudyTable, list[StudyFigure]]]:
    """Yield each study with its figures that claims are about, measures corrected.

    They are those of the first reading that it has, and of another one where the answer to one of the claims differs.
    """
    about = {panel for claim in CLAIMS.values() for panel in claim.panels}
    answers = {
        (one.claim.name, one.reading): one.verdict.answer for one in results.judged if one.variant == "corrected"
    }
    for table, panels in zip(results.tables, results.scored, strict=True):
        shown: list[StudyFigure] = []
        for figure in study_figures(panels):
            first = figure.panels[0]
            here = {(panel.experiment or "", panel.measure) for panel in figure.panels}
            names = [name for name, claim in CLAIMS.items() if not here.isdisjoint(claim.panels)]
            base = table.spec.readings[0]
            differs = any(answers.get((name, base)) != answers.get((name, first.reading)) for name in names)
            if first.variant == "corrected" and here & about and (first.reading == base or differs):
                shown.append(figure)
        yield table, shown


def figures(results: Results, folder: Path) -> str:
    """Draw the pictures and return the part that shows them."""
    (folder / PICTURES).mkdir(parents=True, exist_ok=True)
    for old in (folder / PICTURES).glob("*.png"):
        old.unlink()
    parts = [
        "## Figures",
        "Those that claims are about, measures corrected. The second reading is shown where the answer to one of the "
        "claims differs. All others: `swarm-forage study plot`.",
    ]
    for table, shown in pictured(results):
        parts += [f"### {table.spec.name}: {table.spec.title}"] if shown else []
        for figure in shown:
            path = PICTURES / f"{figure.name}.png"
            draw_figure(figure, [folder / path])
            with Image.open(folder / path) as picture:
                fewer = picture.convert("RGB").quantize(COLOURS)
            fewer.save(folder / path, optimize=True)
            here = {(panel.experiment or "", panel.measure) for panel in figure.panels}
            names = [name for name, claim in CLAIMS.items() if not here.isdisjoint(claim.panels)]
            parts.append(f"![{figure.title}]({path.as_posix()})")
            parts.append(f"Claims: {', '.join(names)}.")
    return "\n\n".join(parts)


def left_out(results: Results) -> str:
    """Return which claims and measures are not there, and how all runs are made again."""
    lines = [f"- {line.strip()}" for line in waiting_lines((*results.waiting, *results.expected_later))[1:]]
    for table, panels in zip(results.tables, results.scored, strict=True):
        missing = {f"{measure}, {variant}: {why}" for (measure, variant), why in panels.missing.items()}
        lines += [f"- {table.spec.name}, {words}" for words in sorted(missing)]
    of_reduced = all(table.spec.budget == "reduced" for table in results.tables)
    budget = (
        "Budget `reduced` has fewer runs and values than the paper: [studies.md](studies.md#the-sets-of-the-paper); "
        "search and rescue ends at 320 robots.\n\n"
        if of_reduced
        else ""
    )
    commands = "\n".join(command_of(table) for table in results.tables)
    return (
        f"## What is left out\n\n{budget}"
        + ("\n".join(lines) or "Nothing waits.")
        + f"\n\n## To run it again\n\n```bash\n{commands}\nscripts/write_results results/studies/*_reduced\n```"
    )


def main(words: Sequence[str] | None = None) -> int:
    """Write the page that the options ask for; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="+", type=Path, metavar="DIR|FILE")
    parser.add_argument("--out", type=Path, default=DOCS, metavar="FOLDER", help="default docs")
    arguments = parser.parse_args(words)
    try:
        results = gathered(arguments.places)
    except ValueError as error:  # no study, or one that no claim is about
        print(f"write_results: {error}", file=sys.stderr)
        return 2
    parts = [what_ran, in_short, claims_table, what_hangs_on_what, intuitions, reasons]
    text = [
        "# Results",
        what_is_there(results),
        INTRODUCTION,
        *(part(results) for part in parts),
        figures(results, arguments.out),
        left_out(results),
    ]
    page = arguments.out / "results.md"
    page.write_text("\n\n".join(text) + "\n", encoding="utf-8")
    n_pictures = len(list((arguments.out / PICTURES).glob("*.png")))
    print(f"written {page}, {counted(n_pictures, 'picture')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
