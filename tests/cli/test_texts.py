"""What commands print, word by word, for tiny runs.

A file in `tests/cli/texts` for each case. After a change that is meant to change words or numbers:

    REMAKE_TEXTS=1 python -m pytest tests/cli/test_texts.py

makes them anew; `git diff` then shows what has changed. Where only the words of a command change, change them in
`CASES`: the files stay.
"""

import difflib
import io
import json
import os
import re
import shlex
import shutil
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

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

CASES = {
    "run.txt": f"run crw,dpo --seeds 2 {ROOM} {SECONDS}",
    "rerun.txt": "rerun record.parquet",
    "check.txt": f"check crw,dpo {SMALL} --robots 6 {SECONDS}",
    "score.txt": f"score crw,dpo --budget quick --seeds 2 --horizon 400 {ROOM}",
    "score_curves.txt": "score --curves curves.csv",
    "study_list.txt": "study list",
    "study_run.txt": "study run S1a.toml --jobs 1 --out done",
    "study_status.txt": "study status done",
    "study_verdict.txt": "study verdict done",
    "study_plot.txt": "study plot done --out figures --band --variant corrected,paper",
    "benchmark.txt": "benchmark crw --name again --trained-in nothing --jobs 1",
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


def said(name: str) -> str:
    """Carry out a case in the current folder; returns what its file should hold."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = answer(*shlex.split(CASES[name]))
    notes = steady(err.getvalue())
    parts = [
        steady(out.getvalue()),
        *([f"--- exit code {code}"] if code else []),
        *([f"--- stderr\n{notes}"] if notes else []),
    ]
    files = [file for pattern in MADE_FILES.get(name, ()) for file in sorted(Path().glob(pattern))]
    return "\n".join([*parts, *(f"--- {file.as_posix()}\n{steady_file(file)}" for file in files)]) + "\n"


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """What `FIRST` say, in a folder with the files that other cases read, and the tiny benchmark."""
    folder = tmp_path_factory.mktemp("texts").resolve()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        keep_figures(patch)
        for name in ("FORCE_COLOR", "CLICOLOR_FORCE", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "PY_COLORS"):
            patch.delenv(name, raising=False)
        for name, value in (("NO_COLOR", "1"), ("TERM", "dumb"), ("COLUMNS", "140"), ("LINES", "50")):
            patch.setenv(name, value)
        write_package(folder / "benchmark", [lambda world, k=k: 10.0 + k + world for k in range(4)])
        mine = made_up_entry(load_protocol(TINY), "mine", lambda world: 13.0 + 2.0 * world, n_policies=2)
        mine.write(Path("mine.json"))
        patch.setattr("metrics.benchmark.protocol.FOLDER", folder / "benchmark")
        Path("S1a.toml").write_text(SMALL_STUDY)
        rows = [f"{n},{s},{t},{n**0.8 * (1 + 0.1 * s) + t}" for n in (1, 2, 4) for s in (0, 1, 2) for t in (0, 1)]
        Path("curves.csv").write_text("\n".join(["n_robots,seed,interval,performance", *rows]))
        told = {name: said(name) for name in FIRST}
        shutil.copy(min(Path("results").glob("warehouse_small_6_robots_400_s_*/*.parquet")), "record.parquet")
        yield told


@pytest.mark.parametrize("name", CASES)
def test_a_command_says_the_same(name: str, first: dict[str, str]) -> None:
    """With REMAKE_TEXTS=1 its file is written instead."""
    text, file = first.get(name) or said(name), TEXTS / name
    if REMAKE:
        file.write_text(text, encoding="utf-8")
    stored = file.read_text(encoding="utf-8") if file.exists() else ""
    if stored != text:
        diff = difflib.unified_diff(stored.splitlines(), text.splitlines(), str(file), "now", lineterm="", n=2)
        how = "If this is meant: REMAKE_TEXTS=1 python -m pytest tests/cli/test_texts.py, and look at git diff."
        pytest.fail("\n".join([f"{name} has changed: swarm-forage {CASES[name]}", *diff, "", how]), pytrace=False)


def test_every_file_has_a_case() -> None:
    assert {file.name for file in TEXTS.iterdir()} <= {*CASES}


_PROGRESS = re.compile(r"\d+/\d+ runs, .*|\d+ of \d+ runs stored already.*|swarm-forage: Compiling what is used .*")
"""Lines that depend on what is stored and compiled already."""
_SPEED = re.compile(r"(\d\.\d{3} +)[\d,]+$", re.MULTILINE)
"""In the last column of a table of runs."""


def steady(text: str) -> str:
    """Return what is printed without progress and times."""
    if "per wall s" in text:
        text = _SPEED.sub(r"\1<speed>", text)
    return "\n".join(line.rstrip() for line in text.splitlines() if not _PROGRESS.fullmatch(line))


def steady_file(file: Path) -> str:
    """Return what a file says: JSON without versions, CSV with six digits: the last ones differ between processors."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".json":
        return json.dumps(json.loads(text) | {"versions": "<varies>"}, indent=1)
    numbers = r"(?<![\w.])-?\d+\.\d+(e[+-]?\d+)?"
    return steady(re.sub(numbers, lambda number: f"{float(number[0]):.6g}", text))
