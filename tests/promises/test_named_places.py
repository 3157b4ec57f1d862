"""Docstrings, comments and pages name modules, their contents and files that exist."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("swarm_forage_env", "baselines", "metrics")
SOURCES = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PAGES.remove(ROOT / "CHANGELOG.md")  # it tells of names that are no more
OTHERS = {"gymnasium", "pettingzoo", "env", "policy", "plan", "world", "scenarios", "interface", "training", "spec"}
"""Words that are also names of other packages, of arguments or of files that a run writes."""
DOTTED = re.compile(r"`([a-z_0-9]+(?:\.[A-Za-z_0-9]+)+)")
PATHS = re.compile(r"`?((?:swarm_forage_env|baselines|metrics|tests|scripts|docs)/[\w/.-]+\.(?:py|md|toml|npz|json))")


def names_in(file: Path) -> set[str]:
    """Names that a module defines or imports, whether at its top level or within."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


def modules() -> dict[str, list[Path]]:
    """Files by the last part of their module's name."""
    found: dict[str, list[Path]] = {}
    for file in SOURCES:
        name = file.parent.name if file.name == "__init__.py" else file.stem
        found.setdefault(name, []).append(file)
    return found


MODULES = modules()


def resolves(dotted: str) -> bool:
    """Whether `module.name` or `folder.module.name` is there; anything that begins with no module of ours is."""
    first, *rest = dotted.split(".")
    if first in OTHERS or first not in MODULES or rest[0] in ("py", "md", "toml", "npz", "json"):
        return True
    for file in MODULES[first]:
        if file.name == "__init__.py":
            inner = file.parent / f"{rest[0]}.py"
            if inner.is_file() and (len(rest) == 1 or rest[1] in names_in(inner)):
                return True
            if (file.parent / rest[0]).is_dir():
                return True
        if rest[0] in names_in(file):
            return True
    return False


@pytest.mark.parametrize("file", [*SOURCES, *PAGES], ids=lambda file: file.relative_to(ROOT).as_posix())
def test_names_of_modules_and_files_are_those_of_today(file):
    text = file.read_text()
    assert [name for name in DOTTED.findall(text) if not resolves(name)] == []
    assert [path for path in PATHS.findall(text) if not (ROOT / path).exists()] == []
