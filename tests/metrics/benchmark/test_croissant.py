"""The metadata of the published entries are those that the command writes, and tell what is in the entries."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, describe_entries, load_protocol, read_entry
from metrics.benchmark.board import entry_files
from metrics.benchmark.protocol import folder_of, protocol_versions
from tests.support.croissant import at_path, faults, metadata

PUBLISHED = Path(__file__).parents[3] / "docs/benchmark"


@pytest.fixture(params=protocol_versions())
def version(request):
    return request.param


@pytest.fixture
def copied(version, tmp_path):
    """The entries of a version, with their metadata, in a folder of their own."""
    for file in folder_of(version, PUBLISHED).glob("*.json"):
        shutil.copy(file, tmp_path)
    return tmp_path


def test_the_published_metadata_are_those_of_the_entries(version, copied):
    before = (copied / "croissant.json").read_bytes()
    describe_entries(copied)
    command = f"swarm-forage benchmark page {folder_of(version, Path('docs/benchmark'))}"
    assert (copied / "croissant.json").read_bytes() == before, command


def test_they_keep_the_specification_and_tell_what_is_there(version):
    folder = folder_of(version, PUBLISHED)
    assert faults(folder) == []
    files = [node["@id"] for node in metadata(folder)["distribution"] if node["@type"] == "cr:FileObject"]
    assert files == [file.name for file in entry_files([folder])]


def test_every_run_can_be_found_by_the_name_of_its_world(version):
    folder = folder_of(version, PUBLISHED)
    file = entry_files([folder])[0]
    entry, content = read_entry(file), json.loads(file.read_text(encoding="utf-8"))
    sets = {one["@id"]: one["field"] for one in metadata(folder)["recordSet"]}
    assert set(sets) == {"entries", "performance", "interference", "worlds"}
    for name in ("performance", "interference"):
        key, *fields = sets[name]
        assert key["name"] == "entry"
        assert [one["name"] for one in fields] == [world.name for world in load_protocol(version=version).worlds]
        for one in fields:
            found = at_path(content, one["source"]["extract"]["jsonPath"])
            np.testing.assert_array_equal(found, entry.runs[one["name"]][name])


def test_a_changed_entry_is_noticed(copied):
    file = entry_files([copied])[0]
    file.write_text(file.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert faults(copied) == [file.name]


def test_metadata_are_no_entry(copied):
    assert entry_files([copied])
    assert copied / "croissant.json" not in entry_files([copied])


def test_a_folder_without_entries_is_refused(tmp_path):
    (tmp_path / "croissant.json").write_text("{}")
    with pytest.raises(BenchmarkError, match="Expected entry files in"):
        describe_entries(tmp_path)
