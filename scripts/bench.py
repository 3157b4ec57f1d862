"""Measure speed: runs, environments for learners, pictures, the first run. Prints a table in Markdown.

    scripts/bench                             all cases; some minutes
    scripts/bench crw-200 dpo-200 --quick     some, in shorter measurements
    scripts/bench --against 860cf6a           in turn with another revision, or the folder of a checkout, as ratios

Times are processor time on one core, where nothing else is said. A value is the median of the rounds. A ratio is that
of one round, so that what else the machine does counts as little as possible; the table has the median, and the
smallest and the largest in brackets. Machines differ: compare within one table. A checkout is measured by its own
scripts/bench_cases.py where it has that.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

from bench_cases import CASES
from rich.console import Console

ROOT = Path(__file__).resolve().parents[1]
CASES_FILE = Path(__file__).with_name("bench_cases.py")
ALONE = {
    **dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
}
"""One thread per library."""


class BenchError(RuntimeError):
    """A case cannot be measured; the message is one line."""


def alone(folder: Path) -> dict[str, str]:
    """Return the environment of a process with the package of a folder, and with one thread per library."""
    return {**os.environ, **ALONE, "PYTHONPATH": str(folder)}


class Subject:
    """A process that measures cases."""

    def __init__(self, python: str | Path, program: Path, folder: Path) -> None:
        """Start it with the package of a folder, and with one thread per library."""
        self._process = subprocess.Popen(
            [str(python), str(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=folder,
            env=alone(folder),
        )

    def measure(self, case: str, engine: str, effort: float) -> float:
        """Return the value of a case; raises BenchError with the reason why there is none."""
        print(case, engine, effort, file=_pipe(self._process.stdin), flush=True)
        answer = _pipe(self._process.stdout).readline().strip()
        if not answer:
            raise BenchError(f"{case}: the process that measured it has ended with {self._process.wait()}")
        if answer.startswith("failed"):
            raise BenchError(f"{case}: {answer.removeprefix('failed ')}")
        return float(answer)

    def __enter__(self) -> "Subject":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()  # closes the pipes, too


def _pipe(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None, "asked for above"
    return pipe


@contextmanager
def checkout(against: str) -> Iterator[Path]:
    """Give the folder of a version; a revision is checked out for as long as the context lasts."""
    if Path(against).is_dir():
        yield Path(against).resolve()
        return
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "other"
        command = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*command, "add", "--quiet", "--detach", str(folder), against], check=True)
        try:
            yield folder
        finally:
            subprocess.run([*command, "remove", "--force", str(folder)], check=True)


def started(folder: Path, open_things: ExitStack) -> Subject:
    """Return what measures a checkout; raises BenchError where there is none."""
    if not (folder / "swarm_forage_env" / "__init__.py").is_file():
        raise BenchError(f"expected a revision or a checkout of this project, got {folder}")
    own = folder / "scripts" / CASES_FILE.name
    return open_things.enter_context(Subject(sys.executable, own if own.is_file() else CASES_FILE, folder))


Values = list[float]
"""Of one case, round by round."""


def measured(sides: Sequence[tuple[Subject, str]], engine: str, rounds: int, effort: float) -> list[Values]:
    """Return the values of cases that take turns, given with their subjects; raises BenchError."""
    turns = [[subject.measure(case, engine, effort) for subject, case in sides] for _ in range(rounds)]
    return [list(values) for values in zip(*turns, strict=True)]


def short(number: float) -> str:
    """Return a number with three digits that count: 1,637, 57.5, 0.86."""
    return f"{number:,.{max(0, 2 - len(str(int(number))) + 1)}f}"


def ratio(before: Values, after: Values) -> str:
    """Return median, smallest and largest quotient of two cases, round by round: "3.06 (2.46 to 3.14)"."""
    quotients = [one / other for one, other in zip(before, after, strict=False)]
    middle, low, high = statistics.median(quotients), min(quotients), max(quotients)
    return short(middle) if len(quotients) == 1 else f"{short(middle)} ({short(low)} to {short(high)})"


Rows = list[list[str]]
"""Of a table, its headings first."""


def rows_of_cases(names: Sequence[str], found: dict[str, list[Values]], *, against: bool) -> Rows:
    """Return the table of our cases, with the other version where there is one."""
    rows = [["case", "what", "value", "unit", "target", *(("other", "other : this") if against else ("beside",))]]
    for name in names:
        case, values = CASES[name], found.get(name, [])
        medians = [short(statistics.median(own)) for own in values] or ["-"]
        rows.append([name, case.about, medians[0], case.unit, case.target])
        if against:
            rows[-1] += [*medians[1:], ratio(values[1], values[0])] if values else ["-", "-"]
        else:
            told = values and case.beside in found
            rows[-1].append(f"{ratio(values[0], found[case.beside][0])} x {case.beside}" if told else "")
    return rows


def markdown(rows: Rows) -> str:
    """Return a table in Markdown, padded."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = [[cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in rows]
    lines = [f"| {' | '.join(row)} |" for row in padded]
    return "\n".join([lines[0], f"|{'|'.join('-' * (width + 2) for width in widths)}|", *lines[1:]])


def main() -> int:
    """Measure the cases and print the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"default all of: {', '.join(CASES)}")
    parser.add_argument("--against", metavar="REVISION", help="another revision, or the folder of a checkout")
    parser.add_argument("--physics", choices=("compiled", "chipmunk"), default="compiled", help="default compiled")
    parser.add_argument("--quick", action="store_true", help="three short rounds instead of seven whole ones")
    given = parser.parse_args()
    rounds, effort = (3, 0.2) if given.quick else (7, 1.0)
    names = given.cases or list(CASES)
    for name in names:
        if name not in CASES:
            parser.error(f"expected some of {', '.join(CASES)}, got {name!r}")
    found: dict[str, list[Values]] = {}
    failed: list[str] = []
    progress = Console(stderr=True)
    with ExitStack() as open_things:
        try:
            subjects = [started(ROOT, open_things)]
            if given.against:
                subjects.append(started(open_things.enter_context(checkout(given.against)), open_things))
        except (BenchError, subprocess.CalledProcessError) as error:
            parser.error(str(error))
        try:
            for name in names:
                try:
                    sides = [(subject, name) for subject in subjects]
                    found[name] = measured(sides, given.physics, 1 if CASES[name].once else rounds, effort)
                    progress.print(name, *(short(statistics.median(values)) for values in found[name]), style="dim")
                except BenchError as error:
                    failed.append(str(error))
        except KeyboardInterrupt:
            progress.print("Interrupted; these cases are done:")
    print(markdown(rows_of_cases(names, found, against=bool(given.against))))
    if failed:
        print("\n".join(failed), file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
