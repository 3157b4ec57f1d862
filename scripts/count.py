"""Count the house: what a reader has to know, as numbers.

    scripts/count                     this checkout
    scripts/count ../before .         two checkouts side by side, then each folder by folder

Python source is what lies in the packages, with stubs, and in scripts/, without tests. A line of code is one that is
not blank and holds more than a comment or a docstring. An arrow is an import, wherever in a file it stands: from one
file to another, or from one folder to another, each pair counted once. Only commands and options, without hidden ones,
need the package to be imported, by this interpreter: where that fails they are a dash.
"""

import argparse
import ast
import io
import os
import subprocess
import sys
import tokenize
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

PACKAGES = ("swarm_forage_env", "baselines", "metrics")
LONG, SHORT = (500, 300), (100, 50)
"""Lengths of files, in lines: over and under so many."""
COMMANDS = """
def walk(command):
    for each in getattr(command, "commands", {}).values():
        if not each.hidden:
            yield from walk(each) if hasattr(each, "commands") else [each]
try:
    from swarm_forage_env.cli.commands import COMMANDS
except ImportError:  # an earlier checkout
    import typer
    from swarm_forage_env.cli.app import app
    commands = list(walk(typer.main.get_command(app)))
else:
    from swarm_forage_env.cli.app import loaded
    commands = [loaded(each) for group in COMMANDS.values() for each in group if each.place]
shown = [one for command in commands for one in command.params if not getattr(one, "hidden", False)]
words = [option.opts[0] for option in shown]
options = [word for word in words if word.startswith("-") and word != "--help"]
print(len(commands), len(words), len(options), len(set(options)))
"""
"""Prints how many commands, parameters, options and distinct names of options --help shows."""
NO_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


@dataclass(frozen=True)
class SourceFile:
    """What one file of Python holds."""

    path: Path
    """From the root of the checkout."""
    lines: int
    code: int
    classes: int
    dataclasses: int
    functions: int
    imports: frozenset[str]
    """Dotted names that it imports, those of single objects included."""

    @property
    def module(self) -> str:
        """Its dotted name; that of a folder for an `__init__.py`."""
        return ".".join(self.path.with_suffix("").parts).removesuffix(".__init__")

    @property
    def folder(self) -> str:
        """The folder it belongs to in the tables: two levels of the packages, one of all else."""
        parts = self.path.parts[:-1]
        return "/".join(parts[:2] if parts[0] in PACKAGES else parts[:1])


def read(path: Path, root: Path) -> SourceFile:
    """Count one file."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    nodes = list(ast.walk(tree))
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    place = path.relative_to(root)
    return SourceFile(
        path=place,
        lines=len(source.splitlines()),
        code=len(_lines_of_code(source, nodes)),
        classes=len(classes),
        dataclasses=sum(any("dataclass" in ast.unparse(mark) for mark in node.decorator_list) for node in classes),
        functions=sum(isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) for node in nodes),
        imports=frozenset(_imports(nodes, place)),
    )


def _lines_of_code(source: str, nodes: list[ast.AST]) -> set[int]:
    texts: set[int] = set()
    for node in nodes:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            texts.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    return lines - texts


def _imports(nodes: list[ast.AST], place: Path) -> Iterator[str]:
    """Yield dotted names, relative ones made whole."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = [".".join(place.parts[: len(place.parts) - node.level])] if node.level else []
            start = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{start}.{alias.name}" for alias in node.names)


@dataclass
class House:
    """All counted files of a checkout."""

    root: Path
    files: list[SourceFile] = field(default_factory=list)
    tests: list[SourceFile] = field(default_factory=list)

    @classmethod
    def of(cls, root: Path) -> "House":
        """Read a checkout.

        Raises:
            FileNotFoundError: the folder holds no such package.
        """
        if not (root / "swarm_forage_env" / "__init__.py").is_file():
            raise FileNotFoundError(f"Expected the folder of a checkout of this project, got {root}.")
        files = [
            [read(path, root) for path in _python_files(root, names)] for names in ((*PACKAGES, "scripts"), ["tests"])
        ]
        return cls(root, *files)

    def arrows(self) -> set[tuple[str, str]]:
        """Return the pairs of modules of which the first imports the second."""
        modules = {file.module for file in self.files}
        found: set[tuple[str, str]] = set()
        for file in self.files:
            for name in file.imports:
                target = name if name in modules else name.rpartition(".")[0]
                if target in modules and target != file.module:
                    found.add((file.module, target))
        return found

    def arrows_of_folders(self) -> set[tuple[str, str]]:
        """Return the pairs of folders of which the first imports something of the second."""
        folders = {file.module: file.folder for file in self.files}
        pairs = {(folders[start], folders[end]) for start, end in self.arrows()}
        return {(start, end) for start, end in pairs if start != end}

    def lines_of_shell(self) -> int:
        """Return the lines of the scripts that are not Python."""
        texts = [
            path.read_text(encoding="utf-8")
            for path in [*self.root.glob("scripts/*"), self.root / ".ci/run"]
            if path.is_file()
        ]
        return sum(len(text.splitlines()) for text in texts if text.startswith("#!/usr/bin/env bash"))

    def commands(self) -> list[str]:
        """Return the numbers of commands, parameters, options and names of options, as they are printed."""
        environment = {**os.environ, "PYTHONPATH": str(self.root), "PYTHONDONTWRITEBYTECODE": "1"}
        run = subprocess.run(
            [sys.executable, "-c", COMMANDS],
            cwd=self.root,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return run.stdout.split() if run.returncode == 0 else ["-"] * 4


def _python_files(root: Path, folders: tuple[str, ...] | list[str]) -> list[Path]:
    return [
        path for folder in folders for path in sorted((root / folder).rglob("*.py*")) if path.suffix in (".py", ".pyi")
    ]


def totals(house: House) -> Mapping[str, str]:
    """Return what is counted over the whole house, by name."""
    files, between = house.files, house.arrows()
    folders = {file.module: file.folder for file in files}
    across = sum(folders[start] != folders[end] for start, end in between)
    commands, parameters, options, names = house.commands()
    return {
        "files": f"{len(files):,}",
        "lines": f"{sum(file.lines for file in files):,}",
        "lines of code": f"{sum(file.code for file in files):,}",
        "lines, packages alone": f"{sum(file.lines for file in files if file.folder != 'scripts'):,}",
        "classes": f"{sum(file.classes for file in files):,}",
        "of these dataclasses": f"{sum(file.dataclasses for file in files):,}",
        "functions and methods": f"{sum(file.functions for file in files):,}",
        "arrows between folders": f"{len(house.arrows_of_folders()):,}",
        "arrows between files": f"{len(between):,}",
        "of these across folders": f"{across:,}",
        "commands": commands,
        "their arguments and options": parameters,
        "options alone": options,
        "distinct names of options": names,
        **{f"files over {length} lines": str(sum(file.lines > length for file in files)) for length in LONG},
        **{f"files under {length} lines": str(sum(file.lines < length for file in files)) for length in SHORT},
        "shell scripts: lines": f"{house.lines_of_shell():,}",
        "tests: files": f"{len(house.tests):,}",
        "tests: lines": f"{sum(file.lines for file in house.tests):,}",
    }


def by_folder(house: House) -> Table:
    """Return the table of folders, one row each."""
    table = Table(title=str(house.root))
    for heading in (
        "folder",
        "files",
        "lines",
        "code",
        "classes",
        "dataclasses",
        "functions",
        "imports of",
        "imported by",
    ):
        table.add_column(heading, justify="left" if heading == "folder" else "right")
    arrows = house.arrows_of_folders()
    for folder in sorted({file.folder for file in house.files}):
        own = [file for file in house.files if file.folder == folder]
        sums = (
            sum(getattr(file, name) for file in own)
            for name in ("lines", "code", "classes", "dataclasses", "functions")
        )
        ends = sum(start == folder for start, _ in arrows), sum(end == folder for _, end in arrows)
        table.add_row(folder, *(f"{number:,}" for number in (len(own), *sums, *ends)))
    return table


def main() -> None:
    """Print the totals of all folders side by side, then each folder by folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    here = Path(__file__).resolve().parent.parent
    parser.add_argument("folders", nargs="*", type=Path, default=[here], metavar="FOLDER", help="default this checkout")
    try:
        houses = [House.of(folder.resolve()) for folder in parser.parse_args().folders]
    except FileNotFoundError as error:
        parser.error(str(error))
    table = Table()
    table.add_column("")
    for house in houses:
        table.add_column(house.root.name, justify="right")
    counted = [totals(house) for house in houses]
    for name in counted[0]:
        table.add_row(name, *(own[name] for own in counted))
    console = Console(width=140)
    console.print(table)
    for house in houses:
        console.print(by_folder(house))


if __name__ == "__main__":
    main()
