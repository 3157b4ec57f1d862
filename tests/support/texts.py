"""What a command says, without what differs from one day or machine to the next; numbers of results stay."""

import html
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

VARIES = "<varies>"
_VARYING_FIELDS = {
    "commit", "cpu_time_s", "created", "digest", "simulated_s_per_wall_s",
    "traceback", "versions", "wall_time_s",
}  # fmt: skip
"""Fields of JSON documents; the digest of an entry is also of its versions and hours."""
_PROGRESS = re.compile(r"\d+/\d+ runs, .*|\d+ of \d+ runs stored already.*|swarm-forage: Compiling what is used .*")
"""Lines that depend on what is stored and compiled already."""
_REPLACED: tuple[tuple[str, str], ...] = (
    (r"\d{4}-\d\d-\d\dT[\d:.+Z-]+", "<date>"),
    (r"\b[0-9a-f]{40}\b", "<commit>"),
    (r"(?<=made with      ).*", "<versions>"),
    (r"(?<=\nVersions\n)study \|.*\n(.*\|\n)+", "<versions>\n"),
)
_SPEED = re.compile(r"(\d\.\d{3} +)[\d,]+$", re.MULTILINE)
"""In the last column of a table of runs."""
_DIGITS = 6
"""Digits of a number in JSON and CSV: the last ones of a fit differ between processors."""


def steady_text(text: str, folder: Path) -> str:
    """Return what is printed without progress, times, versions, and the name of the folder."""
    text = text.replace(str(folder), "<folder>")
    for pattern, placeholder in _REPLACED:
        text = re.sub(pattern, placeholder, text)
    if "per wall s" in text:
        text = _SPEED.sub(r"\1<speed>", text)
    lines = [line.rstrip() for line in text.splitlines() if not _PROGRESS.fullmatch(line)]
    return "\n".join(lines)


def steady_json(value: Any, folder: Path) -> Any:
    """Return a JSON document with the same fields in the same order, see `steady_text`."""
    if isinstance(value, dict):
        return {
            name: VARIES if name in _VARYING_FIELDS and item not in (None, "") else steady_json(item, folder)
            for name, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [steady_json(item, folder) for item in value]
    if isinstance(value, str):
        return steady_text(value, folder)
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def steady_file(file: Path, folder: Path) -> str:
    """Return what a file says: JSON and CSV with fewer digits, of a page its words."""
    text = file.read_text(encoding="utf-8")
    return _READ_AS.get(file.suffix, steady_text)(text, folder)


def json_lines(value: Any) -> str:
    """Return a document as text that a diff can show, one value a line."""
    return json.dumps(value, indent=1, ensure_ascii=False)


def _steady_json_file(text: str, folder: Path) -> str:
    return json_lines(steady_json(json.loads(text), folder))


def _steady_csv(text: str, folder: Path) -> str:
    numbers = r"(?<![\w.])-?\d+\.\d+(e[+-]?\d+)?"
    return steady_text(re.sub(numbers, lambda number: f"{float(number[0]):.{_DIGITS}g}", text), folder)


def _steady_page(text: str, folder: Path) -> str:
    for element in ("script", "style", "svg"):
        text = re.sub(rf"<{element}\b.*?</{element}>", "", text, flags=re.DOTALL)
    text = re.sub(r"</(td|th)>", " | ", text)
    lines = [re.sub(r"\s+", " ", html.unescape(line)).strip() for line in re.sub(r"<[^>]*>", "", text).splitlines()]
    return steady_text("\n".join(line for line in lines if line), folder)


_READ_AS: dict[str, Callable[[str, Path], str]] = {
    ".json": _steady_json_file,
    ".csv": _steady_csv,
    ".html": _steady_page,
}
"""How a file is read, by its ending; others as text."""
