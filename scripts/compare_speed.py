"""Time this version against another one, in turn on one core, and print the ratios as a Markdown table.

    python scripts/compare_speed.py --against b02f59e
    python scripts/compare_speed.py --against b02f59e --only crw-50,crw-200 --repeats 9
    python scripts/compare_speed.py --against ../other-checkout

The other version is a revision of this repository or the folder of a checkout. A revision is checked out into a
temporary folder and compiled there, which takes some minutes. Each case is timed three times in a round: the other
version, this one in Chipmunk, this one with compiled bodies (`--set physics=compiled`). A ratio is the time of the
other version over the time of this one in the same round, so that what else the machine does counts as little as
possible; the table has the median of the rounds, and their smallest and largest.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from speed_cases import CASES, GOALS
from timed_process import TimedProcess, ratio_cell

ROOT = Path(__file__).resolve().parents[1]
CASES_FILE = Path(__file__).with_name("speed_cases.py")
HEADINGS = (
    "case",
    "other, µs per robot-tick",
    "this, Chipmunk",
    "this, compiled",
    "ratio, Chipmunk",
    "ratio, compiled",
    "wanted against 0.1.0",
)
OTHER, CHIPMUNK, COMPILED = "other", "chipmunk", "compiled"


class Version(TimedProcess):
    """A process that times cases with the package of one folder."""

    def __init__(self, folder: Path) -> None:
        """Start the process; raises FileNotFoundError where the folder holds no such package."""
        if not (folder / "swarm_forage_env" / "__init__.py").is_file():
            raise FileNotFoundError(f"Expected a checkout of this project, got {folder}.")
        super().__init__([sys.executable, str(CASES_FILE)], folder, {"PYTHONPATH": str(folder)})

    def time(self, case: str, engine: str) -> float:
        """Return microseconds per robot-tick."""
        return float(self.ask(f"{case} {engine}"))


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


def rounds_of(case: str, other: Version, this: Version, repeats: int) -> list[dict[str, float]]:
    """Return the times of a case, round by round."""
    return [
        {
            OTHER: other.time(case, CHIPMUNK),
            CHIPMUNK: this.time(case, CHIPMUNK),
            COMPILED: this.time(case, COMPILED),
        }
        for _ in range(repeats)
    ]


def row(case: str, rounds: Sequence[dict[str, float]]) -> str:
    """Return the line of a case."""
    cells = [case, *(f"{statistics.median(times[who] for times in rounds):.3g}" for who in (OTHER, CHIPMUNK, COMPILED))]
    ratios = {engine: [times[OTHER] / times[engine] for times in rounds] for engine in (CHIPMUNK, COMPILED)}
    cells += [ratio_cell(ratios[CHIPMUNK]), ratio_cell(ratios[COMPILED]), wanted(case, ratios[COMPILED])]
    return f"| {' | '.join(cells)} |"


def wanted(case: str, ratios: Sequence[float]) -> str:
    """Return the ratio that we want of a case, and whether the median reaches it; nothing where none is set."""
    if case not in GOALS:
        return ""
    return f"{GOALS[case]:g}, {'reached' if statistics.median(ratios) >= GOALS[case] else 'missed'}"


def cases(text: str) -> list[str]:
    """Read names of cases, separated by commas."""
    names = text.split(",")
    for name in names:
        if name not in CASES:
            raise argparse.ArgumentTypeError(f"expected some of {', '.join(CASES)}, got {name!r}")
    return names


def main() -> None:
    """Time all cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", required=True, help="a revision, or the folder of a checkout")
    parser.add_argument("--only", type=cases, default=list(CASES), help="cases, separated by commas; default all")
    parser.add_argument("--repeats", type=int, default=5, help="rounds (default 5)")
    chosen = parser.parse_args()
    rows = []
    try:
        with checkout(chosen.against) as folder, Progress(console=Console(stderr=True)) as progress:
            other, this = Version(folder), Version(ROOT)
            try:
                for case in progress.track(chosen.only, description="cases"):
                    rows.append(row(case, rounds_of(case, other, this, chosen.repeats)))
                    progress.console.print(rows[-1], style="dim", soft_wrap=True)
            finally:
                other.close()
                this.close()
    except (FileNotFoundError, RuntimeError, subprocess.CalledProcessError) as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        print("Interrupted; these cases are done:", file=sys.stderr)
    print(f"| {' | '.join(HEADINGS)} |")
    print(f"|---|{'--:|' * (len(HEADINGS) - 2)}---|")
    print("\n".join(rows))


if __name__ == "__main__":
    main()
