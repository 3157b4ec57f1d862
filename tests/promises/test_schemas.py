"""The schemas in docs/schemas are those of the code; they take files that the package writes, and no damaged ones."""

import copy
import json
import tomllib
from pathlib import Path

import polars as pl
import pytest

from scripts import write_schemas
from swarm_forage_env._internal.croissant import CROISSANT_FILE
from swarm_forage_env._internal.files import parse_json
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.files import write_replays
from swarm_forage_env.rendering.pages import take_replay_page_apart
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.robots import RobotKind
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.studies.study_table import gather_study
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support.tiny_study import NOBODY, RANDOM, tiny_study

jsonschema = pytest.importorskip("jsonschema", reason="needs the test extra: jsonschema")
ROOT = Path(__file__).resolve().parents[2]
SMALL = scenario(
    "warehouse_small",
    n_robots=4,
    n_objects=20,
    robot_kinds=(RobotKind(name="scout", share=0.5), RobotKind(name="hauler")),
    horizon_s=4.0,
    interval_s=2.0,
)
DISTURBED = tuple(
    map(
        parse_wrapper,
        (
            "population:malfunction_per_tick=0.1,repair_per_tick=0.02",
            "throttle:waveform=sine,amplitude=0.2,offset=0.2,period_s=40",
            "sensor_noise:sigma=0.02,sigmas.position=0.1",
        ),
    )
)


def from_parquet(file: Path) -> dict:
    """A record or a packed study as the document of its schema, as in docs/files.md; of a long one the first rows."""
    stamp = {
        name.rpartition(".")[2]: text for name, text in pl.read_parquet_metadata(file).items() if "swarm_forage" in name
    }
    stamp |= {name: json.loads(text) for name, text in stamp.items() if text[0] in "[{"}
    return {"metadata": stamp, "columns": pl.read_parquet(file, n_rows=2_000).to_dict(as_series=False)}


def from_page(file: Path) -> dict:
    return take_replay_page_apart(file.read_text(encoding="utf-8"))[0]


def from_toml(file: Path) -> dict:
    return tomllib.loads(file.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> dict[str, dict]:
    """One document for each schema, of what the package writes today."""
    folder = tmp_path_factory.mktemp("written")
    spec = plan_run(SMALL, "stochx", wrappers=DISTURBED)
    run_one(spec).write(folder / "run.parquet")
    write_replays(folder / "replay.html", record_replay(spec)[0])
    study = tiny_study(policies=(RANDOM, NOBODY))
    run_study(study, StudyFolder(folder / "study"), jobs=1)
    table = gather_study(StudyFolder(folder / "study"))
    table.write(folder / "study.parquet")
    return {
        "record": from_parquet(folder / "run.parquet"),
        "packed_study": from_parquet(folder / "study.parquet"),
        "study_file": from_toml(ROOT / "swarm_forage_env/studies/sets/S2a.toml"),
        "entry": parse_json((ROOT / "docs/benchmark/generalist.json").read_text(encoding="utf-8")),
        "replay": from_page(folder / "replay.html"),
    }


def refused(name: str, document: object) -> list[str]:
    """What the published schema has against a document."""
    schema = json.loads((ROOT / f"docs/schemas/{name}.schema.json").read_text(encoding="utf-8"))
    return [error.message for error in jsonschema.Draft202012Validator(schema).iter_errors(document)]


def test_published_schemas_are_those_of_the_code(tmp_path):
    assert write_schemas.main(["--out", str(tmp_path)]) == 0
    there = {file.name: file.read_text(encoding="utf-8") for file in (ROOT / "docs/schemas").glob("*.json")}
    assert {file.name: file.read_text(encoding="utf-8") for file in tmp_path.iterdir()} == there, (
        "python scripts/write_schemas.py"
    )
    for text in there.values():
        jsonschema.Draft202012Validator.check_schema(json.loads(text))


@pytest.mark.parametrize("name", write_schemas.SCHEMAS)
def test_what_is_written_keeps_its_schema(name, written):
    assert refused(name, written[name]) == []


@pytest.mark.parametrize(
    ("name", "read", "pattern"),
    [
        ("record", from_parquet, "tests/files/record.parquet"),
        ("packed_study", from_parquet, "tests/support/blessed*.parquet"),
        ("packed_study", from_parquet, "docs/results/S?d.parquet"),  # two of twelve: one takes a second
        ("study_file", from_toml, "swarm_forage_env/studies/sets/*.toml"),
        ("study_file", from_toml, "docs/*.toml"),
        ("study_file", from_toml, "tests/support/blessed*.toml"),
        ("entry", lambda file: parse_json(file.read_text(encoding="utf-8")), "docs/benchmark/**/*.json"),
        ("entry", lambda file: parse_json(file.read_text(encoding="utf-8")), "metrics/benchmark/scripted/**/*.json"),
        ("replay", from_page, "docs/gallery/warehouse_small.html"),
    ],
)
def test_files_of_the_repository_keep_their_schema(name, read, pattern):
    files = [file for file in ROOT.glob(pattern) if file.name != CROISSANT_FILE]
    assert {file.name: refused(name, read(file)) for file in files if refused(name, read(file))} == {}


@pytest.mark.parametrize("name", write_schemas.SCHEMAS)
def test_a_missing_or_unknown_key_is_refused_at_every_place(name, written):
    """Wherever the schema asks for a key, or names all that there may be."""
    document = written[name]
    schema = json.loads((ROOT / f"docs/schemas/{name}.schema.json").read_text(encoding="utf-8"))
    n_tried = 0
    for path, of_place in tables(schema, document, ()):
        for key in of_place["required"]:
            assert refused(name, changed(document, path, drop=key)), (path, key)
            n_tried += 1
        if of_place["additionalProperties"] is False:
            assert refused(name, changed(document, path, add="colour")), path
            n_tried += 1
    assert n_tried > 3


@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("record", ("metadata", "schema_version"), "1"),
        ("record", ("metadata", "digest"), "0123"),
        ("record", ("metadata", "spec", "scenario", "robots", "n_robots"), 2.5),
        ("record", ("metadata", "spec", "wrappers", 0, "wrapper"), "weather"),
        ("record", ("metadata", "spec", "scenario", "arena", "nest_size_m"), [1.6, 8.0, 1.0]),
        ("record", ("columns", "interference_fraction", 0), 1.5),
        ("record", ("columns", "collected", 0), 0.5),
        ("record", ("columns", "performance", 0), None),
        ("packed_study", ("columns", "state", 0), "lost"),
        ("packed_study", ("metadata", "study", "seeds"), []),
        ("study_file", ("axis", 0, "criterion"), "weather"),
        ("study_file", ("budget", "reduced", "seeds"), 0),
        ("study_file", ("rules",), ["printed"]),
        ("entry", ("training", "worlds"), "elsewhere"),
        ("entry", ("benchmark", "quick"), "no"),
        ("replay", ("version",), 2),
        ("replay", ("runs", 0, "arrays", 0, "dtype"), "f8"),
        ("replay", ("runs", 0, "world", "nest_boxes_m", 0), [0.0, 1.0]),
    ],
)
def test_what_no_file_holds_is_refused(name, path, value, written):
    *outer, last = path
    assert refused(name, changed(written[name], outer, set_to=(last, value)))


def changed(document, path, *, drop=None, add=None, set_to=None):
    """A copy of a document with one change in the table at a path."""
    again = copy.deepcopy(document)
    place = again
    for key in path:
        place = place[key]
    if drop is not None:
        place.pop(drop)
    if add is not None:
        place[add] = 1
    if set_to is not None:
        place[set_to[0]] = set_to[1]
    return again


def tables(schema, document, path):
    """Path and schema of each table that is given by its keys; the first entry of a list stands for all."""
    if isinstance(document, list):
        if document and isinstance(schema.get("items"), dict):
            yield from tables(schema["items"], document[0], (*path, 0))
    elif isinstance(document, dict) and "properties" in schema and "required" in schema:
        yield path, schema
        for key, value in document.items():
            yield from tables(schema["properties"].get(key, {}), value, (*path, key))
