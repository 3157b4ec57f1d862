"""croissant.json tells of a data set what is there, in the words of the specification."""

import json
import shutil

import numpy as np
import pytest

from swarm_forage_env import plan_run, scenario
from swarm_forage_env.training.datasets import recording
from swarm_forage_env.training.datasets.croissant import describe_dataset
from swarm_forage_env.training.datasets.layout import DatasetError, chunk_file, summary_file
from swarm_forage_env.training.datasets.reading import TrajectoryDataset
from swarm_forage_env.training.datasets.recording import plan_dataset, record_dataset
from tests.support.croissant import faults, metadata

WORLD = scenario("warehouse_small", n_robots=4, n_objects=400, horizon_s=20.0, interval_s=20.0, physics="compiled")


def record(folder, policy="crw", seeds=(3, 4), **choices):
    record_dataset(plan_dataset(plan_run(WORLD, policy), seeds, **choices), folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two runs of a scripted policy, of several chunks each."""
    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "CHUNK_BYTES", 60_000)
        record(folder)
    return folder


@pytest.fixture
def copied(recorded, tmp_path):
    return shutil.copytree(recorded, tmp_path / "copied")


def field(folder, name):
    """A field by its place, such as "decisions/actions"."""
    of_set = next(one for one in metadata(folder)["recordSet"] if one["@id"] == name.split("/")[0])
    return next(one for one in of_set["field"] if one["@id"] == name)


@pytest.mark.parametrize("choices", [{}, {"observation": "compact", "site_memory": True}])
@pytest.mark.parametrize("policy", ["crw", "ppo_warehouse_small"])
def test_the_metadata_keep_the_specification_and_tell_what_is_there(policy, choices, tmp_path):
    record(tmp_path, policy, **choices)
    assert faults(tmp_path) == []
    card = TrajectoryDataset(tmp_path).card
    columns = metadata(tmp_path)["recordSet"][2]["data"]
    assert [one["columns/name"] for one in columns for _ in range(one["columns/size"])] == list(card.columns)
    assert [one["columns/first"] for one in columns] == [card.columns.index(one["columns/name"]) for one in columns]
    assert all(len(one["columns/scale"]) == one["columns/size"] for one in columns)


def test_every_file_of_the_data_is_there_with_its_digest(recorded):
    told = {node["contentUrl"] for node in metadata(recorded)["distribution"] if "contentUrl" in node}
    assert told == {file.name for file in recorded.iterdir()} - {"croissant.json"}
    assert len(list(recorded.glob("*.npz"))) > 2
    assert faults(recorded) == []


def test_shapes_and_actions_are_those_of_the_policy(recorded, tmp_path):
    assert field(recorded, "decisions/actions")["arrayShape"] == "-1,4,3"
    assert "left wheel, right wheel, gripper." in field(recorded, "decisions/actions")["description"]
    record(tmp_path, "ppo_warehouse_small")
    actions = field(tmp_path, "decisions/actions")
    assert (actions["dataType"], actions["arrayShape"]) == ("cr:Int64", "-1,4")
    assert actions["description"].startswith("Which of 6 actions")


def dropped(name):
    return lambda content: content.pop(name)


def in_set(number, **told):
    """Change the last field of a record set, or its source."""

    def change(content):
        field = content["recordSet"][number]["field"][-1]
        (field["source"] if {*told} <= {"extract", "fileSet"} else field).update(told)

    return change


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (dropped("license"), "no license"),
        (lambda content: content.update(colour="red"), "unknown word colour"),
        (lambda content: content["@context"].pop("isArray"), "unknown word isArray"),
        (lambda content: content["distribution"][1].update(sha256="0" * 64), "seed_000003.json"),
        (lambda content: content["distribution"][-1].update(includes=["*.parquet"]), "no files ['*.parquet']"),
        (in_set(0, extract={"jsonPath": "$.x"}), "runs/first_picked in seed_000003.json"),
        (in_set(0, dataType="sc:Text"), "runs/first_picked in seed_000004.json"),
        (in_set(1, extract={"column": "x"}), "decisions/active in seed_000003_0000.npz"),
        (in_set(1, dataType="cr:Float32"), "decisions/active in seed_000003_0000.npz"),
        (in_set(1, arrayShape="-1,5"), "decisions/active in seed_000004_0001.npz"),
        (in_set(1, fileSet={"@id": "x"}), "no x"),
    ],
)
def test_what_is_not_true_is_noticed(copied, change, fault):
    """Of the tests above: that they can fail."""
    content = metadata(copied)
    change(content)
    (copied / "croissant.json").write_text(json.dumps(content), encoding="utf-8")
    assert fault in faults(copied)


def test_who_publishes_says_what_only_they_know(copied):
    person = {"@type": "Person", "name": "Ada Lovelace"}
    usual = metadata(copied)
    assert usual["creator"]["name"] == "The swarm_forage_env developers"
    assert usual["license"] == "https://spdx.org/licenses/MIT"
    file = describe_dataset(copied, creator=person, license="https://spdx.org/licenses/CC-BY-4.0", url="https://a.org")
    told = metadata(copied)
    assert file == copied / "croissant.json"
    assert (told["creator"], told["url"]) == (person, "https://a.org")
    assert told["license"].endswith("CC-BY-4.0")
    assert {**told, **{name: usual[name] for name in ("creator", "license", "url")}} == usual
    describe_dataset(copied)  # as recording more runs does
    assert metadata(copied) == told


def test_the_day_stays_until_something_else_changes(copied):
    def written_on(day, **about):
        content = metadata(copied)
        (copied / "croissant.json").write_text(json.dumps(content | {"datePublished": day}), encoding="utf-8")
        describe_dataset(copied, **about)
        return metadata(copied)["datePublished"]

    assert written_on("2001-02-03") == "2001-02-03"
    assert written_on("2001-02-03", version="1.1.0") > "2026"
    assert written_on("2001-02-03", datePublished="2026-12-24") == "2026-12-24"
    (copied / "croissant.json").write_text("[", encoding="utf-8")
    describe_dataset(copied)
    assert faults(copied) == []


def test_more_runs_are_described_too(copied):
    record(copied, seeds=(3, 4, 5))
    assert faults(copied) == []
    assert "3 runs" in metadata(copied)["description"]
    summary_file(copied, 3).unlink()
    describe_dataset(copied)
    names = [node["@id"] for node in metadata(copied)["distribution"]]
    assert "2 runs" in metadata(copied)["description"]
    assert chunk_file(copied, 3, 0).name not in names


def test_what_cannot_be_described_is_refused(copied):
    card = json.loads((copied / "dataset.json").read_text())
    (copied / "dataset.json").write_text(json.dumps(card | {"columns": [*card["columns"][:-1], "smell"]}))
    with pytest.raises(DatasetError, match="columns of this version"):
        describe_dataset(copied)
    for seed in (3, 4):
        summary_file(copied, seed).unlink()
    with pytest.raises(DatasetError, match="whole, found none"):
        describe_dataset(copied)


def test_metadata_are_no_part_of_the_data(copied):
    before = TrajectoryDataset(copied).transitions()
    (copied / "croissant.json").unlink()
    np.testing.assert_array_equal(TrajectoryDataset(copied).transitions().observations, before.observations)
