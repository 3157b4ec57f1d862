"""Texts for people: numbers, tables and values from elsewhere, the name nearest to a mistyped one, how to install."""

import difflib
import math
import re
import textwrap
import unicodedata
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import Any

_MOST_SHOWN = 200
"""Characters of a value that a message shows; our choice: two lines of a terminal."""
_UNSEEN = ("Cc", "Cf", "Cs")
"""Unicode categories of characters that steer a terminal, that nobody sees, or that no encoding has."""
_NOTHING = "<!-- -->"
"""Nothing, in Markdown."""
_MOST_NEAR = 4
"""Names that a message lists where there are too many to list all."""
_NEAR = 0.5
"""Likeness of such names; less than is asked of one that is meant (our choice)."""
_MOST_INDENTED = 0.6
"""Share of the width that is left empty before a continued line at most (our choice)."""
_BESIDE = {"train": ' "torch==2.13.0"'}
"""What an extra is installed together with."""


def aligned(rows: Sequence[Sequence[str]], *, width: int | None = None) -> list[str]:
    """Return rows of texts as lines with columns under each other.

    Args:
        rows: Cells of each row.
        width: Most characters of a line: cells of the widest columns are wrapped, but no word is broken, so that many
            columns can still be wider. None = one line per row.
    """
    columns = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    if width is not None:
        widths = _narrowed(widths, [max(map(_longest_word, column)) for column in columns], width)
        rows = [line for row in rows for line in _wrapped(row, widths)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _narrowed(widths: list[int], least: list[int], width: int) -> list[int]:
    """Take characters from the widest columns until all fit, or no column can give any."""
    found = list(widths)
    while sum(found) + 2 * (len(found) - 1) > width:
        can_give = [column for column, most in enumerate(found) if most > least[column]]
        if not can_give:
            break
        found[max(can_give, key=found.__getitem__)] -= 1
    return found


def _longest_word(cell: str) -> int:
    return max(map(len, cell.split()), default=0)


def _wrapped(row: Sequence[str], widths: Sequence[int]) -> list[tuple[str, ...]]:
    """Return the lines of one row."""
    return list(zip_longest(*map(_folded_cell, row, widths), fillvalue=""))


def _folded_cell(cell: str, width: int) -> list[str]:
    return textwrap.wrap(cell, max(width, 1), break_long_words=False, break_on_hyphens=False) or [""]


def folded(line: str, width: int) -> str:
    """Return a line of columns in lines of at most a width, the further ones below the last column; no word is broken.

    Columns have two or more spaces between them. A line without columns stays whole, because it may be a command, which
    people copy.
    """
    columns = [gap.end() for gap in re.finditer(r"(?<=\S)  +", line) if gap.end() <= _MOST_INDENTED * width]
    if len(line) <= width or not columns:
        return line
    return textwrap.fill(
        line, width, subsequent_indent=" " * columns[-1], break_long_words=False, break_on_hyphens=False
    )


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, "1 run" or "2,000 runs"."""
    return f"{count:,} {noun}" + ("" if count == 1 else "s")


def number(value: float) -> str:
    """Return a number with about four digits; a dash where there is none."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def percent(value: float) -> str:
    """Return a share in percent; a dash where there is none."""
    return "-" if not math.isfinite(value) else f"{100.0 * value:.3g} %"


def limits(lower: float, upper: float) -> str:
    """Return two bounds; a dash where there are none."""
    return "-" if math.isnan(lower) else f"{number(lower)} to {number(upper)}"


def plain(value: float | None) -> float | None:
    """Return the value, or None where JSON has no such number."""
    return value if value is not None and math.isfinite(value) else None


def printable(text: str) -> str:
    """Return a text with control characters, escape sequences among them, written as backslash escapes.

    Ends of lines stay, so that a text of several lines remains one.
    """
    return "".join(_escaped(character) for character in text)


def plain_markdown(text: str) -> str:
    """Return a text for a page in Markdown, in one line; it makes no link, picture, HTML or end of a cell.

    Emphasis and code stay. An empty comment in an address keeps GitHub from making a link of it.
    """
    words = " ".join(text.split()).replace("\\", r"\\")
    words = re.sub(r"[\[\]|]", r"\\\g<0>", words).replace("<", "&lt;")
    return re.sub(r"://|(?<=www)\.|@", rf"{_NOTHING}\g<0>", words, flags=re.IGNORECASE)


def plain_latex(text: str) -> str:
    """Return a text for LaTeX, in one line, without commands."""
    return " ".join(text.split()).translate(_LATEX)


_LATEX = str.maketrans(
    {
        **{sign: f"\\{sign}" for sign in "&%$#_{}"},
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "±": r"$\pm$",
        "²": "$^2$",
        "<": "$<$",
        ">": "$>$",
    }
)


def shown(value: Any) -> str:
    """Return the representation of a value for a message, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits; tables nested too deep
        return f"a value of type {type(value).__name__} that is too large to show"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}... ({len(text):,} characters)"


def _escaped(character: str) -> str:
    if character == "\n" or unicodedata.category(character) not in _UNSEEN:
        return character
    return character.encode("unicode_escape").decode("ascii")


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return the few known names that are most like a mistyped one, the nearest first."""
    return difflib.get_close_matches(name, list(known), n=_MOST_NEAR, cutoff=_NEAR)


def suggestion(name: str, known: Iterable[str], *, prefix: str = "") -> str:
    """Return " Did you mean ...?" with the nearest known name, or an empty string; case does not matter."""
    spelt = {each.lower(): each for each in known}
    longer = [each for each in spelt if name and each.startswith(name.lower())]
    close = difflib.get_close_matches(name.lower(), spelt, n=1) or longer
    return f" Did you mean {prefix + spelt[close[0]]!r}?" if close else ""


def install_command(extra: str) -> str:
    """Return the command that installs one of the extras of `pyproject.toml`, for messages.

    The package is in no registry: it is installed from a checkout.
    """
    return f'pip install ".[{extra}]"{_BESIDE.get(extra, "")} in the checkout of swarm_forage_env'
