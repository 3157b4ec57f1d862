"""Say what a report on studies of swarm sizes lacks: figures of the paper's measures, claims, answers.

    python scripts/check_report.py report.html S1a "S2a still" "S2a fast"

The names are the experiments that were run. Every claim and intuition must be listed, and those about these experiments
alone must have an answer, with its numbers, under both rules. Exit code 1 if something is missing.
"""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from metrics.claims import CLAIMS, INTUITIONS
from metrics.scoring.scores import MEASURE_CRITERIA
from metrics.scoring.study_numbers import FIGURE_MEASURES
from swarm_forage_env.studies.study import RULES_NAMES

TABLES = {"verdicts": CLAIMS, "intuitions": INTUITIONS}
"""Table of the page -> what it lists."""

ANSWERED = r'<b>(?:[^<]*; )?{}, corrected(?:;[^<]*)?</b> <span class="answer [\w ]+">.*statistic'
"""What a row of such a table has for the rules."""


def missing_in(page: str, experiments: Sequence[str]) -> list[str]:
    """Return what is missing in a report on studies whose last axis is the swarm size, in words."""
    drawn = re.findall(r'<img src="data:image/svg\+xml;base64,[^"]+" alt="([^"]+), curves">', page)
    measures = [name for name in FIGURE_MEASURES if MEASURE_CRITERIA[name] == "population_size"]
    studies = dict.fromkeys(name.split()[0] for name in experiments)
    missing = [
        f"figure {study}: {measure.replace('_', ' ')}, rules {rules}"
        for study in studies
        for measure in measures
        for rules in RULES_NAMES
        if not any(
            words.startswith(f"{study}: {measure.replace('_', ' ')} (") and words.endswith(f"rules {rules}")
            for words in drawn
        )
    ]
    for table, claims in TABLES.items():
        rows = _rows(page, table)
        for name, claim in claims.items():
            if name not in rows:
                missing.append(f"claim {name}")
            elif {panel[0] for panel in claim.panels} <= {*experiments}:
                missing += [
                    f"the answer to {name}, rules {rules}"
                    for rules in (RULES_NAMES if claim.panels else ())
                    if not re.search(ANSWERED.format(rules), rows[name])
                ]
    return missing


def _rows(page: str, table: str) -> dict[str, str]:
    """Return claim -> its part of a table, or of that of the claims that wait."""
    text = "".join(re.findall(rf'<table[^>]* id="{table}(?:-waiting)?">(.*?)</table>', page, re.DOTALL))
    return {name: part for part in text.split("<tbody>")[1:] for name in re.findall(r'class="name"[^>]*>(\w+)<', part)}


def main() -> int:
    """Check the report that the command line names; returns the exit code."""
    page, *experiments = sys.argv[1:]
    missing = missing_in(Path(page).read_text(encoding="utf-8"), experiments)
    for words in missing:
        print(f"{page}: {words} is missing")
    if not missing:
        print(f"{page}: has every figure and every answer of {', '.join(experiments)}, and every claim and intuition")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
