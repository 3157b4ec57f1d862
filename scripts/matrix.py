"""A run and a short part of the tests under every supported Python, with the oldest and the newest dependencies.

    scripts/matrix                    all that is installed here; prints a table and writes it into docs/versions.md
    scripts/matrix --python 3.12      one Python only; others keep their rows in the page
    scripts/matrix --dry-run          say what would be run

A Python is found as python3.X on PATH. "oldest" takes numpy, gymnasium and pettingzoo at the lowest version that
pyproject.toml allows and that has a wheel for this Python, all three at once; "newest" takes what pip finds. Each pair
gets a fresh environment in a temporary folder. A minute or two each, most of it for installing and compiling.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/versions.md"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
VARIED = ("numpy", "gymnasium", "pettingzoo")
SHOWN = (*VARIED, "numba")
ENDS = ("oldest", "newest")
TESTS = ("tests/contract", "tests/scenarios", "tests/promises/test_packaging.py")
RUN = ("run", "crw", "--scenario", "warehouse_small", "--robots", "10", "--horizon", "200", "--seeds", "1")
BLOCK = re.compile(r"(<!-- table by scripts/matrix -->\n).*?(<!-- end of table -->)", re.DOTALL)
HEADINGS = ("Python", "dependencies", *SHOWN, "a run", "tests", "on")


def lower_bounds() -> dict[str, str]:
    """Return the lowest version that pyproject.toml allows of each package that is varied."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bounds = dict(requirement.split(">=") for requirement in project["dependencies"])
    return {name: bounds[name] for name in VARIED}


def at_least(version: str, bound: str) -> bool:
    """Return whether a version such as "2.0.2" is not below a bound such as "2.0"."""
    numbers = [[int(part) for part in text.split(".")] for text in (version, bound)]
    return numbers[0] >= numbers[1]


def oldest(pip: Sequence[str], name: str, bound: str) -> str:
    """Return the lowest version from `bound` on that has a wheel for the Python of `pip`."""
    listed = subprocess.run([*pip, "index", "versions", name], capture_output=True, text=True, check=True).stdout
    versions = re.search(r"Available versions: (.+)", listed)
    found = re.findall(r"(?<![\w.])\d+(?:\.\d+)+(?![\w.])", versions[1] if versions else "")
    # pip lists versions that come as sources only, too.
    install = [*pip, "install", "--quiet", "--dry-run", "--no-deps", "--only-binary=:all:"]
    return next(
        version
        for version in reversed(found)
        if at_least(version, bound)
        and not subprocess.run([*install, f"{name}=={version}"], capture_output=True, check=False).returncode
    )


def call(words: Sequence[str], folder: Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command with a cache of kernels of its own; shows what it said if it failed."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout, done.stderr, sep="\n", file=sys.stderr)
    return done


def run_pair(python: str, end: str, folder: Path) -> list[str]:
    """Install and test in a fresh environment; returns the cells of the row behind the first two."""
    subprocess.run([f"python{python}", "-m", "venv", str(folder)], check=True)
    interpreter = str(folder / "bin/python")
    pip = [interpreter, "-m", "pip"]
    pins: list[str] = []
    if end == "oldest":
        pins = [f"{name}=={oldest(pip, name, bound)}" for name, bound in lower_bounds().items()]
    constraints = folder / "constraints.txt"
    constraints.write_text("\n".join(pins), encoding="utf-8")
    words = ["--only-binary=:all:", "--constraint", str(constraints), "-e", f"{ROOT}[test]"]
    if call([*pip, "install", "--quiet", *words], folder, folder).returncode:
        asked = [pin.split("==")[1] for pin in pins] or ["newest"] * len(VARIED)
        return [*asked, "-", "-", "cannot be installed"]
    code = f"from importlib.metadata import version; print(*map(version, {SHOWN}))"
    versions = call([interpreter, "-c", code], folder, folder).stdout.split()
    ran = call([str(folder / "bin/swarm-forage"), *RUN], folder, folder)
    tested = call([interpreter, "-m", "pytest", "-q", "-p", "no:cacheprovider", *TESTS], folder, ROOT)
    summary = re.sub(r" in [\d.]+s.*|=", "", tested.stdout.strip().splitlines()[-1]).strip()
    return [*versions, "failed" if ran.returncode else "done", summary]


def rows_of_page(text: str) -> dict[tuple[str, str], list[str]]:
    """Return the rows that the page has already, by Python and dependencies."""
    found = BLOCK.search(text)
    lines = found[0].splitlines() if found else []
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| 3.")]
    return {(row[0], row[1]): row[2:] for row in cells}


def table(rows: dict[tuple[str, str], list[str]]) -> str:
    """Return the rows as a table, in the order of Pythons, and what has no row."""
    ordered = [(python, end) for python in PYTHONS for end in ENDS]
    lines = [HEADINGS, ["---"] * len(HEADINGS), *([*pair, *rows[pair]] for pair in ordered if pair in rows)]
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    missing = [f"Python {python}, {end}" for python, end in ordered if (python, end) not in rows]
    return f"{text}\n\nNot run yet: {'; '.join(missing) or 'nothing'}.\n"


def write_row(pair: tuple[str, str], cells: list[str]) -> None:
    """Put one row into the page, at once: whoever stops the command keeps what is done."""
    text = PAGE.read_text(encoding="utf-8")
    made = table(rows_of_page(text) | {pair: cells})
    PAGE.write_text(BLOCK.sub(lambda found: found[1] + made + found[2], text), encoding="utf-8")


def main(words: Sequence[str] | None = None) -> int:
    """Do what the options say; returns 1 if a pair fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", nargs="+", choices=PYTHONS, default=PYTHONS, metavar="3.X", help=", ".join(PYTHONS))
    parser.add_argument("--dry-run", action="store_true", help="say what would be run")
    arguments = parser.parse_args(words)
    failed = False
    for python in arguments.python:
        program = shutil.which(f"python{python}")
        # A launcher may be there for a Python that is not.
        if program is None or subprocess.run([program, "-c", ""], capture_output=True, check=False).returncode:
            print(f"Python {python}: not installed, so not tried")
            continue
        for end in ENDS:
            print(f"Python {python}, {end}: {program}", flush=True)
            if arguments.dry_run:
                continue
            with tempfile.TemporaryDirectory() as folder:
                cells = run_pair(python, end, Path(folder))
            failed |= cells[-2] != "done" or not re.fullmatch(r"\d+ passed(, \d+ (skipped|deselected))*", cells[-1])
            write_row((python, end), [*cells, f"{datetime.now(UTC):%Y-%m-%d}"])
    if not arguments.dry_run:
        print(table(rows_of_page(PAGE.read_text(encoding="utf-8"))))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
