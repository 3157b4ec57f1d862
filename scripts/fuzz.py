"""Try the package at random until the time is over, and show what fails with the number that repeats it.

    scripts/fuzz commands --minutes 30
    scripts/fuzz worlds --first 123 --count 1
    scripts/fuzz kills --count 50 --note

commands   malformed words and files. A command may end with an exit code that is documented and with one line on
           stderr; a traceback, another exit code or one that takes too long is a fault. Nothing is run, only begun.
files      valid files of every format, changed by field or by byte, each given to the command that reads it. Likewise;
           and nothing may be written but into the current folder, or ask for more memory than there is. --format
           takes those of one format, such as packed.
worlds     scenarios, wrappers, actions, wrong calls and snapshots. Walls, objects, observations, rewards, agents and
           records are looked at after every tick, and each run is made twice.
kills      run, score, compare, train and study run: killed at a random moment and given again, until what they
           leave can be compared with what an undisturbed run leaves.
pairs      a command that writes, given twice at a random moment to the same folder or file: both end well or one is
           refused, and what they leave is what one alone leaves.
signals    Ctrl-C or SIGTERM at a random moment of any command, also while it starts: the documented exit code, one
           line, and no half file.

The same number makes the same case again; of the last three, what the machine had done by then may differ. The last
line holds figures, also after Ctrl-C; --note keeps them in docs/promises.md. In tests/support, malformed.py,
changed_files.py, random_worlds.py, kills.py and pairs.py say what a case is.
"""

import argparse
import os
import re
import resource
import shlex
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from scripts.arguments import whole

PAGE = Path(__file__).resolve().parent.parent / "docs/promises.md"
BLOCK = re.compile(r"(<!-- table by scripts/fuzz -->\n).*?(<!-- end of table -->)", re.DOTALL)
HEADINGS = ("what", "cases", "faults", "figures", "on", "command")
LIMIT_S = 120
"""A command that only begins takes a second; our choice for a machine that does other work, too."""
MEMORY_BYTES = 12 * 2**30
"""Address space while commands are given: one that asks for more fails here and not the machine."""


class TooLongError(Exception):
    """A command that does not come to its end; no OSError as TimeoutError is, which a command may catch."""


@dataclass
class Campaign:
    """How far a campaign has come."""

    kind: str
    first: int
    case: Callable[[int, Path], tuple[Counter[str], str]]
    options: str = ""
    """Further words of its command."""
    n_cases: int = 0
    n_faults: int = 0
    figures: Counter[str] = field(default_factory=Counter)
    is_stopped: bool = False

    def stop(self, *_: object) -> None:
        """Handle Ctrl-C. A command that is tried may turn it into an exit code of its own, so it is noted, too."""
        self.is_stopped = True
        raise KeyboardInterrupt

    def told(self) -> str:
        """Figures of the cases."""
        return ", ".join(f"{count:,} {name}" for name, count in sorted(self.figures.items()))

    def last_line(self) -> str:
        """What the script ends with."""
        return f"{self.n_cases:,} {self.kind}, {self.n_faults:,} faults; {self.told() or 'nothing was tried'}"


def one_command(number: int, folder: Path) -> tuple[Counter[str], str]:
    """Give a malformed command; returns figures, and the fault or nothing."""
    from tests.support.malformed import malformed_command, outcome

    words = malformed_command(Random(number), folder)
    signal.alarm(LIMIT_S)
    found = outcome(words)
    signal.alarm(0)
    if found.fault:
        return Counter(), f"swarm-forage {shlex.join(words)[:2000]}\n{found.fault}"
    return Counter({f"ended with exit code {found.code}": 1}), ""


def one_world(number: int, _folder: Path) -> tuple[Counter[str], str]:
    """Visit a random world; returns figures, and the fault or nothing."""
    from tests.support.random_worlds import random_world, visit

    seen = visit(random_world(Random(number)))
    return seen.figures, seen.fault


def one_kill(number: int, folder: Path) -> tuple[Counter[str], str]:
    """Kill a command; returns figures, and the fault or nothing."""
    from tests.support.kills import kill, possible

    seen = kill(Random(number), folder, possible())
    return seen.figures, seen.fault


def one_file(number: int, folder: Path, chosen: str = "") -> tuple[Counter[str], str]:
    """Give a changed file to the command that reads it; returns figures, and the fault or nothing."""
    from tests.support.changed_files import FORMATS, changed_file, what_is_wrong

    random = Random(number)
    kind = random.choice(tuple(FORMATS))
    here = folder / "here"
    shutil.rmtree(here, ignore_errors=True)
    here.mkdir()
    os.chdir(here)
    signal.alarm(LIMIT_S)
    words = changed_file(random, folder, chosen or kind)
    code, fault = what_is_wrong(words, folder)
    signal.alarm(0)
    if fault:
        return Counter(), f"{shlex.join(words)[:2000]}\n{fault}"
    return Counter({f"ended with exit code {code}": 1}), ""


def one_pair(number: int, folder: Path) -> tuple[Counter[str], str]:
    """Give a command twice at once; returns figures, and the fault or nothing."""
    from tests.support.pairs import can_be_given, pair

    seen = pair(Random(number), folder, can_be_given())
    return seen.figures, seen.fault


def one_signal(number: int, folder: Path) -> tuple[Counter[str], str]:
    """Interrupt a command; returns figures, and the fault or nothing."""
    from tests.support.pairs import READERS, can_be_given, interrupted

    seen = interrupted(Random(number), folder, (*can_be_given(), *READERS))
    return seen.figures, seen.fault


KINDS: dict[str, Callable[[int, Path], tuple[Counter[str], str]]] = {
    "commands": one_command,
    "files": one_file,
    "worlds": one_world,
    "kills": one_kill,
    "pairs": one_pair,
    "signals": one_signal,
}


def main(words: Sequence[str] | None = None) -> int:
    """Return 1 if there was a fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS, help="what is tried")
    parser.add_argument("--minutes", type=float, default=30.0, help="how long; default 30")
    parser.add_argument("--first", type=whole(at_least=0), default=0, help="number of the first case; default 0")
    parser.add_argument("--count", type=whole(at_least=1), default=None, help="cases; default as many as fit")
    parser.add_argument("--format", default="", help="of files: take only those of this format")
    parser.add_argument("--note", action="store_true", help="write the figures into docs/promises.md")
    given = parser.parse_args(words)
    if find_spec("pytest") is None:
        parser.error("expected pytest, with which cases are checked: pip install -e '.[test]'")
    case = KINDS[given.kind]
    if given.format:
        _check_format(parser, given)
        case = partial(one_file, chosen=given.format)
    campaign = Campaign(given.kind, given.first, case, options=f" --format {given.format}" if given.format else "")
    with _bounded(campaign) as folder, suppress(KeyboardInterrupt):
        _go_on(campaign, folder, time.monotonic() + 60.0 * given.minutes, given.count)
    if campaign.is_stopped:
        print("Stopped by Ctrl-C.")
    print(campaign.last_line())
    if given.note:
        note(campaign)
    return 1 if campaign.n_faults else 0


def _check_format(parser: argparse.ArgumentParser, given: argparse.Namespace) -> None:
    from tests.support.changed_files import FORMATS

    if given.kind != "files" or given.format not in FORMATS:
        parser.error(f"expected --format with files alone, one of {', '.join(FORMATS)}, got {given.format!r}")


@contextmanager
def _bounded(campaign: Campaign) -> Iterator[Path]:
    """Work in an empty folder that is removed, with Ctrl-C told to the campaign, and commands held within bounds."""
    place, memory = Path.cwd(), resource.getrlimit(resource.RLIMIT_AS)
    handlers = {signal.SIGINT: campaign.stop, signal.SIGALRM: _too_long}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    if campaign.kind in ("commands", "files"):
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, memory[1]))
    try:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                yield Path(folder)
            finally:
                os.chdir(place)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, memory)
        for number, handler in before.items():
            signal.signal(number, handler)


def _go_on(campaign: Campaign, folder: Path, ends: float, count: int | None) -> None:
    """Try one case after the other."""
    while time.monotonic() < ends and (count is None or campaign.n_cases < count):
        number = campaign.first + campaign.n_cases
        figures, fault = campaign.case(number, folder)
        if campaign.is_stopped:
            raise KeyboardInterrupt
        campaign.figures += figures
        campaign.n_cases += 1
        if fault:
            campaign.n_faults += 1
            words = f"scripts/fuzz {campaign.kind} --first {number} --count 1{campaign.options}"
            print(f"--- {words}\n{fault}", flush=True)


def note(campaign: Campaign) -> None:
    """Put the figures of a campaign into the page; the rows of other kinds stay."""
    command = f"`scripts/fuzz {campaign.kind} --first {campaign.first} --count {campaign.n_cases}{campaign.options}`"
    today = f"{datetime.now(UTC):%Y-%m-%d}"
    row = [f"{campaign.n_cases:,}", f"{campaign.n_faults:,}", campaign.told(), today, command]
    text = PAGE.read_text(encoding="utf-8")
    found = BLOCK.search(text)
    if found is None:
        raise ValueError(f"Expected the marks of a table by scripts/fuzz in {PAGE}, found none.")
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in found[0].splitlines()]
    rows = {line[0]: line[1:] for line in cells if line[0] in KINDS} | {campaign.kind: row}
    lines = [HEADINGS, ["---"] * len(HEADINGS), *([kind, *rows[kind]] for kind in KINDS if kind in rows)]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    PAGE.write_text(BLOCK.sub(lambda kept: f"{kept[1]}{table}\n{kept[2]}", text), encoding="utf-8")


def _too_long(*_: object) -> None:
    raise TooLongError(f"took longer than {LIMIT_S} s")


if __name__ == "__main__":
    sys.exit(main())
