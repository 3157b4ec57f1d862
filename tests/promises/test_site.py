"""The pages of public names are complete; Sphinx itself checks the rest, in scripts/build_docs."""

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
