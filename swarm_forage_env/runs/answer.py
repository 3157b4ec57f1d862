"""Answer: what a question found, as tables with titles and notes. One place prints it, in every form.

    print(answer)                   # as text
    answer.write("answer.md")       # as Markdown; .txt, .csv and .json likewise
    answer.to_mapping()             # as plain values
    answer.draw("answer.png")       # as a picture, where there is one

A new answer says what its tables are (`sheets`) and what its numbers are (`to_mapping`); the forms follow.
"""

import csv
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import aligned, folded, plain_markdown
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle


@dataclass(frozen=True, kw_only=True, slots=True)
class Sheet:
    """A table for people. Without rows it is a text: title and notes alone."""

    title: str = ""
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()
    """Lines below the table."""

    def text(self, *, width: int | None = None) -> str:
        """Return the table with its columns under each other; with a width, cells and notes of columns are wrapped."""
        rows = [self.header, *self.rows] if self.header else self.rows
        table = aligned(rows, width=width) if self.rows else []
        notes = [line for note in self.notes for line in note.split("\n")]
        if width is not None:
            notes = [folded(line, width) for line in notes]
        return "\n".join([*([self.title] if self.title else []), *table, *notes])

    def markdown(self) -> str:
        """Return the table in the form of GitHub; names in title and cells make no links."""
        parts = [f"**{plain_markdown(self.title)}**"] if self.title else []
        if self.rows:
            header = self.header or [""] * len(self.rows[0])
            lines = [header, ["---"] * len(header), *self.rows]
            parts.append("\n".join(f"| {' | '.join(map(plain_markdown, row))} |" for row in lines))
        return "\n\n".join([*parts, *self.notes])

    def csv(self) -> str:
        """Return header and rows as CSV."""
        out = StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerows([self.header, *self.rows] if self.header else self.rows)
        return out.getvalue()


class Answer(ABC):
    """What a question found."""

    @abstractmethod
    def sheets(self) -> Sequence[Sheet]:
        """Return the tables, in their order."""

    @abstractmethod
    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON; numbers that do not exist are None."""

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
        return "\n\n".join(filter(None, (sheet.text(width=width) for sheet in self.sheets())))

    def markdown(self) -> str:
        """Return everything as Markdown."""
        return "\n\n".join(filter(None, (sheet.markdown() for sheet in self.sheets()))) + "\n"

    def csv(self) -> str:
        """Return the tables as CSV, an empty line between two of them."""
        return "\n".join(sheet.csv() for sheet in self.sheets() if sheet.rows)

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
        if path.suffix not in FORMS:
            raise ConfigError(f"Expected a file that ends with {', '.join(FORMS)}, got {path.name}.")
        with replacing(path) as draft:
            draft.write_text(FORMS[path.suffix](self), encoding="utf-8")

    def __str__(self) -> str:
        return self.text()


FORMS: dict[str, Callable[[Answer], str]] = {
    ".txt": lambda answer: f"{answer.text()}\n",
    ".md": lambda answer: answer.markdown(),
    ".csv": lambda answer: answer.csv(),
    ".json": lambda answer: f"{answer.json()}\n",
}
"""Ending of a file -> what stands in it."""
