"""What commands print, word by word, for tiny runs.

A file in `tests/cli/texts` for each case. After a change that is meant to change words or numbers:

    REMAKE_TEXTS=1 python -m pytest tests/cli/test_texts.py

makes them anew; `git diff` then shows what has changed. Where only the words of a command change, change them in
`CASES`: the files stay.
"""

import difflib
import html
import io
import json
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from metrics.benchmark import load_protocol
from tests.support.console import answer
from tests.support.entries import TINY, made_up_entry, write_package
from tests.support.golden_runs import AS_THEN
from tests.support.pictures import keep_figures

pytestmark = [*AS_THEN]

TEXTS = Path(__file__).with_name("texts")
REMAKE = bool(os.environ.get("REMAKE_TEXTS"))

# A room so small that robots deliver in minutes.
SMALL = (
    "--set physics=compiled --set n_objects=60 --set width_m=12 --set height_m=8 --set nest_centre_m=1.6,4 "
    "--set nest_size_m=1.6,6.4"
)
ROOM = f"--robots 6 {SMALL} --jobs 1"
SECONDS = "--horizon 400 --set interval_s=100"
RUN = f"run crw,dpo --seeds 2 {ROOM} {SECONDS}"
CURVES = "score --curves curves.csv"
SCORE = f"score crw,dpo --budget quick --seeds 2 --horizon 400 {ROOM}"
STUDY = "study run S1a.toml --jobs 1 --out done"
BENCHMARK = "benchmark crw --name again --trained-in nothing --jobs 1"

CASES = {
    "run.txt": RUN,
    "rerun.txt": "rerun record.parquet",
    "check.txt": f"check crw,dpo {SMALL} --robots 6 {SECONDS}",
    "score.txt": SCORE,
    "score_curves.txt": CURVES,
    "study_list.txt": "study list",
    "study_run.txt": STUDY,
    "study_status.txt": "study status done",
    "study_verdict.txt": "study verdict done",
    "study_plot.txt": "study plot done --out figures --band --variant corrected,paper",
    "benchmark.txt": BENCHMARK,
    "benchmark_show.txt": "benchmark show mine.json",
    "list.txt": "list",
    "info.txt": "info search_and_rescue",
}
"""File with what is said -> words of the command."""

MADE_FILES = {
    "study_plot.txt": ("figures/S1a*.csv",),
    "benchmark.txt": ("results/benchmark/again.json",),
}
"""Case -> files that the command writes and that are kept too."""

FIRST = ("run.txt", "study_run.txt")
"""Cases whose runs others take; all of them can be carried out in any order after these."""

SMALL_STUDY = """
name = "S1a"
title = "Sizes in a small room"
scenario = "warehouse_small"
policies = ["crw", "dpo", "stochm", "stochx"]
rules = ["described"]

[set]
physics = "compiled"
n_objects = 60
width_m = 12.0
height_m = 8.0
nest_centre_m = [1.6, 4.0]
nest_size_m = [1.6, 6.4]

[[axis]]
criterion = "population_size"
values = [1, 2, 4]

[budget.tiny]
seeds = 2
horizon_s = 400.0
interval_s = 100.0
"""


class Place:
    """A folder in which all cases are carried out; runs that several of them need are made once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._answers: dict[str, str] = {}

    def answer(self, name: str) -> str:
        """Carry out a case, once; returns what its file should hold."""
        if name not in self._answers:
            code, out, err = self._said(shlex.split(CASES[name]))
            files = {
                file.relative_to(self.folder).as_posix(): steady_file(file, self.folder)
                for pattern in MADE_FILES.get(name, ())
                for file in sorted(self.folder.glob(pattern))
            }
            self._answers[name] = _as_text(code, out, err, files)
        return self._answers[name]

    def _said(self, words: list[str]) -> tuple[int, str, str]:
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            code = answer(*words)
        notes = steady_text(err.getvalue(), self.folder)
        return code, steady_text(out.getvalue(), self.folder), notes


def _as_text(code: int, out: str, err: str, files: dict[str, str]) -> str:
    parts = [out, *([f"--- exit code {code}"] if code else []), *([f"--- stderr\n{err}"] if err else [])]
    return "\n".join([*parts, *(f"--- {name}\n{text}" for name, text in files.items())]) + "\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """The folder of all cases, with the files that they read, and the tiny benchmark."""
    folder = tmp_path_factory.mktemp("texts").resolve()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        keep_figures(patch)
        _same_terminal(patch)
        _write_benchmark(folder / "benchmark", patch)
        _write_tables()
        place = Place(folder)
        for name in FIRST:
            place.answer(name)
        shutil.copy(min(Path("results").glob("warehouse_small_6_robots_400_s_*/*.parquet")), "record.parquet")
        yield place


def _same_terminal(patch: pytest.MonkeyPatch) -> None:
    for name in ("FORCE_COLOR", "CLICOLOR_FORCE", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "PY_COLORS"):
        patch.delenv(name, raising=False)
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb"), ("COLUMNS", "140"), ("LINES", "50")):
        patch.setenv(name, value)


def _write_benchmark(folder: Path, patch: pytest.MonkeyPatch) -> None:
    write_package(folder, [lambda world, k=k: 10.0 + k + world for k in range(4)])
    made_up_entry(load_protocol(TINY), "mine", lambda world: 13.0 + 2.0 * world, n_policies=2).write(Path("mine.json"))
    patch.setattr("metrics.benchmark.protocol.FOLDER", folder)


def _write_tables() -> None:
    """Write study files and a table of curves."""
    Path("S1a.toml").write_text(SMALL_STUDY)
    rows = [(n, seed, t, n**0.8 * (1 + 0.1 * seed) + t) for n in (1, 2, 4) for seed in (0, 1, 2) for t in (0, 1)]
    _write_curves("curves.csv", rows)


def _write_curves(file: str, rows: list[tuple[int, int, int, float]]) -> None:
    Path(file).write_text("\n".join(["n_robots,seed,interval,performance", *(",".join(map(str, row)) for row in rows)]))


def held_against(name: str, text: str) -> None:
    """Fail with a diff where a text is not that of its file; with REMAKE_TEXTS=1 write it instead."""
    file = TEXTS / name
    if REMAKE:
        TEXTS.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return
    stored = file.read_text(encoding="utf-8") if file.exists() else ""
    if stored == text:
        return
    lines = stored.splitlines(), text.splitlines()
    diff = difflib.unified_diff(*lines, f"tests/cli/texts/{name}", "now", lineterm="", n=2)
    how = "If this is meant: REMAKE_TEXTS=1 python -m pytest tests/cli/test_texts.py, and look at git diff."
    pytest.fail("\n".join([f"{name} has changed: swarm-forage {CASES.get(name, '')}", *diff, "", how]), pytrace=False)


@pytest.mark.parametrize("name", CASES)
def test_a_command_says_the_same(name: str, made: Place) -> None:
    held_against(name, made.answer(name))


def test_every_file_has_a_case() -> None:
    if REMAKE:
        for file in TEXTS.iterdir():
            if file.name not in CASES:
                file.unlink()
    assert {file.name for file in TEXTS.iterdir()} <= {*CASES}


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
