"""Commands that are killed at a random moment and given again, and what they leave in the end.

`kill(random, folder)` draws a command, a signal and moments, and compares what is there in the end with what an
undisturbed run of the same command leaves. Equal numbers give equal commands, signals and moments; what a machine has
done by a moment differs.
"""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import polars as pl

from swarm_forage_env.runs.record import RunRecord

LIMIT_S = 600.0
"""Longest a command may take; our choice for a machine that does other work, too."""
ENDS_WITHIN_S = 60.0
"""Longest a command, and its workers, may live on after a signal; likewise."""
MOST_KILLS = 3
"""Kills of one command; then it may end."""
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ENDS: dict[int, tuple[int, ...]] = {
    signal.SIGKILL: (-signal.SIGKILL,),
    signal.SIGTERM: (143, -signal.SIGTERM),  # the second: before the command could set its handler
    signal.SIGINT: (130, -signal.SIGINT),
}
"""Exit codes that a signal may lead to. A command may also have ended by itself in the same moment."""

SMALL = ("--robots", "3", "--objects", "10")
STUDY = """
name = "tiny"
scenario = "warehouse_small"
policies = ["random", "crw"]

[set]
n_objects = 10

[[axis]]
criterion = "population_size"
values = [2, 3]

[budget.tiny]
seeds = 4
horizon_s = 40.0
interval_s = 20.0
"""


@dataclass(frozen=True)
class Command:
    """A command that ends within seconds."""

    words: tuple[str, ...]
    """It writes into the folder "out"."""
    resumed: tuple[str, ...] = ()
    """What is given instead, as soon as there is `checkpoint`."""
    checkpoint: str = ""
    shows: Callable[[str], Any] | None = None
    """What of its stdout must be the same; None = nothing."""
    signals: tuple[int, ...] = SIGNALS


def _without_times(text: str) -> Any:
    """JSON without what a clock says."""
    return _untimed(json.loads(text))


TRAIN = ("train", "--out", "out", "--robots", "3", "--objects", "10", "--arenas", "2", "--hidden", "8",
         "--steps", "384", "--arg", "n_steps=16", "--arg", "batch_size=32", "--evaluate-every", "384",
         "--evaluation-horizon", "200", "--horizon", "200", "--no-small-start")  # fmt: skip
COMMANDS = {
    "run": Command(
        ("run", "--policy", "random,crw", "--horizon", "40", "--seeds", "4", "--jobs", "2", *SMALL, "--set",
         "interval_s=20", "--out", "out", "--json"),
        shows=_without_times,
    ),
    "score": Command(
        ("score", "--policy", "random", "--budget", "quick", "--measures", "noise_robustness", "--seeds", "2",
         "--horizon", "200", "--jobs", "1", *SMALL, "--out", "out"),
        shows=str,
    ),
    "compare": Command(
        ("compare", "--policy", "random,crw", "--budget", "quick", "--measures", "noise_robustness", "--seeds", "2",
         "--horizon", "200", "--jobs", "2", *SMALL, "--out", "out"),
        shows=str,
    ),
    "study": Command(("study", "run", "tiny.toml", "--jobs", "2", "--out", "out")),
    # One evaluation, at the end: what is killed before begins anew, and what is killed there goes on there. So weights
    # must be the same. With Ctrl-C and SIGTERM a checkpoint is kept on the way, from which arenas start anew.
    "train": Command(
        TRAIN,
        resumed=("--trust-models", *TRAIN, "--resume"),
        checkpoint="model.zip",
        signals=(signal.SIGKILL,),
    ),
}  # fmt: skip
NOT_COMPARED = re.compile(r"tensorboard/|model\.zip$|\.png$|(^|/)\.[^/]*\.tmp$")
"""Files that hold clock times inside, or are drawn from files that are compared; and drafts, which nothing reads."""
CLOCK_KEYS = re.compile(r"created|wall|cpu_time|seconds|elapsed|^(date|out|folder|picture|file|commit)$")
"""Keys of JSON and columns of tables that hold clock times, or names of folders; and the commit, which somebody may
make while a campaign runs."""


@dataclass
class Killed:
    """What became of a command."""

    figures: Counter[str] = field(default_factory=Counter)
    fault: str = ""


def possible() -> tuple[str, ...]:
    """Names of the commands whose extras are installed."""
    can_train = all(find_spec(name) for name in ("stable_baselines3", "torch"))
    return tuple(name for name in COMMANDS if can_train or name != "train")


def kill(random: Random, folder: Path, names: tuple[str, ...]) -> Killed:
    """Start a command, kill it some times, let it end, and compare what it leaves; `folder` holds undisturbed runs."""
    name = random.choice(names)
    command = COMMANDS[name]
    straight = _undisturbed(name, folder)
    place = folder / "broken"
    shutil.rmtree(place, ignore_errors=True)
    _furnish(place)
    seen, told = Killed(), [name]
    try:
        for _ in range(random.randint(1, MOST_KILLS)):
            sent = random.choice(command.signals)
            n_files = random.randint(0, len(straight.files))
            after_s = random.choice((random.uniform(0.0, straight.seconds), random.uniform(0.0, 0.2)))
            ended = _killed(command, place, sent, n_files, after_s)
            told.append(f"{signal.Signals(sent).name} {after_s:.2f} s after {n_files} files: {ended}")
            seen.figures["kills"] += ended != "over"
            if ended == "over":
                break
        seen.figures[f"commands of {name}"] += 1
        words = _words(command, place)
        done = _call(words, place)
        assert done.returncode == 0, f"the command given again fails: {done.stderr[-2000:]}"
        assert set(_files(place)) == set(straight.files), f"files are {_files(place)}, not {straight.files}"
        for file in straight.files:
            assert _content(place / "out" / file) == straight.contents[file], f"{file} is another"
        assert command.shows is None or command.shows(done.stdout) == straight.shown, "it shows something else"
    except AssertionError as error:
        seen.fault = f"{'; '.join(told)}\n{error}"
    return seen


@dataclass(frozen=True)
class Straight:
    """What an undisturbed run of a command leaves, and how long it takes."""

    files: tuple[str, ...]
    contents: dict[str, Any]
    shown: Any
    seconds: float


@cache
def _undisturbed(name: str, folder: Path) -> Straight:
    command, place = COMMANDS[name], folder / f"straight_{name}"
    _furnish(place)
    begun = time.monotonic()
    done = _call(command.words, place)
    seconds = time.monotonic() - begun
    if done.returncode:
        raise RuntimeError(f"Expected {name} to end well when nobody disturbs it, got: {done.stderr[-2000:]}")
    files = _files(place)
    contents = {file: _content(place / "out" / file) for file in files}
    return Straight(files, contents, command.shows(done.stdout) if command.shows else None, seconds)


def _furnish(place: Path) -> None:
    place.mkdir(parents=True)
    (place / "tiny.toml").write_text(STUDY, encoding="utf-8")


def _words(command: Command, place: Path) -> tuple[str, ...]:
    is_begun = command.checkpoint and (place / "out" / command.checkpoint).exists()
    return command.resumed if is_begun else command.words


def _start(words: tuple[str, ...], place: Path) -> "subprocess.Popen[str]":
    program = [sys.executable, "-m", "swarm_forage_env.cli", *words]
    root = Path(__file__).parents[2]
    paths = os.pathsep.join(filter(None, (str(root), os.environ.get("PYTHONPATH"))))
    # Each command is a group of processes: so a signal can reach its workers, and those that are left can be seen.
    environment = os.environ | {"COLUMNS": "120", "PYTHONPATH": paths}
    pipe = subprocess.PIPE
    return subprocess.Popen(
        program, cwd=place, stdout=pipe, stderr=pipe, text=True, env=environment, start_new_session=True
    )


def _call(words: tuple[str, ...], place: Path) -> "subprocess.CompletedProcess[str]":
    with _start(words, place) as started:
        try:
            out, err = started.communicate(timeout=LIMIT_S)
        finally:
            _end_group(started)
    return subprocess.CompletedProcess(words, started.returncode, out, err)


def _killed(command: Command, place: Path, sent: int, n_files: int, after_s: float) -> str:
    """Start a command and kill it `after_s` after there are `n_files`; returns how it ended."""
    with _start(_words(command, place), place) as started:
        err = ""
        try:
            limit = time.monotonic() + LIMIT_S
            while started.poll() is None and len(_files(place)) < n_files:
                assert time.monotonic() < limit, f"still running after {LIMIT_S:g} s"
                time.sleep(0.005)
            with suppress(subprocess.TimeoutExpired):
                started.wait(after_s)
            if started.poll() is not None:
                return "over"
            if sent == signal.SIGINT:  # a terminal sends Ctrl-C to all
                os.killpg(started.pid, sent)
            else:
                started.send_signal(sent)
            try:
                _, err = started.communicate(timeout=ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                raise AssertionError(f"signal {sent} does not end it within {ENDS_WITHIN_S:g} s") from None
            _wait_for_workers(started)
        finally:
            _end_group(started)
    code = started.returncode
    if code == 0:
        return "over"
    if sent == signal.SIGINT and code == 1 and err.startswith("Fatal Python error: init_import_site"):
        return "killed while Python itself started"  # it ends so before a line of ours is run
    assert code in ENDS[sent], f"signal {sent} leads to exit code {code}: {err[-2000:]}"
    assert "Traceback" not in err or code < 0, f"a traceback on stderr: {err[-2000:]}"
    return f"exit code {code}"


def _wait_for_workers(started: "subprocess.Popen[str]") -> None:
    """Wait until nobody of the group is left."""
    limit = time.monotonic() + ENDS_WITHIN_S
    with suppress(ProcessLookupError):
        while time.monotonic() < limit:
            os.killpg(started.pid, 0)
            time.sleep(0.02)
        raise AssertionError(f"workers live on {ENDS_WITHIN_S:g} s after the command was killed")


def _end_group(started: "subprocess.Popen[str]") -> None:
    """Whatever went wrong, nothing stays behind."""
    with suppress(ProcessLookupError):
        os.killpg(started.pid, signal.SIGKILL)


def _files(place: Path) -> tuple[str, ...]:
    """Files in the folder of results, in order."""
    out = place / "out"
    found = (file.relative_to(out).as_posix() for file in out.rglob("*") if file.is_file())
    return tuple(sorted(name for name in found if not NOT_COMPARED.search(name)))


def _content(file: Path) -> Any:
    """What a file holds, clock times aside, for comparison by ==."""
    if file.suffix == ".parquet":
        with suppress(ValueError):
            record = RunRecord.read(file)
            columns = {name: values.tolist() for name, values in record.columns().items()}
            return record.keys(), columns, record.spec
        frame = pl.read_parquet(file)
        return frame.select(sorted(name for name in frame.columns if not CLOCK_KEYS.search(name))).rows()
    if file.suffix == ".npz":
        with np.load(file) as parts:
            return {name: _untimed(json.loads(str(value))) if name == "about" else value.tolist()
                    for name, value in parts.items()}  # fmt: skip
    if file.suffix == ".csv":
        with file.open(newline="", encoding="utf-8") as table:
            return _untimed(list(csv.DictReader(table)))
    if file.suffix == ".json":
        return _without_times(file.read_text(encoding="utf-8"))
    return file.read_bytes()


def _untimed(value: Any) -> Any:
    """Nested JSON without values whose keys are of clocks."""
    if isinstance(value, dict):
        return {key: _untimed(each) for key, each in value.items() if not CLOCK_KEYS.search(key)}
    return [_untimed(each) for each in value] if isinstance(value, list) else value
