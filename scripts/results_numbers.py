"""Numbers and answers of docs/results as fields of blocks in pages, which scripts/update_docs writes.

    results.C3                                      the answers to a claim under the rules described and program
    results.R2_relative                             the same relative to performance
    results.A5_ties_program                         how many of the comparisons of a claim tie, such as "19 of 42"
    results.N2_ties_described_relative              the same relative to performance
    results.S1a_raw_performance_described_crw_128   a mean of measures.csv: set, measure, rules, policy, value,
                                                    and values on other axes, such as _walk_probability_0
    results.runs, .sets, .hours, .version           what was run, and by what
    results.answers                                 how many claims have which answer, as a table
    results.contradicted, .supported, .split        claims with these answers under both rules, as tables

Answers are ours, by intervals, with the corrected measures; `write_results` writes the files.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from metrics.claims import CLAIMS
from swarm_forage_env._internal.wording import number

DESCRIBED, PROGRAM = RULES = ("described", "program")
SENSES = {"": "", "relative to performance": "_relative"}
"""Sense of a claim in verdicts.csv -> end of the name of a field."""
TIES = (
    re.compile(r"(?P<tie>\d+) of (?P<all>\d+) comparisons of .* tie,"),
    re.compile(r"\d+ of (?P<all>\d+) comparisons differ, (?P<tie>\d+) tie,"),
)
"""How the column "why" tells it, of claims that things tie and of claims that nothing differs."""
ANSWERS = ("supported", "contradicted", "tie", "undecided", "too vague")
"""Columns of the table, in this order; further ones follow."""


def results_fields(folder: Path) -> dict[str, str]:
    """Return the fields of the files in a folder such as docs/results."""
    answers = dict(_answers(folder / "verdicts.csv"))
    return {
        **{name: ", ".join(given) for name, given in answers.items()},
        **{
            f"{name}_relative": ", ".join(given)
            for name, given in _answers(folder / "verdicts.csv", "relative to performance")
        },
        **dict(_ties(folder / "verdicts.csv")),
        **dict(_means(folder / "measures.csv")),
        **_runs(folder / "runs.csv"),
        "answers": _counts(list(answers.values())),
        "contradicted": _claims(answers, ("contradicted", "contradicted")),
        "supported": _claims(answers, ("supported", "supported")),
        "split": _claims(answers, ("contradicted", "supported"), ("supported", "contradicted")),
    }


def _lines(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def _answers(file: Path, sense: str = "") -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield each claim of the paper and its answers; one about a formula has the same under both rules."""
    given = {
        (line["claim"], line["rules"]): line["answer"]
        for line in _lines(file)
        if line["measures"] in ("", "corrected") and line["sense"] == sense
    }
    for name in CLAIMS:
        of_formula = given.get((name, ""), "waiting")
        yield name, (given.get((name, DESCRIBED), of_formula), given.get((name, PROGRAM), of_formula))


def _ties(file: Path) -> Iterator[tuple[str, str]]:
    """Yield how many comparisons tie, for each claim and rules; of several conditions of a claim, in the first."""
    for line in _lines(file):
        if line["measures"] == "corrected" and line["sense"] in SENSES:
            name = f"{line['claim']}_ties_{line['rules']}{SENSES[line['sense']]}"
            first = line["why"].partition("\n")[0]
            yield from ((name, f"{found['tie']} of {found['all']}") for one in TIES if (found := one.search(first)))


def _means(file: Path) -> Iterator[tuple[str, str]]:
    """Yield all means of measures that compare neighbouring sizes, or none."""
    for line in _lines(file):
        if line["form"] == "marginal":
            others = line["others"].split()
            place = (line["measure"], line["rules"], line["policy"], f"{float(line['value']):g}", *others)
            yield "_".join([line["set"], *place]), number(float(line["mean"]))


def _runs(file: Path) -> dict[str, str]:
    lines = _lines(file)
    return {
        "runs": f"{sum(int(line['runs']) for line in lines):,}",
        "sets": f"{len(lines)}",
        "hours": f"{sum(float(line['hours'] or 0.0) for line in lines):.1f}",
        "version": ", ".join(sorted({line["version"] for line in lines})),
    }


def _table(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(line)} |" for line in (header, ["---"] * len(header), *lines))


def _counts(answers: Sequence[tuple[str, str]]) -> str:
    counts = [Counter(given[place] for given in answers) for place in range(len(RULES))]
    known = [*ANSWERS, *sorted(set().union(*counts) - set(ANSWERS))]
    return _table(
        ["rules", *known],
        [[rules, *(str(count[answer]) for answer in known)] for rules, count in zip(RULES, counts, strict=True)],
    )


def _claims(answers: dict[str, tuple[str, str]], *wanted: tuple[str, str]) -> str:
    found = [(name, CLAIMS[name].text, *given) for name, given in answers.items() if given in wanted]
    return _table(["claim", "the paper", *RULES], found) if found else "None."
