"""What made a run: versions, and the commit."""

import ast
import sys
from pathlib import Path

import numpy as np

from swarm_forage_env.runs import versions
from swarm_forage_env.runs.versions import PACKAGES, VERSION_NAMES, software_versions


def test_versions_are_known_for_every_package():
    found = software_versions()
    assert set(PACKAGES) <= found.keys() <= set(VERSION_NAMES)
    assert found["numpy"] == np.__version__


IN_A_RUN = ("_internal", "contract", "scenarios", "world", "wrappers")
"""Folders of swarm_forage_env that every tick of a run may go through."""


def test_every_library_that_computes_in_a_run_is_in_its_record():
    package = Path(versions.__file__).parents[1]
    files = [file for folder in IN_A_RUN for file in (package / folder).rglob("*.py")]
    files += (package.parent / "baselines").rglob("*.py")
    imports = [node for file in files for node in ast.walk(_without_types(ast.parse(file.read_text())))]
    modules = {node.module for node in imports if isinstance(node, ast.ImportFrom) and node.level == 0}
    modules |= {alias.name for node in imports if isinstance(node, ast.Import) for alias in node.names}
    libraries = {module.split(".")[0] for module in modules} - sys.stdlib_module_names - {package.name}
    assert "numpy" in libraries
    assert libraries - {"msgspec"} <= set(PACKAGES), "msgspec reads configurations, and computes nothing"


def _without_types(tree):
    """What only a type checker imports computes nothing."""
    tree.body = [
        node for node in tree.body if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    ]
    return tree


def test_the_commit_is_absent_outside_a_checkout(tmp_path, monkeypatch):
    monkeypatch.setattr(versions, "__file__", str(tmp_path / "versions.py"))
    assert "commit" not in software_versions.__wrapped__()
