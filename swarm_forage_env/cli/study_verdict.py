"""The command `study verdict`: the paper's claims and intuitions held against studies."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from metrics.curves import Variant
    from metrics.scoring.figure_panels import StudyPanels
    from metrics.scoring.verdicts import Judged, Waiting
    from swarm_forage_env.studies.study_table import StudyTable

Places = Annotated[list[Path], typer.Argument(metavar="DIR|FILE...", help="Folders of studies, or their packed files.")]


def verdict(
    places: Places,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write all of it as JSON.")] = None,
) -> None:
    """Hold the claims of the paper against runs of its sets: what they support, contradict or leave open.

    Below them the same for its intuitions, what it expected of each algorithm before the experiments.
    """
    from metrics.claims import INTUITIONS
    from metrics.scoring.verdicts import VARIANTS, judge_claims, why_no_claims
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file, replacing
    from swarm_forage_env.cli.terminal import notes, output
    from swarm_forage_env.studies.study_file import is_set_of_paper
    from swarm_forage_env.studies.study_table import read_study

    tables = [read_study(place) for place in places]
    refused = next(filter(None, map(why_no_claims, tables)), "")
    if refused:
        raise ConfigError(f"{refused} 'swarm-forage study plot' and 'report' take any study.")
    if json_file is not None:
        check_file(json_file)
    try:
        scored = scored_studies(tables, VARIANTS)
        judged, waiting = judge_claims(tables, scored)
        expected, expected_later = judge_claims(tables, scored, ("corrected",), INTUITIONS)
    except ValueError as error:  # a study twice
        raise ConfigError(str(error)) from error
    for table in tables:
        if not is_set_of_paper(table.spec):
            words = f"note: {table.spec.name} has the name of one of the paper's sets and other settings"
            notes().print(words)
    console = output()
    for key in dict.fromkeys((one.rules, one.variant) for one in judged):
        console.print(_table([one for one in judged if (one.rules, one.variant) == key]))
    for rules in dict.fromkeys(one.rules for one in expected):
        console.print(_table([one for one in expected if one.rules == rules], "intuitions"))
    typer.echo("\n".join(waiting_lines((*waiting, *expected_later))))
    if json_file is not None:
        text = verdict_json(tables, judged, waiting, expected, expected_later) + "\n"
        with replacing(json_file) as draft:
            draft.write_text(text, encoding="utf-8")
        notes().print(f"written {json_file}")


def scored_studies(tables: "Sequence[StudyTable]", variants: "Sequence[Variant]") -> "list[StudyPanels]":
    """Score studies, and tell which one is under way: with many runs it takes minutes."""
    from metrics.scoring.figure_panels import study_panels
    from swarm_forage_env.cli.terminal import notes

    scored: list[StudyPanels] = []
    for table in tables:
        notes().print(f"scoring {table.spec.name}")
        scored.append(study_panels(table, variants))
    return scored


def verdict_json(
    tables: "Sequence[StudyTable]",
    judged: "Sequence[Judged]",
    waiting: "Sequence[Waiting]",
    expected: "Sequence[Judged]",
    expected_later: "Sequence[Waiting]",
) -> str:
    """Return claims, and what was expected, as a JSON document; numbers that do not exist are null."""
    studies = [
        {
            "name": table.spec.name,
            "study_id": table.spec.study_id,
            "budget": table.spec.budget,
            "n_seeds": len(table.spec.seeds),
            "versions": [dict(versions) for versions in table.versions],
        }
        for table in tables
    ]
    document = {
        "studies": studies,
        "verdicts": [one.to_mapping() for one in judged],
        "waiting": [one.to_mapping() for one in waiting],
        "intuitions": [one.to_mapping() for one in expected],
        "intuitions_waiting": [one.to_mapping() for one in expected_later],
    }
    return json.dumps(document, indent=1)


def waiting_lines(waiting: "Sequence[Waiting]") -> list[str]:
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


def _table(judged: "Sequence[Judged]", what: str = "") -> "Table":
    from rich.table import Table

    from swarm_forage_env._internal.wording import number, percent

    first = judged[0]
    title = f"rules {first.rules}, measures {first.variant}" if first.rules else "from formulas alone"
    table = Table(title=f"{what}, {title}" if what else title, title_justify="left")
    for name in ("claim", "text", "by intervals", "by bands"):
        table.add_column(name)
    for name in ("statistic", "effect", "runs"):
        table.add_column(name, justify="right")
    table.add_column("why")
    for one in judged:
        verdict = one.verdict
        table.add_row(
            one.claim.name,
            one.claim.text,
            verdict.answer,
            verdict.by_bands,
            number(verdict.statistic),
            percent(verdict.effect),
            str(verdict.n_runs),
            verdict.why,
        )
    return table
