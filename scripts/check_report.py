"""Say what a report on studies of swarm sizes lacks: figures of the paper's measures, claims, intuitions.

    python scripts/check_report.py report.html S1a S2a

Exit code 1 if something is missing.
"""

import re
import sys
from pathlib import Path

from metrics.claims import CLAIMS, INTUITIONS
from metrics.scoring.figure_panels import FIGURE_MEASURES
from metrics.scoring.measures import MEASURE_CRITERIA


def missing_in(page: str, studies: list[str]) -> list[str]:
    """Return what is missing in a report on studies whose last axis is the swarm size, in words."""
    drawn = re.findall(r'<img src="data:image/svg\+xml;base64,[^"]+" alt="([^"]+), curves">', page)
    measures = [name for name in FIGURE_MEASURES if MEASURE_CRITERIA[name] == "population_size"]
    headings = [f"{study}: {measure.replace('_', ' ')} (" for study in studies for measure in measures]
    figures = [
        f"figure {heading[:-2]}" for heading in headings if not any(words.startswith(heading) for words in drawn)
    ]
    words = re.sub(r'base64,[^"]+', "", page)  # pictures as text may have any two letters in them
    claims = [f"claim {name}" for name in (*CLAIMS, *INTUITIONS) if not re.search(rf"\b{name}\b", words)]
    return [*figures, *claims]


def main() -> int:
    """Check the report that the command line names; returns the exit code."""
    page, *studies = sys.argv[1:]
    missing = missing_in(Path(page).read_text(encoding="utf-8"), studies)
    for words in missing:
        print(f"{page}: {words} is missing")
    if not missing:
        print(f"{page}: has every figure of {', '.join(studies)}, claim and intuition")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
