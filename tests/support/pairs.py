"""Two commands at once on one folder or file, and commands that are interrupted, in processes of their own.

`pair` gives a command twice, or two commands that write the same, a random moment apart: both end well, or one is
refused in one line, and what is left is what one alone leaves, file by file. `interrupted` sends Ctrl-C or SIGTERM at a
random moment, also while Python still starts: the command ends with its exit code and in one line, and leaves no half
file.
"""

import re
import shlex
import shutil
import signal
import subprocess
import time
from collections import Counter
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any
from zlib import crc32

from swarm_forage_env.policies.pretrained import network_file
from tests.support import kills
from tests.support.kills import Killed
from tests.support.small_files import small_file

ROOT = Path(__file__).parents[2]
OF_PAPER = ROOT / "docs/results/S1a.parquet"
TINY = ("random", *kills.SMALL, "--horizon", "40", "--set", "interval_s=20")
WRITERS: dict[str, tuple[str, ...]] = {
    "run": kills.COMMANDS["run"].words,
    "score": kills.COMMANDS["score"].words,
    "study run": kills.COMMANDS["study"].words,
    "replay": ("replay", *TINY, "--file", "out/page.html"),
    "maps": ("maps", *TINY, "--picture", "out/maps.png"),
    "record": ("record", *TINY[:-4], "--seconds", "10", "--size", "240", "--file", "out/film.gif"),
    "dataset": ("dataset", *TINY, "--seeds", "2", "--out", "out"),
    "export": ("export", str(network_file("ppo_warehouse_small")), "--file", "out/network.h"),
    "train": kills.COMMANDS["train"].words,
    "study plot": ("study", "plot", "done", "--out", "out"),
    "study verdict": ("study", "verdict", str(OF_PAPER), "--file", "out/verdict.json"),
    "plot": ("plot", "there/runs", "--picture", "out/performance.png"),
    "train curves": ("train", "curves", "training", "--policy", "none", "--picture", "out/curves.png"),
}
"""Command that writes into the folder "out" -> its words."""
FEWER = ("run", "--policy", "random", "--horizon", "40", "--seeds", "2", "--jobs", "1", *kills.SMALL, "--set",
         "interval_s=20", "--out", "out", "--json")  # fmt: skip
MIXED: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "run and fewer runs": (WRITERS["run"], FEWER),
    "maps and plot": (WRITERS["maps"], (*WRITERS["plot"][:-1], "out/maps.png")),
}
"""Two commands that write the same folder or file -> their words."""
READERS: dict[str, tuple[str, ...]] = {
    "list": ("list",),
    "info": ("info", "crw"),
    "study status": ("study", "status", str(small_file("packed.parquet"))),
    "benchmark show": ("benchmark", "show", str(small_file("entry.json"))),
}
"""Commands that write nothing."""
READ_BACK = (".parquet", ".csv", ".json", ".npz")
COMPARED = (*READ_BACK, ".h", ".md")
"""Endings of files that are equal whenever they are made."""
REFUSED = re.compile(r"Expected to be the only one that writes to")
"""What one of two may say."""
ENDS_WITH = {".html": b"</html>\n", ".png": b"IEND\xaeB`\x82", ".gif": b";", ".svg": b"</svg>\n"}
"""What a whole file ends with."""
LATEST_S = 3.0
"""Until when the second command begins, or a signal comes."""


def can_be_given() -> tuple[str, ...]:
    """Names of the writers whose extras are installed."""
    lacking = {"train"} if not all(find_spec(name) for name in ("stable_baselines3", "torch")) else set()
    lacking |= {"record"} if find_spec("PIL") is None else set()
    lacking |= set() if OF_PAPER.exists() else {"study verdict"}  # an sdist has no results
    return tuple(name for name in WRITERS if name not in lacking)


def pair(random: Random, folder: Path, names: tuple[str, ...]) -> Killed:
    """Give one of these commands twice at once, or two of `MIXED`; `folder` holds what each leaves alone."""
    name, after_s = random.choice(names), random.choice((0.0, random.uniform(0.0, LATEST_S)))
    both = MIXED.get(name) or (WRITERS[name],) * 2
    allowed = [_alone(words, folder) for words in dict.fromkeys(both)]
    place = folder / "pair"
    shutil.rmtree(place, ignore_errors=True)
    _furnish(place, both[0], folder)
    seen = Killed(Counter({f"pairs of {name}": 1}))
    first = kills._start(both[0], place)
    time.sleep(after_s)
    second = kills._start(both[1], place)
    codes = []
    try:
        for process in (first, second):
            _, err = process.communicate(timeout=kills.LIMIT_S)
            codes.append(process.returncode)
            refusals = [line for line in err.splitlines() if REFUSED.search(line)]
            assert process.returncode == 0 or (process.returncode, len(refusals)) == (2, 1), err[-2000:]
        assert 0 in codes, f"both ended with {codes}"
        seen.figures["refused"] += codes != [0, 0]
        others = _others(_left(place), allowed)
        assert not others, f"left {others}"
    except (AssertionError, subprocess.TimeoutExpired) as error:
        seen.fault = f"two of {name}, {after_s:.2f} s apart: {error}"
    finally:
        for process in (first, second):
            kills._end_group(process)
    return seen


def interrupted(random: Random, folder: Path, names: tuple[str, ...]) -> Killed:
    """Interrupt one of these commands."""
    name, sent = random.choice(names), random.choice((signal.SIGINT, signal.SIGTERM))
    after_s = random.choice((random.uniform(0.0, 0.3), random.uniform(0.0, LATEST_S)))
    words = (WRITERS | READERS)[name]
    place = folder / "interrupted"
    shutil.rmtree(place, ignore_errors=True)
    _furnish(place, words, folder)
    seen = Killed(Counter({sent.name: 1}))
    with kills._start(words, place) as started:
        try:
            with suppress(subprocess.TimeoutExpired):
                started.wait(after_s)
            started.send_signal(sent)
            _, err = started.communicate(timeout=kills.ENDS_WITHIN_S)
            seen.fault = _wrong(started.returncode, sent, err) or _half_files(place)
        except subprocess.TimeoutExpired:
            seen.fault = f"still running {kills.ENDS_WITHIN_S:g} s after the signal"
        finally:
            kills._end_group(started)
    if seen.fault:
        seen.fault = f"{name}, {sent.name} after {after_s:.2f} s: {seen.fault}"
    return seen


def _wrong(code: int, sent: int, err: str) -> str:
    """Say what is wrong with how an interrupted command ended; nothing where it was faster, or Python still started."""
    if code in (0, -sent) or (code == 1 and ("init_import_site" in err or "KeyboardInterrupt" in err)):
        return ""
    if code not in kills.ENDS[sent]:
        return f"exit code {code}: {err[-2000:]}"
    if "Traceback" in err:
        return f"a traceback: {err[-2000:]}"
    told = [line for line in err.splitlines() if "nterrupted" in line]
    return "" if len(told) == 1 else f"{len(told)} lines: {err[-2000:]}"


def _half_files(place: Path) -> str:
    """Name drafts, and files that their readers refuse."""
    for file in (place / "out").rglob("*"):
        if file.name.startswith(".") and file.suffix == ".tmp":
            return f"left the draft {file.name}"
        if file.is_file() and file.suffix in READ_BACK:
            try:
                kills._content(file)
            except Exception as error:  # noqa: BLE001 - whatever it is, the file is no whole one
                return f"left half of {file.name}: {error}"
    return ""


def _furnish(place: Path, words: tuple[str, ...], folder: Path) -> None:
    """Make the folder in which a command is given, with what it reads."""
    from swarm_forage_env.studies.study_folder import StudyFolder
    from swarm_forage_env.studies.study_table import read_study, unpack_study

    kills._furnish(place)
    unpack_study(read_study(small_file("packed.parquet")), StudyFolder(place / "there"))
    if "done" in words:
        _alone(WRITERS["study run"], folder)
        shutil.copytree(_place_alone(WRITERS["study run"], folder) / "out", place / "done")
    if "training" in words:
        (place / "training").mkdir()
        for name in ("plan.json", "evaluations.csv"):
            shutil.copy(small_file(name), place / "training")


def _place_alone(words: tuple[str, ...], folder: Path) -> Path:
    return folder / f"alone_{crc32(repr(words).encode()):08x}"


@cache
def _alone(words: tuple[str, ...], folder: Path) -> dict[str, Any]:
    """What a command leaves by itself."""
    place = _place_alone(words, folder)
    _furnish(place, words, folder)
    done = kills._call(words, place)
    if done.returncode:
        raise RuntimeError(f"Expected {shlex.join(words)} to end well when it is alone, got: {done.stderr[-2000:]}")
    return _left(place)


def _left(place: Path) -> dict[str, Any]:
    """Files in "out" by name, drafts included, with the contents of those that can be compared."""
    found = {file.relative_to(place).as_posix(): file for file in (place / "out").rglob("*") if file.is_file()}
    return {name: _told(name, file) for name, file in found.items() if "tensorboard/" not in name}


def _told(name: str, file: Path) -> Any:
    """Return the content of a file, or whether it is whole."""
    if file.suffix in COMPARED and not kills.NOT_COMPARED.search(name):
        return kills._content(file)
    return file.read_bytes().endswith(ENDS_WITH.get(file.suffix, b""))


def _others(left: dict[str, Any], allowed: list[dict[str, Any]]) -> str:
    """Name files that are too few, too many, or such as none of several commands leaves; nothing if there are none."""
    names = set().union(*allowed)
    contents = {name: [alone[name] for alone in allowed if name in alone] for name in names}
    return ", ".join(sorted(names ^ set(left)) or [name for name in left if left[name] not in contents[name]])
