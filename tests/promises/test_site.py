"""The pages of public names are complete, notebooks hold no results; scripts/build_docs checks the rest."""

import json
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LISTED = [
    name
    for page in (ROOT / "docs/api").glob("*.md")
    for name in re.findall(r"^\.\. auto\w+:: ([\w.]+)$", page.read_text(), re.MULTILINE)
]


@pytest.mark.parametrize("package", ["swarm_forage_env", "metrics"])
def test_every_public_name_is_listed_once(package):
    names = [name.rpartition(".")[2] for name in LISTED]
    assert [name for name in import_module(package).__all__ if names.count(name) != 1] == []


@pytest.mark.parametrize("notebook", sorted((ROOT / "docs/notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebooks_are_stored_without_results(notebook):
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    assert cells
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
