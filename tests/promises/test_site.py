"""The pages of public names are complete, notebooks hold what they print; scripts/build_docs runs them."""

import json
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LISTED = [
    name
    for page in (ROOT / "docs/api").glob("*.md")
    for row in re.findall(r"^\| (`.+?`) \|", page.read_text(), re.MULTILINE)
    for name in re.findall(r"`([\w.]+)`", row)
]


@pytest.mark.parametrize("package", ["swarm_forage_env", "metrics"])
def test_every_public_name_is_listed_once(package):
    names = [name.rpartition(".")[2] for name in LISTED]
    assert [name for name in import_module(package).__all__ if names.count(name) != 1] == []


@pytest.fixture(params=sorted((ROOT / "docs/notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def notebook(request):
    return json.loads(request.param.read_text(encoding="utf-8"))


def test_notebooks_hold_what_their_cells_print(notebook):
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert outputs
    assert {output["output_type"] for output in outputs} <= {"stream", "display_data", "execute_result"}, "no errors"
    assert {output.get("name", "stdout") for output in outputs} == {"stdout"}, "no warnings"
