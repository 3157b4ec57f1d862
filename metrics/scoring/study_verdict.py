"""What runs of the paper's sets say of its claims and of its intuitions: `verdict`, as tables."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.wording import number, percent
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.studies.study_file import is_set_of_paper

from ..checks import CurveError
from ..claims import INTUITIONS
from ..curves import Variant
from .figure_panels import StudyPanels, study_panels
from .verdicts import VARIANTS, Judged, Waiting, judge_claims, why_no_claims

if TYPE_CHECKING:
    from swarm_forage_env.studies.study_table import StudyTable

HEADER = ("claim", "text", "by intervals", "by bands", "statistic", "effect", "runs", "why")


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyVerdict(Answer):
    """Claims and intuitions that studies answer, and those that wait for runs."""

    tables: "tuple[StudyTable, ...]"
    judged: tuple[Judged, ...] = ()
    waiting: tuple[Waiting, ...] = ()
    expected: tuple[Judged, ...] = ()
    """Intuitions, by corrected measures only."""
    expected_later: tuple[Waiting, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know of the studies."""
        others = [table.spec.name for table in self.tables if not is_set_of_paper(table.spec)]
        return tuple(f"{name} has the name of one of the paper's sets and other settings" for name in others)

    def sheets(self) -> Sequence[Sheet]:
        """Return one table per rules and variant, the intuitions, and what waits for which runs."""
        groups: dict[tuple[str, str, str], list[Judged]] = {}
        for what, some in (("", self.judged), ("intuitions, ", self.expected)):
            for one in some:
                groups.setdefault((what, one.rules, one.variant), []).append(one)
        sheets: list[Sheet] = []
        for (what, rules, variant), some in groups.items():
            title = f"rules {rules}, measures {variant}" if rules else "from formulas alone"
            sheets.append(Sheet(title=f"{what}{title}", header=HEADER, rows=[_row(one) for one in some]))
        first, *others = waiting_lines((*self.waiting, *self.expected_later))
        return [*sheets, Sheet(title=first, notes=others)]

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values; numbers that do not exist are None."""
        return {
            "studies": [
                {
                    "name": table.spec.name,
                    "study_id": table.spec.study_id,
                    "budget": table.spec.budget,
                    "n_seeds": len(table.spec.seeds),
                    "versions": [dict(versions) for versions in table.versions],
                }
                for table in self.tables
            ],
            "verdicts": [one.to_mapping() for one in self.judged],
            "waiting": [one.to_mapping() for one in self.waiting],
            "intuitions": [one.to_mapping() for one in self.expected],
            "intuitions_waiting": [one.to_mapping() for one in self.expected_later],
        }


def verdict(*tables: "StudyTable", tell: Callable[[str], None] | None = None) -> StudyVerdict:
    """Hold the claims of the paper, and its intuitions, against runs of its sets.

    Args:
        tables: From `swarm_forage_env.read_study`.
        tell: Called with words about what is under way: with many runs it takes minutes.

    Raises:
        CurveError: a study twice, one without the policies of the paper, or none of its sets.
    """
    refused = [why for table in tables if (why := why_no_claims(table))]
    if refused:
        raise CurveError(f"{refused[0]} 'swarm-forage study plot' and 'report' take any study.")
    return verdict_of(tables, scored_studies(tables, tell=tell))


def verdict_of(tables: "Sequence[StudyTable]", scored: Sequence[StudyPanels]) -> StudyVerdict:
    """Return the same of studies that are scored already; errors are those of `judge_claims`."""
    judged, waiting = judge_claims(tables, scored)
    expected, expected_later = judge_claims(tables, scored, ("corrected",), INTUITIONS)
    return StudyVerdict(
        tables=tuple(tables), judged=judged, waiting=waiting, expected=expected, expected_later=expected_later
    )


def scored_studies(
    tables: "Sequence[StudyTable]",
    variants: Sequence[Variant] = VARIANTS,
    *,
    tell: Callable[[str], None] | None = None,
) -> list[StudyPanels]:
    """Score studies, and tell which one is under way."""
    scored: list[StudyPanels] = []
    for table in tables:
        if tell is not None:
            tell(f"scoring {table.spec.name}")
        scored.append(study_panels(table, variants))
    return scored


def waiting_lines(waiting: Sequence[Waiting]) -> list[str]:
    """Return which claims wait for what, those that wait for the same in one line."""
    claims: dict[str, dict[str, None]] = {}
    for one in waiting:
        words = f"for {', '.join(dict.fromkeys(name.experiment for name in one.lacks))}"
        if one.reasons:
            words += f" ({one.rules}, {one.variant}: {'; '.join(one.reasons)})"
        claims.setdefault(words, {})[one.claim.name] = None
    if not claims:
        return ["No claim waits for runs."]
    return [
        "These claims and intuitions (H) wait:",
        *(f"  {', '.join(names)}: {words}" for words, names in claims.items()),
    ]


def _row(one: Judged) -> tuple[str, ...]:
    found = one.verdict
    numbers = (number(found.statistic), percent(found.effect), str(found.n_runs))
    return (one.claim.name, one.claim.text, found.answer, found.by_bands, *numbers, found.why)
