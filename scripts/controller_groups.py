"""Which controllers group together in flexibility and robustness, by raw values and relative to performance.

    swarm-forage compare --policy crw,dpo,stochm,stochx --scenario warehouse_small --json > small.json
    python scripts/controller_groups.py small.json

Prints Markdown for each file: the order of the controllers at every level of every measure that has a relative form,
whether one of the paper's two groups comes before the other, and how often. The paper finds {crw, stochx} beside {dpo,
stochm}; --groups names others.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

Score: TypeAlias = Mapping[str, Any]
"""A score in the JSON document of `swarm-forage compare`."""
Groups: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]

PAPER: Groups = (("crw", "stochx"), ("dpo", "stochm"))
MEASURES = (
    "reactivity",
    "adaptability",
    "noise_robustness",
    "population_robustness",
    "recorded_population_robustness",
)
MIXED = "mixed"
WORDS = (
    "Best first. ° = at or below the noise floor, where a distance says nothing. In brackets: how many of the pairs of "
    "one controller of each group differ significantly, in this direction (for mixed orders: in any)."
)


def markdown(document: Mapping[str, Any], groups: Groups = PAPER) -> str:
    """Return the two tables of one comparison.

    Args:
        document: What `swarm-forage compare --json` printed.
        groups: Names of the policies of both groups.

    Raises:
        ValueError: A policy of the groups is not in the document, or no measure has all of them.
    """
    tables = {table["policy"]: table for table in document["tables"]}
    members = [*groups[0], *groups[1]]
    absent = [name for name in members if name not in tables]
    if absent:
        raise ValueError(f"Expected scores of {', '.join(members)}, got none of {', '.join(absent)}; compare them all.")
    found = {name: {_key(score): score for score in tables[name]["scores"]} for name in members}
    rows = [key for key in found[members[0]] if key[0] in MEASURES and all(key in found[name] for name in members)]
    lines, counts = [], Counter[tuple[str, bool, str]]()
    for key in rows:
        cells = [key[0], key[1]]
        for is_relative in (False, True):
            scores = {name: found[name][key] for name in members}
            order = _ranked(scores, is_relative)
            verdict = _verdict(order, groups)
            counts[key[0], is_relative, verdict] += bool(order)
            significant = _significant(document["differences"], key, groups, verdict, is_relative)
            pairs = len(groups[0]) * len(groups[1])
            cells += [
                ", ".join(text for _, text, _ in order),
                f"{verdict} ({significant} of {pairs})" if order else "-",
            ]
        lines.append(cells)
    if not lines:
        raise ValueError(f"Expected scores of {', '.join(MEASURES)}, got none that all of {', '.join(members)} have.")
    header = ["measure", "at", "raw", "order", "relative", "order"]
    return "\n".join([*_table([header, *lines]), "", WORDS, "", *_table(_summary(counts, groups))])


def _key(score: Score) -> tuple[str, str, tuple[int, ...]]:
    return score["label"], score["at"], tuple(score["n_robots"])


def _ranked(scores: Mapping[str, Score], is_relative: bool) -> list[tuple[str, str, float]]:
    """Return names with their texts and values, the best first; empty if a value does not exist."""
    values: dict[str, float] = {}
    for name, score in scores.items():
        value = (score["relative"] or [None])[0] if is_relative else score["value"]
        if value is None:
            return []
        values[name] = value
    higher_is_better = next(iter(scores.values()))["higher_is_better"]
    ordered = sorted(values, key=lambda name: values[name], reverse=higher_is_better)
    return [(name, f"{name} {_number(values[name], scores[name], is_relative)}", values[name]) for name in ordered]


def _number(value: float, score: Score, is_relative: bool) -> str:
    floor = score["relative_floor" if is_relative else "noise_floor"]
    text = f"{100.0 * value:.3g} %" if is_relative else f"{value:.3g}"
    return text + ("°" if floor is not None and value <= floor else "")


def _verdict(order: Sequence[tuple[str, str, float]], groups: Groups) -> str:
    """Return which group comes wholly before the other; equal values of two groups are no order."""
    for group in groups:
        first, rest = order[: len(group)], order[len(group) :]
        if {name for name, _, _ in first} == set(group) and first[-1][2] != rest[0][2]:
            return _name(group)
    return MIXED


def _name(group: Sequence[str]) -> str:
    return f"{' + '.join(group)} first"


def _significant(
    differences: Sequence[Mapping[str, Any]],
    key: tuple[str, str, tuple[int, ...]],
    groups: Groups,
    verdict: str,
    is_relative: bool,
) -> int:
    """Return how many pairs of one policy of each group differ significantly, in the direction of the verdict."""
    wanted = {_name(groups[0]): groups[0], _name(groups[1]): groups[1]}.get(verdict, (*groups[0], *groups[1]))
    across = [
        difference
        for difference in differences
        if _key(difference) == key
        and difference["relative"] == is_relative
        and any({difference["first"], difference["second"]} == {a, b} for a in groups[0] for b in groups[1])
    ]
    return sum(difference["better"] in wanted for difference in across)


def _summary(counts: Counter[tuple[str, bool, str]], groups: Groups) -> list[list[str]]:
    verdicts = (_name(groups[0]), _name(groups[1]), MIXED)
    rows = [["measure", *(f"{form}: {verdict}" for form in ("raw", "relative") for verdict in verdicts)]]
    measures = list(dict.fromkeys(measure for measure, _, _ in counts))
    for measure in (*measures, "all"):
        summed = measures if measure == "all" else [measure]
        numbers = [
            sum(counts[name, is_relative, verdict] for name in summed)
            for is_relative in (False, True)
            for verdict in verdicts
        ]
        rows.append([measure, *map(str, numbers)])
    return rows


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return [lines[0], "|" + "---|" * len(rows[0]), *lines[1:]]


def main(words: Sequence[str] | None = None) -> int:
    """Print the tables of all files; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="what 'swarm-forage compare --json' printed"
    )
    parser.add_argument("--groups", default="crw,stochx/dpo,stochm", help="two groups of policies, A,B/C,D")
    arguments = parser.parse_args(words)
    first, _, second = arguments.groups.partition("/")
    if not first or not second:
        parser.error(f"Expected two groups as A,B/C,D, got {arguments.groups!r}.")
    groups = (tuple(first.split(",")), tuple(second.split(",")))
    try:
        documents = [json.loads(file.read_text(encoding="utf-8")) for file in arguments.files]
        texts = [f"**{document['tables'][0]['scenario']}**\n\n{markdown(document, groups)}" for document in documents]
    except (OSError, KeyError, ValueError) as error:
        parser.error(str(error))
    print("\n\n".join(texts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
