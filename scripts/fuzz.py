"""Try the package at random until the time is over, and show what fails with the number that repeats it.

    scripts/fuzz commands --minutes 30
    scripts/fuzz worlds --first 123 --count 1
    scripts/fuzz kills --count 50 --note

commands   malformed words and files. A command may end with an exit code that is documented and with one line on
           stderr; a traceback, another exit code or one that takes too long is a fault. Nothing is run, only begun.
worlds     scenarios, wrappers, actions, wrong calls and snapshots. Walls, objects, observations, rewards, agents and
           records are looked at after every tick, and each run is made twice.
kills      run, score, compare, train and study run: killed at a random moment and given again, until what they
           leave can be compared with what an undisturbed run leaves.

The same number makes the same case again; of a kill, what the machine had done by then may differ. The last line holds
figures, also after Ctrl-C; --note keeps them in docs/promises.md. tests/support/malformed.py, random_worlds.py and
kills.py say what a case is.
"""

import argparse
import os
import re
import resource
import shlex
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
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


KINDS: dict[str, Callable[[int, Path], tuple[Counter[str], str]]] = {
    "commands": one_command,
    "worlds": one_world,
    "kills": one_kill,
}


def main(words: Sequence[str] | None = None) -> int:
    """Return 1 if there was a fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS, help="what is tried")
    parser.add_argument("--minutes", type=float, default=30.0, help="how long; default 30")
    parser.add_argument("--first", type=whole(at_least=0), default=0, help="number of the first case; default 0")
    parser.add_argument("--count", type=whole(at_least=1), default=None, help="cases; default as many as fit")
    parser.add_argument("--note", action="store_true", help="write the figures into docs/promises.md")
    given = parser.parse_args(words)
    if find_spec("pytest") is None:
        parser.error("expected pytest, with which cases are checked: pip install -e '.[test]'")
    campaign = Campaign(given.kind, given.first)
    with _bounded(campaign) as folder, suppress(KeyboardInterrupt):
        _go_on(campaign, folder, time.monotonic() + 60.0 * given.minutes, given.count)
    if campaign.is_stopped:
        print("Stopped by Ctrl-C.")
    print(campaign.last_line())
    if given.note:
        note(campaign)
    return 1 if campaign.n_faults else 0


@contextmanager
def _bounded(campaign: Campaign) -> Iterator[Path]:
    """Work in an empty folder that is removed, with Ctrl-C told to the campaign, and commands held within bounds."""
    place, memory = Path.cwd(), resource.getrlimit(resource.RLIMIT_AS)
    handlers = {signal.SIGINT: campaign.stop, signal.SIGALRM: _too_long}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    if campaign.kind == "commands":
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
        figures, fault = KINDS[campaign.kind](number, folder)
        if campaign.is_stopped:
            raise KeyboardInterrupt
        campaign.figures += figures
        campaign.n_cases += 1
        if fault:
            campaign.n_faults += 1
            print(f"--- scripts/fuzz {campaign.kind} --first {number} --count 1\n{fault}", flush=True)


def note(campaign: Campaign) -> None:
    """Put the figures of a campaign into the page; the rows of other kinds stay."""
    command = f"`scripts/fuzz {campaign.kind} --first {campaign.first} --count {campaign.n_cases}`"
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
