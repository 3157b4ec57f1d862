"""Public names of a package, read from the stub that says where they are."""

import ast
from pathlib import Path
from types import ModuleType


def homes_of(package: ModuleType) -> dict[str, str]:
    """Name -> module that defines it, relative to the package."""
    tree = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text())
    return {
        alias.name: node.module or "" for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
