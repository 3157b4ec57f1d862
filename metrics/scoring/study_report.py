"""The report on studies: what they say of the paper's claims, figures, numbers, settings, versions.

`report` gathers it once. It is a page (`html`), and text, Markdown, CSV and JSON like every answer, which have no
pictures.
"""

import math
import shlex
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import counted, install_command, number, percent
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.mixture import is_mixture, mixture_parts
from swarm_forage_env.policies.registry import file_of, is_policy_file
from swarm_forage_env.rendering.figures import FigureStyle
from swarm_forage_env.rendering.pages import build_report, picture_address, shown
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.runs.versions import VERSION_NAMES
from swarm_forage_env.studies.description import describe, status
from swarm_forage_env.studies.study import StudySpec
from swarm_forage_env.studies.study_file import is_set_of_paper

from ..claims import CLAIMS, INTUITIONS, Claim, Verdict
from .study_models import ModelFigure, model_figures
from .study_numbers import StudyPanels, place_distributions, policy_pairs
from .study_plots import Band, Draw, StudyFigure, caption, checked_band, drawn_by, snapshot_written, study_figures
from .study_verdict import (
    ANSWERS,
    WAITS,
    Judged,
    StudyVerdict,
    Waiting,
    claims_about,
    relative_answer,
    scored_studies,
    verdict_of,
    why_no_claims,
)
from .theory import theory_figures, theory_of

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.study_table import StudyTable

FORMS = {
    "paper": "The same, measured as printed in the paper",
    "sierra": "The same, measured as in the authors' program",
}
"""Variant of a measure -> the words above its picture."""
UNTITLED = FigureStyle(title=False)
"""Of the pictures in the page, which has their titles and captions as text."""
NO_REPORT = f"No report without matplotlib and Jinja2: {install_command('plots')}."
COST_HEADER = (
    "study",
    "budget",
    "finished runs",
    "planned runs",
    "robot-ticks planned",
    "simulated hours planned",
    "hours that runs took",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyReport(Answer):
    """Studies, their figures and the claims about them."""

    verdict: StudyVerdict
    """Of those studies that claims are about."""
    page: Mapping[str, Any]
    """What the page is filled with, see `rendering/report_page/report.html`."""

    def html(self) -> str:
        """Return the page, pictures included.

        Raises:
            ImportError: Jinja2 is not installed.
        """
        try:
            return build_report(self.page)
        except ImportError as error:
            raise ImportError(NO_REPORT) from error

    def write(self, file: str | Path) -> None:
        """Write it in the form that the ending of the file names, `.html` among them; errors as in `Answer.write`."""
        if Path(file).suffix != ".html":
            super().write(file)
            return
        text = self.html()
        with replacing(Path(file)) as draft:
            draft.write_text(text, encoding="utf-8")

    def sheets(self) -> Sequence[Sheet]:
        """Return the tables of the page, in its order."""
        return list(self._sheets())

    def to_mapping(self) -> dict[str, Any]:
        """Return the verdicts, the tables of all studies, and how to make their runs again."""
        tables = [
            {"title": sheet.title, "header": [*sheet.header], "rows": [[*row] for row in sheet.rows]}
            for sheet in self.sheets()
            if sheet.rows
        ]
        return {**self.verdict.to_mapping(), "tables": tables, "commands": self.page["commands"].splitlines()}

    def _sheets(self) -> Iterator[Sheet]:
        page = self.page
        for what, columns in (
            ("claims", [", ".join(one.values()) for one in page["columns"]]),
            ("intuitions", page["rules"]),
        ):
            rows = [
                (
                    row["name"],
                    row["text"],
                    *(cell["answer"] or cell["why"] for cell in row["cells"] for _ in range(cell["span"])),
                )
                for row in page[what]
            ]
            if rows:
                yield Sheet(title=what, header=("name", "text", *columns), rows=rows)
        for study in page["studies"]:
            yield Sheet(title=study["state"], notes=study["settings"].splitlines())
            for figure in study["figures"]:
                yield _sheet(figure["title"], figure["numbers"])
                yield _sheet(f"{figure['title']}: which policy is better how often", figure["pairs"])
            for model in study["models"]:
                yield _sheet(model["title"], model["facts"])
            yield _sheet(f"{study['name']}: runs of each condition", study["conditions"])
        for sketch in page["theory"]:
            yield _sheet(sketch["title"], sketch["numbers"])
        yield _sheet("what it took", {"header": COST_HEADER, "rows": page["cost"]})
        yield _sheet("versions", {"header": ("study", *page["version_names"]), "rows": page["versions"]})
        yield Sheet(title="make the runs again", notes=page["commands"].splitlines())


def _sheet(title: str, numbers: Mapping[str, Any]) -> Sheet:
    """A table of the page for people; without rows, nothing."""
    rows = [[shown(cell) for cell in row] for row in numbers["rows"]]
    return Sheet(title=title if rows else "", header=numbers["header"], rows=rows)


def report(*tables: "StudyTable", band: Band = "ci", tell: Callable[[str], None] | None = None) -> StudyReport:
    """Gather what studies say: of the paper's claims, where they are about them, in figures and in numbers.

    Args:
        tables: From `swarm_forage_env.read_study`.
        band: "ci", the 95 % interval of the mean; "sd", mean ± 2 standard deviations of runs.
        tell: Called with words about what is under way.

    Raises:
        ValueError: a study twice, or an unknown band.
        ImportError: matplotlib or Pillow is not installed.
    """
    checked_band(band)
    scored = scored_studies(tables, tell=tell)
    about = [pair for pair in zip(tables, scored, strict=True) if not why_no_claims(pair[0].spec)]
    sets, panels = [table for table, _ in about], [panels for _, panels in about]
    found = verdict_of(sets, panels) if about else StudyVerdict(tables=())
    try:
        return StudyReport(verdict=found, page=page_of(tables, scored, found, band, tell))
    except ImportError as error:
        raise ImportError(NO_REPORT) from error


def page_of(
    tables: "Sequence[StudyTable]",
    scored: Sequence[StudyPanels],
    found: StudyVerdict,
    band: Band,
    tell: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Return what the page is filled with; without verdicts it has no part about claims.

    Raises:
        ImportError: matplotlib is not installed.
    """
    of_claims, of_intuitions = (
        list(dict.fromkeys((one.rules, one.variant) for one in some if one.rules))
        for some in ((*found.judged, *found.waiting), (*found.expected, *found.expected_later))
    )
    names = version_names(tables)
    return {
        "title": f"Swarm foraging: {', '.join(table.spec.name for table in tables)}",
        "answers": (*ANSWERS, WAITS),
        "columns": [{"rules": rules, "variant": variant} for rules, variant in of_claims],
        "counts": [
            {"rules": rules, "variant": variant, "counts": list(found.counts(rules, variant).values())}
            for rules, variant in of_claims
        ],
        "claims": _claim_rows(CLAIMS, of_claims, found),
        "rules": list(dict.fromkeys(rules for rules, _ in of_intuitions)),
        "intuitions": _claim_rows(INTUITIONS, of_intuitions, found),
        "studies": [_study(table, panels, found, band, tell) for table, panels in zip(tables, scored, strict=True)],
        "theory": _theory(tables, found.judged),
        "cost": [_cost(table) for table in tables],
        "version_names": names,
        "versions": [
            [table.spec.name, *(made.get(name, "") for name in names)] for table in tables for made in table.versions
        ],
        "commands": "\n".join(command_of(table) for table in tables),
    }


def _claim_rows(
    claims: Mapping[str, Claim], columns: Sequence[tuple[str, str]], judged: StudyVerdict
) -> list[dict[str, Any]]:
    """Return one row per claim, with a cell per column, and what stands behind its answers."""
    if not columns:
        return []
    found, waits = judged.found, judged.later
    rows: list[dict[str, Any]] = []
    for name, claim in claims.items():
        cells: list[dict[str, Any]] = []
        behind: list[dict[str, Any]] = []
        of_formula = not claim.panels
        for column in [("", "corrected")] if of_formula else columns:
            span = len(columns) if of_formula else 1
            where = ("text alone" if claim.vague else "formula") if of_formula else ", ".join(column)
            verdict, later = found.get((name, *column)), waits.get((name, *column))
            if verdict is not None:
                answers = {"answer": verdict.answer, "by_bands": verdict.by_bands, "relative": relative_answer(verdict)}
                cells.append({**answers, "why": "", "span": span})
                for sense, found_so in {"": verdict, **verdict.otherwise}.items():
                    behind.append({"where": f"{where}: {sense}" if sense else where, **_numbers_of(found_so)})
            else:
                why = "no such form" if later is None else WAITS
                cells.append({"answer": "", "by_bands": "", "relative": "", "why": why, "span": span})
                if later is not None:
                    behind.append({"where": where, "answer": "", "words": f"waits for {lacking(later)}"})
        row = {"name": name, "text": claim.text, "where": claim.figure, "cells": cells, "behind": _each_once(behind)}
        rows.append({**row, "waits": not any(cell["answer"] for cell in cells)})
    return sorted(rows, key=lambda row: row["waits"])  # those that wait for runs of other sets come last


def _each_once(found: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what stands behind answers, each reason once with all the places where it holds."""
    places: dict[tuple[str, str], list[str]] = {}
    for one in found:
        places.setdefault((one["answer"], one["words"]), []).append(one["where"])
    return [{"answer": answer, "words": words, "where": "; ".join(of)} for (answer, words), of in places.items()]


def _numbers_of(verdict: Verdict) -> dict[str, str]:
    """Return what stands behind an answer, as texts."""
    numbers = [f"by bands {verdict.by_bands}", f"statistic {number(verdict.statistic)}"]
    numbers += [f"effect {percent(verdict.effect)}"] if math.isfinite(verdict.effect) else []
    numbers += [counted(verdict.n_runs, "run")] if verdict.n_runs else []
    return {"answer": verdict.answer, "words": f"{', '.join(numbers)}: {verdict.why}"}


def lacking(waits: Waiting) -> str:
    """Return what a claim waits for, in words, and why that is missing where its study is there."""
    names = ", ".join(name.words for name in waits.lacks)
    return f"{names} ({'; '.join(waits.reasons)})" if waits.reasons else names


def _study(
    table: "StudyTable",
    panels: StudyPanels,
    found: StudyVerdict,
    band: Band,
    tell: Callable[[str], None] | None,
) -> dict[str, Any]:

    others: dict[tuple[str, str], list[StudyFigure]] = {}
    figures: list[StudyFigure] = []
    for figure in study_figures(panels):
        first = figure.panels[0]
        if first.variant == "corrected":
            figures.append(figure)
        else:
            others.setdefault((first.rules, first.measure), []).append(figure)
    if tell is not None:
        tell(f"fitting models to {table.spec.name}")
    return {
        "snapshot": _snapshot(table),
        "name": table.spec.name,
        "anchor": f"study-{table.spec.study_id}",
        "title": table.spec.title,
        "state": status(table).headline,
        "figures": [
            _figure(figure, others.get((figure.panels[0].rules, figure.panels[0].measure), ()), found, band)
            for figure in figures
        ],
        "models": [_model(figure) for figure in model_figures(table)],
        "conditions": _numbers(place_distributions(table)),
        "missing": [
            f"{measure}: {why}" for (measure, variant), why in panels.missing.items() if variant == "corrected"
        ],
        "settings": str(describe(table.spec)),
    }


def _figure(
    figure: StudyFigure,
    others: Sequence[StudyFigure],
    found: StudyVerdict,
    band: Band,
) -> dict[str, Any]:
    """Return a figure, and below it those of the measure's other forms, if claims are judged by them."""

    def drawn(one: StudyFigure) -> list[dict[str, str]]:
        told = (("curves", caption(one, band)), ("heat maps", "means of runs"))
        draws = drawn_by(one, band).values()
        return [_picture(f"{one.title}, {kind}", draw, words) for (kind, words), draw in zip(told, draws, strict=False)]

    frame = figure.to_frame()
    claims = _claims_about(figure, (*found.judged, *found.waiting))
    return {
        "title": figure.title,
        "pictures": drawn(figure),
        "others": [{"words": FORMS[one.panels[0].variant], "pictures": drawn(one)} for one in others] if claims else [],
        "claims": claims,
        "numbers": _numbers(frame.select([name for name in frame.columns if not name.startswith("seed_")])),
        "pairs": _numbers(policy_pairs(figure.panels)),
    }


def _model(figure: ModelFigure) -> dict[str, Any]:

    return {
        "title": figure.title,
        "pictures": [_picture(f"{figure.title}, runs and models", figure.draw, figure.caption)],
        "facts": _numbers(figure.facts()),
    }


def _theory(tables: "Sequence[StudyTable]", judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """Return the figures that need no runs, all of them where claims are judged, with the claims about formulas."""
    figures = theory_figures() if judged else [figure for table in tables for figure in theory_of(table.spec)]
    formulas = [one for one in judged if not one.claim.panels and not one.claim.vague]
    return [
        {
            "title": figure.title,
            "pictures": [_picture(figure.title, figure.draw)],
            "claims": [
                {
                    "name": one.claim.name,
                    "text": one.claim.text,
                    "found": [{"where": "formula", "answer": one.verdict.answer, "words": ""}],
                }
                for one in formulas
                if figure.kind == "availability"
            ],
            "numbers": _numbers(figure.numbers),
        }
        for figure in {figure.title: figure for figure in figures}.values()
    ]


def _numbers(frame: "pl.DataFrame") -> dict[str, Any]:
    """Return a table as the page shows it; the heading already tells the rules where there is one of them."""
    if not len(frame):
        return {"header": [], "rows": []}
    is_one = "rules" in frame.columns and frame["rules"].n_unique() < 2
    shown = frame.drop("rules") if is_one else frame
    return {"header": [name.replace("_", " ") for name in shown.columns], "rows": shown.rows()}


def _snapshot(table: "StudyTable") -> dict[str, str]:

    with tempfile.TemporaryDirectory() as folder:
        file = snapshot_written(table.spec, Path(folder, "snapshot.png"))
        words = f"{table.spec.name}: the arena when a run begins"
        return {"address": picture_address(file.read_bytes(), "image/png"), "words": words}


def _picture(words: str, draw: Draw, told: str = "") -> dict[str, str]:
    """Return a picture as the page holds it, without the title that stands above it; only SVG is drawn."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "picture.svg")
        draw([file], UNTITLED)
        return {"address": picture_address(file.read_bytes()), "words": words, "caption": told}


def _claims_about(figure: StudyFigure, judged: Sequence[Judged | Waiting]) -> list[dict[str, Any]]:
    """Return the claims that use a panel of the figure, with what was found under its rules."""
    here = claims_about(figure.panels)
    rules = figure.panels[0].rules
    found: dict[str, dict[str, Any]] = {}
    for one in judged:
        if one.rules != rules or one.claim.name not in here:
            continue
        entry = found.setdefault(one.claim.name, {"name": one.claim.name, "text": one.claim.text, "found": []})
        if isinstance(one, Waiting):
            entry["found"].append({"answer": "", "words": WAITS, "where": one.variant})
            continue
        entry["found"].append({"answer": one.verdict.answer, "words": "", "where": one.variant})
        entry["found"] += [
            {"answer": other.answer, "words": "", "where": f"{one.variant}: {sense}"}
            for sense, other in one.verdict.otherwise.items()
        ]
    return [{**entry, "found": _each_once(entry["found"])} for entry in found.values()]


def _cost(table: "StudyTable") -> list[str | int | float]:
    """Return a row about what a study took."""
    spec = table.spec
    n_done = sum(state.n_runs[DONE] for state in table.place_states())
    hours = spec.n_runs * spec.horizon_s / 3600.0
    took = "not kept" if table.wall_time_s is None else table.wall_time_s / 3600.0
    return [spec.name, spec.budget, n_done, spec.n_runs, float(spec.robot_ticks), hours, took]


def command_of(table: "StudyTable") -> str:
    """Return the command that makes the runs of a study."""
    spec = table.spec
    rules, *others = spec.rules
    trusted = any(trust.runs_code(file_of(name)) for name in _policy_files(spec))
    words = ["swarm-forage", *([trust.TRUST_OPTION] if trusted else []), "study", "run"]
    words += [spec.name if is_set_of_paper(spec) else spec.file or "FILE"]
    words += ["--budget", spec.budget] if spec.budget else []
    if spec.looks:
        words += ["--seeds", str(spec.looks[-1])]
    elif spec.seeds == tuple(range(len(spec.seeds))):  # others than the first ones are chosen by the budget
        words += ["--seeds", str(len(spec.seeds))]
    words += ["--rules", "both" if others else rules]
    if spec.looks:
        words += ["--until-decided", "--hours", str(math.ceil((table.wall_time_s or 0.0) / 3600.0) or 1)]
    command = shlex.join(words)
    return command if is_set_of_paper(spec) else f"{command}  # study {spec.name}, identity {spec.study_id}"


def _policy_files(spec: StudySpec) -> list[str]:
    """Return the policies of a study that are files, those in mixed swarms, too."""
    found = [policy.policy for policy in spec.policies]
    parts = [part.policy for name in found if is_mixture(name) for part in mixture_parts(name)]
    return [name for name in (*found, *parts) if is_policy_file(name)]


def version_names(tables: "Sequence[StudyTable]") -> list[str]:
    """Return of what the versions are shown: our own first, then our code, then the commit, if there was one."""
    names = {name for table in tables for made in table.versions for name, version in made.items() if version}
    return sorted(names, key=lambda name: ((VERSION_NAMES[0], "code", "commit", name).index(name), name))
