"""docs/results.md with its pictures and data: what runs of the paper's sets say of its claims.

    scripts/write_results DIR|FILE ...               from folders of studies, or from their packed files
    scripts/write_results                            from the packed runs of docs/results, those of an earlier call
    scripts/write_results --check                    say whether page and tables are those of these runs; exit 1 if not
    scripts/write_results --out FOLDER DIR|FILE ...  the same with another folder than docs

What is given is packed into docs/results, and all that is written comes of these files; `results_data.py` says what
lies there. Folders also say how long the runs took.

Needs the extra "plots". The interpreter is $PYTHON, else that of the active environment or of .venv, else python3.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from PIL import Image
from results_data import (
    DATA,
    MEASURES,
    RUNS,
    UNDECIDED,
    VERDICTS,
    rows,
    run_words,
    runs_of,
    ship,
    shipped,
    write_numbers,
)
from results_undecided import undecided_claims

from metrics import verdict
from metrics.claims import CLAIMS, INTUITIONS, Verdict
from metrics.scoring import StudyFigure, StudyVerdict, draw_figure, study_figures
from metrics.scoring.study_models import model_figures
from metrics.scoring.study_numbers import place_distributions
from metrics.scoring.study_report import command_of
from metrics.scoring.study_verdict import (
    ANSWERS,
    BANDS,
    OURS,
    RELATIVELY,
    VARIANTS,
    WAITS,
    claims_about,
    claims_of,
    waiting_lines,
)
from swarm_forage_env import read_study
from swarm_forage_env._internal.wording import counted, number, percent
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.studies.study import StudySpec
from swarm_forage_env.studies.study_file import (
    PAPER,
    budget_names,
    is_set_of_paper,
    left_out_words,
    load_study,
    set_names,
)
from swarm_forage_env.studies.study_table import StudyTable

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = Path("images/results")
PAGE = "results.md"
COLOURS = 64
"""Of a picture; with more, its file is several times as large and looks the same."""
NIGHT_CORE_H = 80.0
"""A night of ten hours on eight cores."""
SIGNS: dict[str, str] = {
    "supported": "✓",
    "contradicted": "✗",
    "tie": "=",
    "too vague": "~",
    "undecided": "?",
    "no scores": "-",
}

INTRODUCTION = f"""Each claim of the paper is held against these runs, under both [readings](readings.md) of its rules.
A claim that is contradicted is a result like any other. Some rules were wrong and were changed after runs were seen:
[which, and why](metrics.md#rules-that-changed-after-runs-were-seen). How claims are decided is in
[metrics.md](metrics.md#the-papers-claims), how studies are run in [studies.md](studies.md).

The runs lie beside this page, packed, so that everybody can check it without running anything: [runs]({DATA}/runs.csv),
[every measure with its interval]({DATA}/measures.csv),
[every verdict with what it was decided on]({DATA}/verdicts.csv), and
[every undecided claim with what would decide it]({DATA}/undecided.csv). Behind the name of a set stand the first digits
of the digest of its runs. `swarm-forage study verdict docs/{DATA}/*.parquet` gives the answers, `scripts/write_results`
this page with its tables and pictures; nothing in it is typed by hand."""


def judged(folder: Path) -> StudyVerdict:
    """Score and judge the studies whose runs lie in a folder."""
    return verdict(*shipped(folder), tell=lambda words: print(words, file=sys.stderr))


def what_is_there(results: StudyVerdict) -> str:
    """Return how many runs of the sets the page is of, and which sets and conditions are not run yet, per budget."""
    return "\n\n".join(_of_budget(results, budget) for budget in dict.fromkeys(t.spec.budget for t in results.tables))


def plan_of(table: StudyTable) -> StudySpec:
    """Return the whole study of which a table may hold fewer seeds, or rules."""
    spec = table.spec
    if not is_set_of_paper(spec):
        return spec
    plan = load_study(spec.name, spec.budget)
    return plan if len(plan.seeds) >= len(spec.seeds) else replace(plan, seeds=spec.seeds)


def _of_budget(results: StudyVerdict, budget: str) -> str:
    tables: dict[str, list[StudyTable]] = {}
    for table in results.tables:
        if table.spec.budget == budget:
            tables.setdefault(table.spec.name, []).append(table)
    plans = {name: load_study(name, budget) for name in set_names() if budget in budget_names(name)}
    plans |= {name: plan_of(some[0]) for name, some in tables.items()}
    sets: dict[str, list[str]] = {"Sets with all runs": [], "Sets run until claims are decided": [], "Sets not run": []}
    whole, decided, nothing = sets.values()
    in_part: list[str] = []
    n_there = 0
    for name, plan in sorted(plans.items()):
        done = [count for table in tables.get(name, ()) for count in n_done(table)]
        n_places, n_seeds = len(plan.places), len(plan.seeds)
        n_there += sum(done)
        n_whole, n_begun = (sum(count >= least for count in done) for least in (n_seeds, 1))
        if n_begun == 0:
            nothing.append(name)
        elif n_whole == n_places:
            whole.append(name)
        elif any(table.spec.looks for table in tables[name]):
            decided.append(name)
        else:
            in_part.append(
                f"\n- {name}: {n_whole:,} of {counted(n_places, 'condition')} whole, with {counted(n_seeds, 'run')} "
                f"each; {n_begun - n_whole:,} begun, {n_places - n_begun:,} not run"
            )
    of = f" of the paper's sets at budget `{budget}`" if budget else ""
    n_planned = sum(plan.n_runs for plan in plans.values())
    some = f"all {n_planned:,}" if n_there == n_planned else f"{n_there:,} of {n_planned:,}"
    text = f"**This page is based on {some} runs{of}.**"
    for words, names in sets.items():
        text += f" {words}: {', '.join(names) or 'none'}." if names or names is not decided else ""
    return text + (" Sets of which runs are still to be made:\n" + "".join(in_part) if in_part else "")


def n_done(table: StudyTable) -> list[int]:
    """Return how many runs of each condition there are."""
    return [state.n_runs[DONE] for state in table.place_states()]


def what_ran(results: StudyVerdict) -> str:
    """Return the part on runs and what they took."""
    lines: list[tuple[Any, ...]] = []
    for table in results.tables:
        done = n_done(table)
        took = "-" if table.wall_time_s is None else f"{table.wall_time_s / 3600.0:.2f}"
        where = (run_words(table), table.spec.title, table.spec.budget, ", ".join(table.spec.rules))
        lines.append(
            (
                *where,
                f"{sum(done):,} of {plan_of(table).n_runs:,}",
                per_condition(table),
                f"{table.spec.horizon_s:,.0f}",
                took,
            )
        )
    known = [table.wall_time_s for table in results.tables if table.wall_time_s is not None]
    total = f"\n\nAll runs together took {sum(known) / 3600.0:.1f} hours of one core.{what_the_rest_takes(results)}"
    total = total if known else ""
    header = ("runs", "about", "budget", "rules", "finished", "per condition", "length, s", "hours")
    return (
        "## What was run\n\n"
        f"{rows(header, lines, right=(4, 5, 6, 7))}\n\n"
        "Hours are those of one core by the clock, other work of the machine included; a dash where they are not "
        "known. Fewer than four runs of a condition decide nothing by intervals." + total
    )


def values_without_runs(table: StudyTable) -> str:
    """Return the values of axes that no run has, by plan: those that run until claims are decided make none of them."""
    if not table.spec.looks:
        return ""
    ran = [state.place.values for state in table.place_states() if state.n_runs[DONE]]
    lacks = {
        axis.name: [value for value in axis.values if all(values[index] != value for values in ran)]
        for index, axis in enumerate(table.spec.axes)
    }
    return "; ".join(f"{name} {', '.join(map(_value, values))}" for name, values in lacks.items() if values)


def per_condition(table: StudyTable) -> str:
    """Return how many runs conditions have, "4" or "4 to 192"; without those that have none by plan."""
    done = [n for n in n_done(table) if n or not table.spec.looks] or [0]
    return f"{min(done)} to {max(done)}" if min(done) < max(done) else str(min(done))


def what_the_rest_takes(results: StudyVerdict) -> str:
    """Return what whole sets take at the rate of these runs, in proportion to robots times ticks; "" if unknown."""
    timed = [table for table in results.tables if table.wall_time_s]
    done = sum(
        state.n_runs[DONE] * table.spec.specs_of(state.place)[0].robot_ticks
        for table in timed
        for state in table.place_states()
    )
    if not done:
        return ""
    rate_h = sum(table.wall_time_s or 0.0 for table in timed) / done / 3600.0
    budgets = dict.fromkeys((*(table.spec.budget for table in timed), PAPER))
    ticks = {
        budget: sum(load_study(name, budget).robot_ticks for name in set_names() if budget in budget_names(name))
        for budget in budgets
    }
    words = " and ".join(f"{number(rate_h * n)} at budget `{budget}`" for budget, n in ticks.items() if n)
    night = percent(min(1.0, NIGHT_CORE_H / (rate_h * ticks[PAPER])))
    return (
        f" In proportion to robots times ticks, all {len(set_names())} sets under both rules take {words}, in "
        f"core-hours. A night of ten hours on eight cores makes {night} of the latter."
    )


def answers(results: StudyVerdict) -> str:
    """Return how many claims have which answer, and the answer to each, measures corrected."""
    lines: list[tuple[str, ...]] = []
    for name, claim in CLAIMS.items():
        cells = [_signed(cell) for rules in results.rules for cell in results.cells(claim, rules)]
        lines.append((name, claim.text, *cells, runs_of(claim, results) or "-"))
    columns = [f"{rules}: {word}" for rules in results.rules for word in (BANDS, OURS, RELATIVELY)]
    return (
        f"## The answers\n\n{how_many(results)}\n\n"
        "Measures are corrected. The paper's bands are two standard deviations of runs to either side of the mean, and "
        "two policies differ where they do not overlap. Ours is by intervals; claims about flexibility and robustness "
        "are answered relative to performance, too. A tie is the answer where a claim says that there is a difference."
        f"{_otherwise(results)}{_on_fewer_values(results)}\n\n{rows(('claim', 'the paper', *columns, 'runs'), lines)}"
    )


def how_many(results: StudyVerdict) -> str:
    """Return how many claims have which answer, with each form of the measures and by each rule."""
    lines: list[tuple[Any, ...]] = []
    for rules in results.rules:
        for variant in VARIANTS:
            counts, by_bands = (results.counts(rules, variant, by_bands=each) for each in (False, True))
            lines.append((rules, variant, *(counts[word] for word in ANSWERS), *by_bands.values()))
    header = ("rules", "measures", *ANSWERS, *(f"{word} by bands" for word in ANSWERS), "waiting for runs")
    return (
        f"{rows(header, lines, right=range(2, 3 + 2 * len(ANSWERS)))}\n\n"
        "Claims that need no run, about formulas or too vague, are counted with the corrected measures."
    )


def _otherwise(results: StudyVerdict) -> str:
    """A sentence on the claims to which another form or sense gives another answer; empty if there are none."""
    given: dict[tuple[str, str], set[str]] = {}
    for one in results.judged:
        answers_here = given.setdefault((one.claim.name, one.rules), set())
        answers_here |= {verdict.answer for verdict in (one.verdict, *one.verdict.otherwise.values())} - {"no scores"}
    names = [name for name in CLAIMS if any(len(given.get((name, rules), ())) > 1 for rules in results.rules)]
    words = f"[some of them]({DATA}/{VERDICTS}) give another answer"
    return (
        f" With other forms of the measures, or in another sense of the paper's words, {words} to {', '.join(names)}."
        if names
        else ""
    )


def _on_fewer_values(results: StudyVerdict) -> str:
    """A sentence on the claims that are judged on fewer values than in the paper; empty if there are none."""
    names = {name for table in results.tables if left_out_words(table.spec) for name in claims_of(table.spec.name)}
    words = ", ".join(name for name in CLAIMS if name in names)
    return f" Judged [on fewer values than the paper's](#what-is-left-out): {words}." if words else ""


def _answer(found: Verdict | None) -> str:
    if found is None:
        return WAITS
    words = _signed(found.answer)
    return words if found.by_bands == found.answer else f"{words} ({found.by_bands})"


def _signed(answer: str) -> str:
    """An answer behind its sign."""
    return f"{SIGNS[answer]} {answer}" if answer in SIGNS else answer


def intuitions(results: StudyVerdict) -> str:
    """Return what the paper expected, with the answers."""
    found = results.found
    lines = [
        (
            name,
            claim.figure.split(",")[0],
            claim.text,
            *(_answer(found.get((name, rules, "corrected"))) for rules in results.rules),
            runs_of(claim, results) or "-",
        )
        for name, claim in INTUITIONS.items()
    ]
    return (
        "## What the paper expected\n\nIts tables of intuitions, written before its experiments, in our words, with "
        'what we take "modest" and "low" to mean.'
        f"\n\n{rows(('name', 'where', 'expected', *results.rules, 'runs'), lines)}"
    )


def pictured(results: StudyVerdict) -> Iterator[tuple[StudyTable, list[StudyFigure]]]:
    """Yield each study with its figures that claims are about, measures corrected.

    They are those of the first rules that it has, and of another one where the answer to one of the claims differs.
    """
    answers = {key: found.answer for key, found in results.found.items()}
    for table, panels in zip(results.tables, results.scored, strict=True):
        shown: list[StudyFigure] = []
        for figure in study_figures(panels):
            first = figure.panels[0]
            names, both = claims_about(figure.panels), (table.spec.rules[0], first.rules)
            differs = any(len({answers.get((name, rules, "corrected")) for rules in both}) > 1 for name in names)
            if first.variant == "corrected" and names and (first.rules == both[0] or differs):
                shown.append(figure)
        yield table, shown


def figures(results: StudyVerdict, folder: Path | None) -> str:
    """Draw the pictures into a folder, if there is one, and return the part that shows them."""
    if folder is not None:
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)
        for old in (folder / PICTURES).glob("*.png"):
            old.unlink()
    parts = [
        "## Figures",
        "Those that claims are about, measures corrected, and models beside runs ([laws.md](laws.md)). The second "
        "rules are shown where the answer to one of the claims differs. All others: `swarm-forage study plot`.",
    ]
    found = results.found
    for table, shown in pictured(results):
        parts += [f"### {table.spec.name}: {table.spec.title}", f"Runs: {run_words(table)}."] if shown else []
        for figure in shown:
            parts.append(_pictured(figure.name, figure.title, folder, lambda path, it=figure: draw_figure(it, [path])))
            rules = figure.panels[0].rules
            told = [f"{name} {_answer(found.get((name, rules, 'corrected')))}" for name in claims_about(figure.panels)]
            parts.append(f"Claims: {', '.join(told)}.")
        for model in model_figures(table):
            if model.rules == table.spec.rules[0]:
                parts.append(_pictured(model.name, model.title, folder, lambda path, it=model: it.draw([path])))
    return "\n\n".join(parts)


def _pictured(name: str, title: str, folder: Path | None, draw: Callable[[Path], None]) -> str:
    """Draw a picture, make its file small, and return what shows it."""
    path = PICTURES / f"{name}.png"
    if folder is not None:
        draw(folder / path)
        with Image.open(folder / path) as picture:
            fewer = picture.convert("RGB").quantize(COLOURS)
        fewer.save(folder / path, optimize=True)
    return f"![{title}]({path.as_posix()})"


def breakdowns(results: StudyVerdict) -> str:
    """Return in how many conditions of each set runs broke down, and where most often."""
    lines: list[tuple[Any, ...]] = []
    for table in results.tables:
        places = place_distributions(table)
        judged = places.filter(places["broken"].is_not_null())
        broken = judged.filter(judged["broken"] > 0.0).sort("broken", descending=True, maintain_order=True)
        axis = [item.name for item in table.spec.axes]
        worst = ""
        if len(broken):
            row = broken.row(0, named=True)
            place = ", ".join(f"{name.replace('_', ' ')} {_value(row[name])}" for name in axis)
            half = "" if math.isinf(row["half_broken_s"]) else f", half by {row['half_broken_s']:,.0f} s"
            share = f"{round(row['broken'] * row['n_runs'])} of {counted(row['n_runs'], 'run')}"
            worst = f"{row['policy']}, {row['rules']}, {place}: {share}{half}"
        lines.append((run_words(table), len(places), len(judged), len(broken), worst or "-"))
    header = ("runs", "conditions", "judged", "with a breakdown", "most often")
    return (
        "## Breakdowns\n\nA mean hides runs that broke down: they end below half of the reference and stay there "
        "([metrics.md](metrics.md#all-runs-not-means-alone)). The reference is the undisturbed swarm; where sizes "
        "vary, it is the best size, and only swarms as large are judged.\n\n" + rows(header, lines, right=(1, 2, 3))
    )


def _value(value: Any) -> str:
    return number(float(value)) if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def left_out(results: StudyVerdict) -> str:
    """Return which claims and measures are not there, and how all runs are made again."""
    lines = [f"- {line.strip()}" for line in waiting_lines((*results.waiting, *results.expected_later))[1:]]
    for table, panels in zip(results.tables, results.scored, strict=True):
        missing = {f"{measure}, {variant}: {why}" for (measure, variant), why in panels.missing.items()}
        lines += [f"- {table.spec.name}, {words}" for words in sorted(missing)]
    commands = "\n".join(dict.fromkeys(commands_of(results.tables)))
    return (
        f"## What is left out\n\n{fewer_values(results)}"
        + ("\n".join(lines) or "Nothing waits.")
        + f"\n\n## To run it again\n\n```bash\n{commands}\nscripts/write_results results/studies/*\n```"
    )


def commands_of(tables: Sequence[StudyTable]) -> Iterator[str]:
    """Yield the commands that make the runs again: one of all sets that share the hours until claims are decided."""
    decided = [table for table in tables if table.spec.looks and is_set_of_paper(table.spec)]
    yield from (command_of(table) for table in tables if table not in decided)
    if decided:
        took = [table.wall_time_s for table in decided]
        known_s = None if None in took else sum(second or 0.0 for second in took)
        first = decided[0].spec.name
        names = " ".join(dict.fromkeys(table.spec.name for table in decided))
        command = command_of(replace(decided[0], wall_time_s=known_s))
        yield command.replace(f" {first} ", f" {names} ", 1).replace(" --until", " --out results/studies --until", 1)


def fewer_values(results: StudyVerdict) -> str:
    """Return what these studies have less of than the paper's, and the claims judged without it; "" if nothing."""
    lines: list[tuple[str, ...]] = []
    for table in results.tables:
        spec = table.spec
        n_paper = len(load_study(spec.name, PAPER).seeds) if is_set_of_paper(spec) else len(spec.seeds)
        words, unasked = left_out_words(spec), values_without_runs(table)
        if words or unasked or len(spec.seeds) < n_paper or spec.looks:
            none = "; ".join(filter(None, (words, f"{unasked} (no claim is about it)" if unasked else "")))
            runs = f"{per_condition(table)} of {n_paper}"
            lines.append((f"`{spec.name}`", none or "none", runs, ", ".join(claims_of(spec.name)) if words else "-"))
    header = ("set", "values of the paper that are left out", "runs each", "claims judged without these values")
    return f"Fewer runs and values than in the paper:\n\n{rows(header, lines)}\n\n" if lines else ""


def page(results: StudyVerdict, folder: Path | None) -> str:
    """Draw the pictures into a folder, if there is one, and return the page."""
    parts = [
        "# Results",
        what_is_there(results),
        INTRODUCTION,
        answers(results),
        undecided_claims(results),
        intuitions(results),
        figures(results, folder),
        breakdowns(results),
        what_ran(results),
        left_out(results),
    ]
    return "\n\n".join(parts) + "\n"


def differing(results: StudyVerdict, folder: Path) -> list[str]:
    """Return which files in a folder are not those of the results; pictures are not looked at."""
    with tempfile.TemporaryDirectory() as there:
        write_numbers(results, Path(there))
        tables = {
            f"{DATA}/{name}": Path(there, name).read_text(encoding="utf-8") for name in (MEASURES, VERDICTS, UNDECIDED)
        }
    expected = {PAGE: page(results, None), **tables}
    files = {name: folder / name for name in expected}
    there = {name: file.read_text(encoding="utf-8") for name, file in files.items() if file.is_file()}
    return [name for name, text in expected.items() if there.get(name) != text]


def main(words: Sequence[str] | None = None) -> int:
    """Write the page that the options ask for; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", type=Path, metavar="DIR|FILE")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if page or tables differ")
    parser.add_argument("--out", type=Path, default=DOCS, metavar="FOLDER", help="default docs")
    arguments = parser.parse_args(words)
    out = arguments.out
    if not arguments.places and not list((out / DATA).glob("*.parquet")):
        print(
            f"write_results: expected packed studies in {out / DATA}, or folders of studies, got none", file=sys.stderr
        )
        return 2
    try:
        if arguments.places:
            ship((read_study(place) for place in arguments.places), out / DATA)
        results = judged(out / DATA)
    except ValueError as error:  # no study, or one that no claim is about
        print(f"write_results: {error}", file=sys.stderr)
        return 2
    if arguments.check:
        others = differing(results, out)
        print(f"not those of the runs in {out / DATA}: {', '.join(others)}" if others else "as the runs have it")
        return int(bool(others))
    (out / PAGE).write_text(page(results, out), encoding="utf-8")
    write_numbers(results, out / DATA)
    n_pictures = len(list((out / PICTURES).glob("*.png")))
    tables = f"{RUNS}, {MEASURES}, {VERDICTS} and {UNDECIDED} in {out / DATA}"
    print(f"written {out / PAGE}, {tables}, {counted(n_pictures, 'picture')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
