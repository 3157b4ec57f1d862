"""Try the package at random until the time is over, and show what fails with the number that repeats it.

    scripts/fuzz worlds --first 123 --count 1
    scripts/fuzz files --minutes 30

files      small files of every format with other bytes, or cut off. The reader of the format returns or raises an
           error that it documents. A case that ends the process is a fault, and another process goes on.
worlds     scenarios, wrappers, actions, wrong calls and snapshots. Walls, objects, observations, rewards, agents and
           records are looked at after every tick, and each run is made twice.

The same number makes the same case again. The last line holds figures, also after Ctrl-C. In tests/support,
changed_files.py and random_worlds.py say what a case is.
"""

import argparse
import os
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import count as numbers_from
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))


LIMIT_S = 120
"""Seconds of a core: a command that only begins takes one, or twenty if it compiles; our choice."""
MEMORY_BYTES = 12 * 2**30
"""Address space while commands are given: one that asks for more fails here and not the machine."""
MOST_SILENT_S = 10.0 * LIMIT_S
"""Until a process that makes cases, and tells nothing of any, is ended: it may wait for ever, and use no core."""
IN_MEMORY = Path("/dev/shm")
"""Where files of cases lie, if there is such a place: disks are slower than all else."""


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

    @property
    def number(self) -> int:
        """Number of the next case."""
        return self.first + self.n_cases

    def goes_on(self, ends: float, count: int | None) -> bool:
        """Return whether there is time for another case, of so many."""
        return time.monotonic() < ends and (count is None or self.n_cases < count)

    def take(self, figures: Counter[str], fault: str) -> None:
        """Count the next case, and show its fault."""
        if self.is_stopped:
            raise KeyboardInterrupt
        number = self.number
        self.figures += figures
        self.n_cases += 1
        if fault:
            self.n_faults += 1
            words = f"scripts/fuzz {self.kind} --first {number} --count 1"
            print(f"--- {words}\n{fault}", flush=True)

    def told(self) -> str:
        """Figures of the cases."""
        return ", ".join(f"{count:,} {name}" for name, count in sorted(self.figures.items()))

    def last_line(self) -> str:
        """What the script ends with."""
        return f"{self.n_cases:,} {self.kind}, {self.n_faults:,} faults; {self.told() or 'nothing was tried'}"


def one_world(number: int, _folder: Path) -> tuple[Counter[str], str]:
    """Visit a random world; returns figures, and the fault or nothing."""
    from tests.support.random_worlds import random_world, visit

    seen = visit(random_world(Random(number)))
    return seen.figures, seen.fault


def one_file(number: int, folder: Path) -> tuple[Counter[str], str]:
    """Give a changed file to what reads it; returns figures, and the fault or nothing."""
    from tests.support.changed_files import READERS, give

    random = Random(number)
    name = random.choice(tuple(READERS))
    signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
    outcome, fault = give(random, folder, name)
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    return Counter({outcome: 1, f"of {name}": 1}), f"{name}\n{fault}" if fault else ""


ERRORS = "stderr.txt"
"""In the folder: what such a process wrote to stderr."""
KINDS: dict[str, Callable[[int, Path], tuple[Counter[str], str]]] = {
    "files": one_file,
    "worlds": one_world,
}


def main(words: Sequence[str] | None = None) -> int:
    """Return 1 if there was a fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS, help="what is tried")
    parser.add_argument("--minutes", type=float, default=30.0, help="how long; default 30")
    parser.add_argument("--first", type=int, default=0, help="number of the first case; default 0")
    parser.add_argument("--count", type=int, default=None, help="cases; default as many as fit")
    given = parser.parse_args(words)
    if find_spec("pytest") is None:
        parser.error("expected pytest, with which cases are checked: pip install -e '.[test]'")
    campaign = Campaign(given.kind, given.first)
    with _listening(campaign) as folder, suppress(KeyboardInterrupt):
        ends = time.monotonic() + 60.0 * given.minutes
        (_go_on_elsewhere if given.kind == "files" else _go_on)(campaign, folder, ends, given.count)
    if campaign.is_stopped:
        print("Stopped by Ctrl-C.")
    print(campaign.last_line())
    return 1 if campaign.n_faults else 0


@contextmanager
def _listening(campaign: Campaign) -> Iterator[Path]:
    """Work in an empty folder that is removed, with Ctrl-C told to the campaign."""
    place, before = Path.cwd(), signal.signal(signal.SIGINT, campaign.stop)
    in_memory = IN_MEMORY if campaign.kind == "files" and os.access(IN_MEMORY, os.W_OK) else None
    try:
        with tempfile.TemporaryDirectory(dir=in_memory) as folder:
            os.chdir(folder)
            try:
                yield Path(folder)
            finally:
                os.chdir(place)
    finally:
        signal.signal(signal.SIGINT, before)


def _go_on(campaign: Campaign, folder: Path, ends: float, count: int | None) -> None:
    """Try one case after the other."""
    while campaign.goes_on(ends, count):
        campaign.take(*KINDS[campaign.kind](campaign.number, folder))


def _go_on_elsewhere(campaign: Campaign, folder: Path, ends: float, count: int | None) -> None:
    """Try one case after the other in another process; where a case ends it, a further one goes on behind that."""
    while campaign.goes_on(ends, count):
        receiver, sender = get_context("spawn").Pipe(duplex=False)
        about = (campaign.kind, campaign.number, folder, sender)
        process = get_context("spawn").Process(target=_make_cases, args=about, daemon=True)
        process.start()
        sender.close()
        try:
            while campaign.goes_on(ends, count):
                if not receiver.poll(MOST_SILENT_S):
                    campaign.take(Counter(), f"told nothing for {MOST_SILENT_S:g} s")
                    break
                campaign.take(*receiver.recv())
        except EOFError:
            process.join()
            errors = (folder / ERRORS).read_text(encoding="utf-8", errors="replace")
            campaign.take(Counter(), f"ended the process, with exit code {process.exitcode}\n{errors[-2000:]}")
        finally:
            process.kill()
            process.join()


def _make_cases(kind: str, first: int, folder: Path, sender: Connection) -> None:
    """Make cases within bounds, and send what came of each; their stderr goes to a file."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started this process hears it, and ends it
    signal.signal(signal.SIGPROF, _too_long)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, resource.getrlimit(resource.RLIMIT_AS)[1]))
    os.dup2(os.open(folder / ERRORS, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND), 2)
    os.chdir(folder)
    with suppress(BrokenPipeError):
        for number in numbers_from(first):
            sender.send(KINDS[kind](number, folder))


def _too_long(*_: object) -> None:
    raise TooLongError(f"took longer than {LIMIT_S} s of a core")


if __name__ == "__main__":
    sys.exit(main())
