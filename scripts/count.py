"""Count the house, room by room: lines and files of source and tests, words of docs, commands, options, public names.

    scripts/count                     this checkout
    scripts/count ../before .         two checkouts side by side

A room is what one question is answered by; the rooms stand in their order, those that import from others first. Lines
are lines of files, comments and blank ones included. Data, packed runs and shipped networks are not counted.
Commands, options and public names need the package to be imported, by this interpreter: where that fails they are "-".
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.table import Table

PACKAGE = "swarm_forage_env"
ROOMS = {
    "cli": (f"{PACKAGE}/cli",),
    "metrics/scoring": ("metrics/scoring",),
    "metrics/benchmark": ("metrics/benchmark",),
    "training": (f"{PACKAGE}/training",),
    "inspect, rendering": (f"{PACKAGE}/inspect", f"{PACKAGE}/rendering"),
    "studies, checks": (f"{PACKAGE}/studies", f"{PACKAGE}/checks"),
    "runs": (f"{PACKAGE}/runs",),
    "views": (f"{PACKAGE}/views",),
    "wrappers, env.py, __init__": (
        f"{PACKAGE}/wrappers",
        f"{PACKAGE}/env.py",
        f"{PACKAGE}/__init__.py",
        f"{PACKAGE}/__init__.pyi",
    ),
    "policies": (f"{PACKAGE}/policies",),
    "baselines": ("baselines",),
    "world": (f"{PACKAGE}/world",),
    "contract, scenarios, _internal": tuple(f"{PACKAGE}/{name}" for name in ("contract", "scenarios", "_internal")),
    "metrics (formulas, claims)": ("metrics",),
    "scripts, .ci/run": ("scripts", ".ci/run"),
}
"""Room -> its places; a file belongs to the first room that has it, and what no room has is "elsewhere"."""
PAGES = "pages (js, css, html)"
SURFACE = """
from swarm_forage_env.cli.app import made
import metrics, swarm_forage_env
def below(app):
    return [app, *(one for name in app if name[0] != "-" for one in below(app[name]))]
commands = [app for app in below(made()) if app.default_command is not None]
arguments = [one for app in commands for one in app.assemble_argument_collection() if not one.children]
options = [one.names[0] for one in arguments if one.names[0].startswith("--")]
print(len(commands), len(options), len(set(options)), len(swarm_forage_env.__all__) + len(metrics.__all__))
"""
SURFACE_NAMES = ("commands", "options", "distinct names of options", "public names of the two packages")


def tracked(root: Path) -> list[str]:
    """Return the files of a checkout that git knows and that are there."""
    listed = subprocess.run(["git", "-C", str(root), "ls-files"], capture_output=True, text=True, check=True).stdout
    return [name for name in listed.splitlines() if (root / name).is_file()]


def room_of(name: str) -> str | None:
    """Return the room of a file of source; None for all other files."""
    if name.startswith(f"{PACKAGE}/") and name.endswith((".js", ".css", ".html")):
        return PAGES
    is_script = name == ".ci/run" or (name.startswith("scripts/") and "." not in Path(name).name)
    top = name.partition("/")[0]
    if not is_script and not (name.endswith((".py", ".pyi")) and top in (PACKAGE, "baselines", "metrics", "scripts")):
        return None
    places = ((room, place) for room, those in ROOMS.items() for place in those)
    return next((room for room, place in places if name == place or name.startswith(f"{place}/")), "elsewhere")


def lines_and_files(root: Path, names: list[str]) -> str:
    """Return how many lines so many files have, in words."""
    n_lines = sum(len((root / name).read_text(encoding="utf-8").splitlines()) for name in names)
    return f"{n_lines:,} in {len(names)}"


def counted(root: Path) -> Iterator[tuple[str, str]]:
    """Yield what is counted of a checkout, as names and numbers."""
    names = tracked(root)
    rooms: dict[str, list[str]] = {room: [] for room in (*ROOMS, PAGES, "elsewhere")}
    for name in names:
        if room := room_of(name):
            rooms[room].append(name)
    for room, own in rooms.items():
        yield room, lines_and_files(root, own)
    yield "all source", lines_and_files(root, [name for own in rooms.values() for name in own])
    yield "tests", lines_and_files(root, [name for name in names if re.fullmatch(r"tests/.*\.py", name)])
    pages = [name for name in names if re.fullmatch(r"(docs|paper)/.*\.md|[^/]+\.md", name)]
    n_words = sum(len((root / name).read_text(encoding="utf-8").split()) for name in pages)
    yield "docs and root pages, words", f"{n_words:,} in {len(pages)}"
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    ask = subprocess.run([sys.executable, "-c", SURFACE], cwd=root, env=environment, capture_output=True, check=False)
    found = ask.stdout.decode().split() if ask.returncode == 0 else ["-"] * len(SURFACE_NAMES)
    yield from zip(SURFACE_NAMES, found, strict=True)


def main() -> None:
    """Print the table, a column for each checkout."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    here = Path(__file__).resolve().parent.parent
    parser.add_argument("folders", nargs="*", type=Path, default=[here], metavar="FOLDER", help="default this checkout")
    folders = [folder.resolve() for folder in parser.parse_args().folders]
    for folder in folders:
        if not (folder / PACKAGE / "__init__.py").is_file():
            parser.error(f"expected the folder of a checkout of this project, got {folder}")
    table = Table("room: lines in files", *(folder.name for folder in folders))
    columns = [dict(counted(folder)) for folder in folders]
    for name in columns[0]:
        table.add_row(name, *(column[name] for column in columns))
    Console().print(table)


if __name__ == "__main__":
    main()
