"""Time this environment beside other packages, in turn on one core, and print a Markdown table.

    python scripts/bench_peers.py --venvs ../peers
    python scripts/bench_peers.py --venvs ../peers --only rware,magent2 --rounds 5

Each of the others gets a virtual environment of its own in the folder `--venvs`, with the version that is named here;
those that are there already are used again. This environment is timed with the Python that runs the script. A round
times the other package, ours in Chipmunk and ours with compiled bodies (`physics="compiled"`), each for `--seconds` of
processor time on one core. A ratio is our rate over that of the other in the same round; the table has the median of
the rounds, and their smallest and largest. Nothing learns: actions are random and drawn beforehand. A package that
cannot be installed or run is named below the tables, with the reason.
"""

import argparse
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from timed_process import TimedProcess, ratio_cell, short

CASES_FILE = Path(__file__).with_name("peer_cases.py")
CHIPMUNK, COMPILED = "ours-chipmunk", "ours-compiled"
HEADER = """\
| task of the other | agents | worlds | our arenas | other | Chipmunk | compiled | Chipmunk : other | compiled : other |
|---|--:|--:|--:|--:|--:|--:|--:|--:|"""
OURS = (
    "Continuous floor with walls. Discs with differential drive and gripper; rigid contact; objects to find, carry and "
    "deliver. 24 proximity, 24 light and 4 ground sensors, line of sight: 111 numbers. numba."
)
JAX_ALONE = {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false"}


@dataclass(frozen=True)
class Peer:
    """Another package, and the task of it that comes closest to ours."""

    title: str
    task: str
    simulates: str
    requirements: tuple[str, ...]
    """What pip installs, the package itself first."""
    agents: int = 50
    worlds: tuple[tuple[int, int], ...] = ((1, 1),)
    """Pairs to time: worlds of the other side by side, arenas of ours."""

    @property
    def folder(self) -> str:
        """Name of the virtual environment: that of the package."""
        return self.requirements[0].partition("==")[0]

    @property
    def label(self) -> str:
        """Package, version and task."""
        return f"{self.title} {self.requirements[0].partition('==')[2]}, {self.task}"


PEERS = {
    "vmas-discovery": Peer(
        "VMAS",
        "`discovery`",
        "Continuous floor, twice as wide as high. Discs driven by forces; contact by springs, every pair checked, "
        "2 substeps. A lidar of 15 rays finds 7 targets; 19 numbers are observed. torch, all worlds in one array.",
        ("vmas==1.5.2", "torch==2.13.0"),
        worlds=((1, 1), (512, 8)),
    ),
    "vmas-transport": Peer(
        "VMAS",
        "`transport`",
        "The same kind of discs; they push a heavy package to a goal. No sensors: each is told how it moves and where "
        "package and goal are, 11 numbers. torch, all worlds in one array.",
        ("vmas==1.5.2", "torch==2.13.0"),
        worlds=((1, 1), (512, 8)),
    ),
    "magent2": Peer(
        "MAgent2",
        "`gather_v5`",
        "Grid of 200 x 200 cells. Agents walk to free cells and strike food or each other; the dead leave. "
        "Each sees the 15 x 15 cells around it, 1,125 numbers. C++; used by its arrays, without PettingZoo's dicts.",
        ("magent2==0.3.4",),
        agents=495,
    ),
    "rware": Peer(
        "RWARE",
        "38 x 22 cells",
        "Grid. Robots turn, step to a free cell, lift and put down shelves; a graph decides who yields. "
        "Each sees the 3 x 3 cells around it, 71 numbers. Plain Python.",
        ("rware==2.0.0",),
    ),
    "camar": Peer(
        "CAMAR",
        "`random_grid`, no obstacles",
        "Continuous floor. Discs with differential drive between walls made of 160 discs; contact by springs, "
        "every pair checked, 3 substeps. Each sees its goal and the 3 nearest bodies, 8 numbers. jax.",
        ("camar==0.4.0",),
        worlds=((1, 1), (32, 8)),
    ),
    "jaxmarl": Peer(
        "JaxMARL",
        "`MPE_simple_spread_v3`",
        "Continuous plane without walls. Discs driven by forces; contact by springs, every pair checked. "
        "No sensors: each is told where all others are, 206 numbers. jax.",
        ("jaxmarl==0.2.0",),
        worlds=((1, 1), (32, 8)),
    ),
}


class PeerError(RuntimeError):
    """A package could not be installed or run; the message is one line."""


def install(name: str, folder: Path) -> Path:
    """Return the Python of a virtual environment that holds a package; raises PeerError."""
    home = folder / PEERS[name].folder
    python = home / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PEERS[name].requirements]
    for command in ([] if python.exists() else [[sys.executable, "-m", "venv", str(home)]]) + [pip]:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            said = (done.stderr or done.stdout).strip().splitlines() or ["no message"]
            raise PeerError(f"not installed: {said[-1]}")
    return python


class Worker(TimedProcess):
    """A process that times worlds with some Python."""

    def __init__(self, python: str | Path) -> None:
        super().__init__([str(python), str(CASES_FILE)], CASES_FILE.parents[1], JAX_ALONE)

    def rate(self, name: str, agents: int, worlds: int, seconds: float) -> float:
        """Return agent-steps per second of processor time; raises PeerError."""
        try:
            answer = self.ask(f"{name} {agents} {worlds} {seconds}")
        except RuntimeError as error:
            raise PeerError(f"not run: {error}") from error
        if answer.startswith("failed"):
            raise PeerError(f"not run: {answer.removeprefix('failed ')}")
        return float(answer)


def rows(name: str, folder: Path, ours: Worker, rounds: int, seconds: float) -> Iterator[str]:
    """Yield the lines of a package; raises PeerError."""
    peer = PEERS[name]
    other = Worker(install(name, folder))
    try:
        for worlds, arenas in peer.worlds:
            measured = [
                {
                    name: other.rate(name, peer.agents, worlds, seconds),
                    CHIPMUNK: ours.rate(CHIPMUNK, peer.agents, arenas, seconds),
                    COMPILED: ours.rate(COMPILED, peer.agents, arenas, seconds),
                }
                for _ in range(rounds)
            ]
            yield row(name, worlds, arenas, measured)
    finally:
        other.close()


def row(name: str, worlds: int, arenas: int, rounds: Sequence[dict[str, float]]) -> str:
    """Return the line of a package with so many worlds, beside so many arenas of ours."""
    peer = PEERS[name]
    medians = [statistics.median(rates[who] for rates in rounds) / 1000 for who in (name, CHIPMUNK, COMPILED)]
    cells = [peer.label, str(peer.agents), str(worlds), str(arenas), *map(short, medians)]
    cells += [ratio_cell([rates[engine] / rates[name] for rates in rounds]) for engine in (CHIPMUNK, COMPILED)]
    return f"| {' | '.join(cells)} |"


def names(text: str) -> list[str]:
    """Read names of packages, separated by commas."""
    chosen = text.split(",")
    for name in chosen:
        if name not in PEERS:
            raise argparse.ArgumentTypeError(f"expected some of {', '.join(PEERS)}, got {name!r}")
    return chosen


def positive(kind: Callable[[str], float]) -> Callable[[str], float]:
    """Return what reads numbers of a kind above 0."""

    def read(text: str) -> float:
        number = kind(text)
        if number <= 0:
            raise argparse.ArgumentTypeError(f"expected a number above 0, got {text}")
        return number

    return read


def pin() -> None:
    """Keep this process and those that it starts on one core, where the system can do that."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def main() -> None:
    """Time all packages and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--venvs", required=True, type=Path, help="folder for the virtual environments")
    parser.add_argument("--only", type=names, default=list(PEERS), help="packages, separated by commas; default all")
    parser.add_argument("--rounds", type=positive(int), default=3, help="rounds (default 3)")
    parser.add_argument("--seconds", type=positive(float), default=2.0, help="of work per measurement (default 2)")
    chosen = parser.parse_args()
    folder = chosen.venvs.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    pin()
    done: list[str] = []
    failed: list[str] = []
    ours = Worker(sys.executable)
    try:
        with Progress(console=Console(stderr=True)) as progress:
            for name in progress.track(chosen.only, description="packages"):
                try:
                    for line in rows(name, folder, ours, chosen.rounds, chosen.seconds):
                        done.append(line)
                        progress.console.print(line, style="dim", soft_wrap=True)
                except PeerError as error:
                    failed.append(f"{PEERS[name].label}: {error}")
    except KeyboardInterrupt:
        print("Interrupted; these packages are done:", file=sys.stderr)
    finally:
        ours.close()
    print(HEADER)
    print("\n".join(done))
    print("\n| task | what it simulates |")
    print("|---|---|")
    print(f"| this package, `warehouse_small` | {OURS} |")
    print("\n".join(f"| {PEERS[name].title}, {PEERS[name].task} | {PEERS[name].simulates} |" for name in chosen.only))
    if failed:
        print("\n" + "\n".join(failed))


if __name__ == "__main__":
    main()
