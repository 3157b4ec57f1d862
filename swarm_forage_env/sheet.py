"""Sheets: tables with a title above and notes below. Everything that is printed is one, and is printed here.

    print(answer)                   # as text
    answer.write("answer.md")       # as Markdown; .txt, .tex, .csv and .json likewise
    answer.draw("answer.png")       # as a picture, where there is one

A function that finds a table returns a `Sheet`. One that finds more returns an `Answer` of its own, which says what its
sheets are; all forms follow.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import polars as pl
import polars.selectors as cs

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import check_file, replacing
from swarm_forage_env._internal.wording import aligned, folded, number, plain_latex, plain_markdown
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle


class Answer(ABC):
    """What a question found."""

    @abstractmethod
    def sheets(self) -> "Sequence[Sheet]":
        """Return the tables, in their order."""

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON; numbers that do not exist are None."""
        tables = {sheet.title or "rows": sheet.frame for sheet in self.sheets() if len(sheet.frame)}
        is_number = pl.when(cs.float().is_finite()).then(cs.float())
        rows = {title: frame.with_columns(is_number).to_dicts() for title, frame in tables.items()}
        notes = [note for sheet in self.sheets() for note in sheet.notes]
        return {**rows, "notes": notes} if notes else rows

    @property
    def has_picture(self) -> bool:
        """Whether there is something to draw."""
        return False

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the answer into a picture file.

        Args:
            path: File to write; as in `rendering.figures.saved_figure`, whose errors this has.
            style: Of the figure.

        Raises:
            ValueError: there is nothing to draw.
        """
        raise ValueError(f"Expected an answer with a picture, got a {type(self).__name__} with nothing to draw.")

    def text(self, *, width: int | None = None) -> str:
        """Return everything for people; with a width, tables are wrapped to it where their words allow."""
        return "\n\n".join(filter(None, (sheet.as_text(width) for sheet in self.sheets())))

    def markdown(self) -> str:
        """Return everything as Markdown, with tables as on GitHub; names make no links."""
        return "\n\n".join(filter(None, (sheet.as_markdown() for sheet in self.sheets()))) + "\n"

    def latex(self) -> str:
        """Return the tables for LaTeX and its package booktabs; titles and notes are comments."""
        return "\n\n".join(filter(None, (sheet.as_latex() for sheet in self.sheets()))) + "\n"

    def csv(self) -> str:
        """Return the tables as CSV, an empty line between two of them."""
        return "\n".join(sheet.frame.write_csv() for sheet in self.sheets() if len(sheet.frame))

    def json(self) -> str:
        """Return `to_mapping` as a JSON document."""
        return json.dumps(self.to_mapping(), indent=1)

    def write(self, file: str | Path) -> None:
        """Write the answer in the form that the ending of the file names, whole or not at all.

        Raises:
            ConfigError: another ending than those of `FORMS`.
            OSError: the file cannot be written.
        """
        path = Path(file)
        check_form(path)
        with replacing(path) as draft:
            draft.write_text(FORMS[path.suffix](self), encoding="utf-8")

    def __str__(self) -> str:
        return self.text()


FORMS: dict[str, Callable[[Answer], str]] = {
    ".txt": lambda answer: f"{answer.text()}\n",
    ".md": lambda answer: answer.markdown(),
    ".tex": lambda answer: answer.latex(),
    ".csv": lambda answer: answer.csv(),
    ".json": lambda answer: f"{answer.json()}\n",
}
"""Ending of a file -> what stands in it."""


def check_form(file: Path) -> None:
    """Refuse a file whose ending is none of `FORMS`, or that cannot be written; ConfigError or OSError."""
    if file.suffix not in FORMS:
        raise ConfigError(f"Expected a file that ends with {', '.join(FORMS)}, got {file.name}.")
    check_file(file)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet(Answer):
    """One table; without rows it is a text."""

    title: str = ""
    frame: pl.DataFrame = field(default_factory=pl.DataFrame)
    """Columns with the names that people read; text cells stand as they are, numbers get about four digits."""
    notes: Sequence[str] = ()
    """Lines below the table."""
    below: "Sequence[Sheet]" = ()
    """Sheets that follow."""

    @classmethod
    def of(
        cls, header: Sequence[str], rows: Sequence[Sequence[Any]], title: str = "", notes: Sequence[str] = ()
    ) -> "Sheet":
        """Return a table of rows."""
        return cls(title=title, frame=pl.DataFrame(rows, schema=list(header), orient="row"), notes=notes)

    def sheets(self) -> "Sequence[Sheet]":
        """Return this one and those that follow."""
        return self, *self.below

    def as_text(self, width: int | None = None) -> str:
        """Return the table with its columns under each other; with a width, cells and notes of columns are wrapped."""
        table = aligned(self._cells(), width=width) if len(self.frame) else []
        notes = [line for note in self.notes for line in note.split("\n")]
        if width is not None:
            notes = [folded(line, width) for line in notes]
        return "\n".join([*([self.title] if self.title else []), *table, *notes])

    def as_markdown(self) -> str:
        """Return the table in the form of GitHub."""
        parts = [f"**{plain_markdown(self.title)}**"] if self.title else []
        if len(self.frame):
            header, *rows = self._cells()
            lines = [header, ["---"] * len(header), *rows]
            parts.append("\n".join(f"| {' | '.join(map(plain_markdown, line))} |" for line in lines))
        return "\n\n".join([*parts, *self.notes])

    def as_latex(self) -> str:
        """Return the table as a tabular."""
        about = [f"% {line}" for note in (self.title, *self.notes) for line in note.split("\n") if line]
        if not len(self.frame):
            return "\n".join(about)
        header, *rows = (f"{' & '.join(map(plain_latex, line))} \\\\" for line in self._cells())
        columns = "l" + "r" * (self.frame.width - 1)
        begin, end = f"\\begin{{tabular}}{{{columns}}}", "\\end{tabular}"
        return "\n".join([*about, begin, "\\toprule", header, "\\midrule", *rows, "\\bottomrule", end])

    def _cells(self) -> list[list[str]]:
        return [self.frame.columns, *([_cell(value) for value in row] for row in self.frame.iter_rows())]


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    return number(value) if isinstance(value, float) else str(value)
