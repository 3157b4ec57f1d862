"""Numbers and answers of docs/results as fields of blocks in pages, which scripts/update_docs writes.

    results.C3                                      the answers to a claim under the rules described and program
    results.X1_amounts                              the same in another reading than the main one
    results.X1_shares_program                       how many statements hold and what comparisons show, in words
    results.X1_5_shares_program                     the contrast of the fifth statement, with its interval
    results.S1a_raw_performance_described_crw_128   a mean of measures.csv: set, measure, rules, policy, value,
                                                    and values on other axes, such as _walk_probability_0
    results.runs, .sets, .hours, .version           what was run, and by what
    results.per_condition                           the fewest and the most runs of a condition
    results.answers                                 how many claims have which answer, as a table
    results.contradicted, .supported, .equivalent   claims with these answers under both rules, as tables
    results.split                                   claims supported under one of the rules alone, else contradicted
    results.readings                                claims whose readings part, as a table
    results.same_described, .same_program           of the claims that runs decide, how many an earlier study decided so
    results.new_described, .new_program             which of them it did not decide so
    results.X1_figures                              the contrasts of all figures of a claim, as a table
    results.turned                                  claims that were decided before, and are decided otherwise

`write_results` writes the files.
"""

import csv
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from metrics.claims import CLAIMS
from swarm_forage_env._internal.wording import number

RULES = ("described", "program")
READINGS = ("amounts", "shares", "bands")
ANSWERS = ("supported", "contradicted", "equivalent", "open", "untestable")
"""Columns of the table, in this order; further ones follow."""

SIGNS = {"supported": "+", "contradicted": "-", "equivalent": "=", "open": "?", "untestable": "x", "no runs": "0"}
"""Answer -> its sign, as on the results page."""

Given = tuple[str, str]
"""The answers under both rules."""


DECIDED = ("supported", "contradicted", "equivalent")


def results_fields(folder: Path, earlier: Path) -> dict[str, str]:
    """Return the fields of the files in a folder such as docs/results, beside those of an earlier study."""
    lines = _lines(folder / "verdicts.csv")
    main = _main(lines)
    before = _main(_lines(earlier / "verdicts.csv"))
    readings = {one: _answers([line for line in lines if line["reading"] == one]) for one in READINGS}
    return {
        **{name: ", ".join(given) for name, given in main.items()},
        **{f"{name}_{one}": ", ".join(given) for one, found in readings.items() for name, given in found.items()},
        **{f"{line['claim']}_{line['reading']}_{line['rules']}": _counted(line) for line in lines},
        **dict(_contrasts(folder / "contrasts.csv")),
        **dict(_means(folder / "measures.csv")),
        **runs_fields(folder),
        "answers": _counts([*main.values()]),
        **{word: _claims(main, before, lambda now, _, word=word: now == (word, word)) for word in ANSWERS},
        "split": _claims(main, before, lambda now, _: {*now} == {"supported", "contradicted"}),
        "turned": _claims(main, before, _has_turned),
        **dict(_decided(main, before)),
        "X1_figures": _figures(folder / "contrasts.csv", "X1"),
        "readings": _parted(readings),
    }


def _lines(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def _main(lines: Sequence[dict[str, str]]) -> dict[str, Given]:
    """Return the answers in the main reading."""
    return _answers([line for line in lines if line["is_main"] == "true"])


def _answers(lines: Sequence[dict[str, str]]) -> dict[str, Given]:
    """Return each claim of the paper that has answers, with them."""
    given = {(line["claim"], line["rules"]): line["answer"] for line in lines}
    named = [name for name in CLAIMS if any((name, rules) in given for rules in RULES)]
    return {name: (given.get((name, RULES[0]), "no runs"), given.get((name, RULES[1]), "no runs")) for name in named}


def _counted(line: dict[str, str]) -> str:
    return f"{line['n_held']} of {line['n_statements']}"


def _contrasts(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the contrast of each statement of each claim, in percent of the unit of its measure."""
    seen: Counter[tuple[str, str, str]] = Counter()
    for line in _lines(file):
        key = (line["claim"], line["reading"], line["rules"])
        seen[key] += 1
        if line["lower"]:
            yield f"{key[0]}_{seen[key]}_{key[1]}_{key[2]}", _percents(line).replace(" (", " % (")


def _percents(line: dict[str, str]) -> str:
    """Return a mean with its interval in percent."""
    numbers = (round(100.0 * float(line[name]), 1) + 0.0 for name in ("mean", "lower", "upper"))  # no "-0.0"
    mean, lower, upper = (f"{number:.1f}" for number in numbers)
    return f"{mean} ({lower} to {upper})"


def _means(file: Path) -> Iterator[tuple[str, str]]:
    """Yield all means of measures that compare neighbouring sizes, or none."""
    for line in _lines(file):
        if line["form"] == "marginal":
            others = line["others"].split()
            place = (line["measure"], line["rules"], line["policy"], f"{float(line['value']):g}", *others)
            yield "_".join([line["set"], *place]), number(float(line["mean"]))


def runs_fields(folder: Path) -> dict[str, str]:
    """Return what was run, and by what, of a folder such as docs/results."""
    lines = _lines(folder / "runs.csv")
    return {
        "runs": f"{sum(int(line['runs']) for line in lines):,}",
        "sets": f"{len(lines)}",
        "per_condition": f"{min(int(line['fewest']) for line in lines)} to {max(int(line['most']) for line in lines)}",
        "hours": f"{sum(float(line['hours'] or 0.0) for line in lines):.1f}",
        "version": ", ".join(sorted({line["version"] for line in lines})),
    }


def _table(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(line)} |" for line in (header, ["---"] * len(header), *lines))


def _counts(answers: Sequence[Given]) -> str:
    counts = [Counter(given[place] for given in answers) for place in range(len(RULES))]
    known = [*ANSWERS, *sorted(set().union(*counts) - set(ANSWERS))]
    return _table(
        ["rules", *known],
        [[rules, *(str(count[answer]) for answer in known)] for rules, count in zip(RULES, counts, strict=True)],
    )


def _claims(answers: dict[str, Given], before: dict[str, Given], is_wanted: Callable[[Given, Given], bool]) -> str:
    """Return the claims of which `is_wanted` says so of the answers now and before."""
    found = [
        (name, CLAIMS[name].text, ", ".join(given), ", ".join(before[name]))
        for name, given in answers.items()
        if is_wanted(given, before[name])
    ]
    return _table(["claim", "the paper", "confirmatory", "exploratory"], found) if found else "None."


def _has_turned(now: Given, before: Given) -> bool:
    """Say whether an answer was decided before, and is decided otherwise."""
    return any(new != old and new in DECIDED and old in DECIDED for new, old in zip(now, before, strict=True))


def _decided(answers: dict[str, Given], before: dict[str, Given]) -> Iterator[tuple[str, str]]:
    """Yield, for each of the rules, how many answers that runs decide are those of before, and claims with others."""
    for place, rules in enumerate(RULES):
        decided = [name for name, given in answers.items() if CLAIMS[name].statements and given[place] in DECIDED]
        new = [name for name in decided if before[name][place] != answers[name][place]]
        yield f"same_{rules}", f"{len(decided) - len(new)} of {len(decided)}"
        yield f"new_{rules}", ", ".join(new)


def _figures(file: Path, claim: str) -> str:
    """Return a claim about many figures as a table of their contrasts, in amounts and in shares."""
    columns = [(reading, rules) for reading in READINGS[:2] for rules in RULES]
    rows: dict[str, dict[tuple[str, str], str]] = {}
    for line in _lines(file):
        if line["claim"] == claim and line["lower"]:
            cell = f"{_percents(line)} {SIGNS[line['answer']]}"
            rows.setdefault(line["where"], {})[line["reading"], line["rules"]] = cell
    lines = [[where, *(cells[column] for column in columns)] for where, cells in rows.items()]
    return _table(["figure", *(f"{reading}: {rules}" for reading, rules in columns)], lines)


def _parted(readings: dict[str, dict[str, Given]]) -> str:
    """Return the claims of flexibility and robustness whose amounts and shares have other answers, with the bands."""
    found = [
        (name, *("/".join(SIGNS[readings[one][name][place]] for one in READINGS) for place in range(len(RULES))))
        for name in readings["shares"]
        if readings["shares"][name] != readings["amounts"][name]
    ]
    return _table(["claim", *RULES], found) if found else "None."
