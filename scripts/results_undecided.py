"""The part of docs/results.md on claims that stay undecided: after how many runs they would be decided, if ever."""

from collections.abc import Sequence
from typing import Any

from results_data import DATA, UNDECIDED, rows, undecided

from metrics.scoring import StudyVerdict
from swarm_forage_env._internal.wording import number


def undecided_claims(results: StudyVerdict) -> str:
    """Return after how many runs of each condition which claims would be decided, and what these runs take."""
    found = undecided(results)
    intro = "## What would decide the rest\n\n"
    if not found:
        return f"{intro}No forecast: no claim is undecided, or these sets are not run until claims are decided."
    last = found[0]["last_look"]
    looks = sorted({one["decided_after"] or last + 1 for one in found})
    lines = [
        (
            f"{look:,} runs" if look <= last else f"never by {last:,} runs like these",
            *(
                _named([one for one in found if one["rules"] == rules and (one["decided_after"] or last + 1) == look])
                for rules in results.rules
            ),
        )
        for look in looks
    ]
    return (
        f"{intro}If further runs are like those there are, each undecided claim is decided when every condition that "
        "it needs has so many runs. In parentheses stand the core-hours of the missing runs, in proportion to robots "
        f"times ticks. [A table]({DATA}/{UNDECIDED}) says of which sets and policies they are. After few runs the "
        "forecast is rough. `swarm-forage study run NAME ... --until-decided --dry-run` makes the same forecast from "
        "the folders of studies.\n\n"
        f"{rows(('decided after', *results.rules), lines)}"
    )


def _named(claims: Sequence[dict[str, Any]]) -> str:
    """Claims with the core-hours that they take, those that are read relative to performance marked."""
    return ", ".join(_words(one) for one in sorted(claims, key=lambda one: one["core_hours"] or 0.0)) or "-"


def _words(one: dict[str, Any]) -> str:
    name = f"{one['claim']} relative" if one["sense"] else one["claim"]
    hours = one["core_hours"]
    return name if hours is None or one["decided_after"] is None else f"{name} ({number(float(f'{hours:.2g}'))})"
