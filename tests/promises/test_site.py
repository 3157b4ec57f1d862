"""The pages of public names are complete, notebooks hold what they print; scripts/build_docs checks the rest."""

import json
import re
from importlib import import_module
from pathlib import Path

import pytest

from scripts import stored_notebooks

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


@pytest.fixture(params=sorted(stored_notebooks.FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def notebook(request):
    return json.loads(request.param.read_text(encoding="utf-8"))


def test_notebooks_hold_what_their_cells_print(notebook):
    cells = stored_notebooks.code_cells(notebook)
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert outputs
    assert {output["output_type"] for output in outputs} <= {"stream", "display_data", "execute_result"}, "no errors"
    assert {output.get("name", "stdout") for output in outputs} == {"stdout"}, "no warnings"
    assert notebook["metadata"]["stored"]["cells"] == stored_notebooks.digest(notebook), (
        "a cell has changed since its outputs were stored: scripts/build_docs --store-notebooks"
    )


def test_notebooks_hold_nothing_of_the_machine_that_executed_them(notebook):
    texts = [text for cell in stored_notebooks.printed(notebook) for text in cell]
    assert [text for text in texts if re.search(r"(^|[\s'\"(=])(/\w|~/|[A-Z]:\\)", text)] == []
    assert all(cell["metadata"] == {} for cell in notebook["cells"]), "no times"


def test_notebooks_are_small(notebook):
    assert len(json.dumps(notebook)) < 200_000, "characters, pictures included"


@pytest.fixture
def shown():
    """A notebook of two cells: as its file has it, and as it was executed."""
    picture = {"image/png": "iVBO", "image/jpeg": "/9j/", "text/plain": "<Figure>"}
    outputs = [
        {"output_type": "stream", "name": "stdout", "text": ["1\n"]},
        {"output_type": "execute_result", "execution_count": 7, "data": picture, "metadata": {"width": 9}},
    ]
    cell = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
    cells = [
        {"cell_type": "markdown", "source": ["# Two"]},
        {**cell, "source": ["print(1)"]},
        {**cell, "source": ["x"]},
    ]
    cells = [{**cell, "id": f"two-{number}"} for number, cell in enumerate(cells)]
    timed = {"execution": {"shell.execute_reply": "2026-11-25T12:00:00"}}
    executed = [{**cell, "metadata": timed} for cell in cells[1:]]
    executed[0]["outputs"] = [outputs[0], {**outputs[0], "text": ["the end of the first output, once more\n"]}]
    executed[1]["outputs"] = outputs[1:]
    return {"cells": cells, "metadata": {}}, {"cells": [cells[0], *executed], "metadata": {}}


def test_texts_and_pictures_are_stored_without_what_the_machine_adds(shown):
    markdown, *cells = stored_notebooks.stored(*shown)["cells"]
    assert markdown == shown[0]["cells"][0]
    assert [cell["metadata"] for cell in cells] == [{}, {}]
    assert [cell["execution_count"] for cell in cells] == [1, 2]
    assert cells[0]["outputs"] == [{"output_type": "stream", "name": "stdout", "text": ["1\n"]}]
    data = {"text/plain": "<Figure>", "image/png": "iVBO"}
    assert cells[1]["outputs"] == [
        {"output_type": "execute_result", "execution_count": 2, "data": data, "metadata": {}}
    ]


def test_other_texts_than_the_stored_are_named_by_their_cell(shown):
    kept = stored_notebooks.stored(*shown)
    shown[1]["cells"][1]["outputs"][0]["text"] = ["1\n", "\n"]
    assert stored_notebooks.differences(kept, shown[1]) == []
    shown[1]["cells"][1]["outputs"][0]["text"] = ["2\n"]
    assert stored_notebooks.differences(kept, shown[1]) == ["two-1"]
    kept["metadata"]["stored"]["made_with"] = {"numpy": "0.1"}
    assert stored_notebooks.differences(kept, shown[1]) == [], "other versions"


def test_outputs_of_other_cells_are_not_stored(shown):
    shown[1]["cells"][1]["source"] = ["print(2)"]
    with pytest.raises(ValueError, match="same cells"):
        stored_notebooks.stored(*shown)
