"""JSON schemas of the files that others read: records, packed studies, study files, benchmark entries, replays.

    python scripts/write_schemas.py               into docs/schemas
    python scripts/write_schemas.py --out FOLDER  into another folder

Columns, fields and types are those of the code. docs/files.md says how a file becomes the document of its schema.
"""

import argparse
import dataclasses
import json
import sys
import types
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeAlias, Union, get_args, get_origin, get_type_hints

from metrics.benchmark.entry import TRAINED_IN, EntryFile
from swarm_forage_env._internal.typed import Shown
from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.inspect.replay.coding import DTYPES
from swarm_forage_env.inspect.replay.files import FORMAT, FORMAT_VERSION
from swarm_forage_env.runs.record import COLUMN_DTYPES, SCHEMA_VERSION
from swarm_forage_env.runs.spec import RUN_ID_DIGITS
from swarm_forage_env.runs.store import STATES
from swarm_forage_env.runs.versions import VERSION_NAMES
from swarm_forage_env.scenarios.columns import ALL_COLUMNS, CONTRIBUTED_COLUMNS, KEY_COLUMNS, Column, part_column
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import field_types
from swarm_forage_env.studies.ladders import CRITERIA
from swarm_forage_env.studies.study import OF_THE_STUDY, POLICY_KEYS, RULES_NAMES, SCENARIO_FIELDS
from swarm_forage_env.studies.study_file import AXIS_KEYS, BUDGET_KEYS, FILE_KEYS, FORMER_RULES
from swarm_forage_env.studies.study_table import AXIS, LOSS_COLUMNS, TABLE_VERSION
from swarm_forage_env.wrappers.registry import WRAPPERS, wrapper_config_class
from swarm_forage_env.wrappers.waveform import WAVEFORM_KINDS, Waveform

Schema: TypeAlias = dict[str, Any]

DOCS = Path(__file__).resolve().parent.parent / "docs/schemas"
DIALECT = "https://json-schema.org/draft/2020-12/schema"
TEXT: Schema = {"type": "string"}
NUMBER: Schema = {"type": "number"}
TEXT_OR_NULL: Schema = {"type": ["string", "null"]}
WHOLE: Schema = {"type": "integer"}
COUNT: Schema = {"type": "integer", "minimum": 0}
SWITCH: Schema = {"type": "boolean"}
ANY: Schema = {}
OF_TYPE: Mapping[Any, Schema] = {
    str: TEXT,
    float: NUMBER,
    int: WHOLE,
    bool: SWITCH,
    type(None): {"type": "null"},
    Any: ANY,
}
DIGEST: Schema = {"type": "string", "pattern": "^[0-9a-f]{32}$", "description": "of the content (BLAKE2b)"}
RUN_ID: Schema = {"type": "string", "pattern": f"^[0-9a-f]{{{RUN_ID_DIGITS}}}$"}
OF_KIND: Mapping[str, Schema] = {
    "text": TEXT,
    "whole": COUNT,
    "number": NUMBER,
    "amount": {"type": "number", "minimum": 0},
    "fraction": {"type": "number", "minimum": 0, "maximum": 1},
}
"""Kind of a column -> its values."""
LEVEL: Schema = {"type": ["number", "string", "boolean"]}
PLACE: Schema = {"type": ["number", "string", "boolean", "array"]}


def listed(items: Schema, **more: Any) -> Schema:
    """Return the schema of a list."""
    return {"type": "array", "items": items, **more}


def one_of(words: Sequence[str]) -> Schema:
    """Return the schema of one of several texts."""
    return {"type": "string", "enum": [*words]}


def keyed(fields: Mapping[str, Schema], required: Sequence[str] | None = None, **more: Any) -> Schema:
    """Return the schema of a table with these keys and no others; all are required unless it is told which."""
    wanted = [*fields] if required is None else [*required]
    return {"type": "object", "properties": dict(fields), "required": wanted, "additionalProperties": False, **more}


def free(values: Schema, **more: Any) -> Schema:
    """Return the schema of a table with any keys."""
    return {"type": "object", "additionalProperties": values, **more}


def of_type(kind: Any) -> Schema:
    """Return the schema of the values of a type: plain ones, tuples, mappings, alternatives, dataclasses."""
    if get_origin(kind) is Annotated:
        inner, bounds = get_args(kind)
        return {**of_type(inner), **_limits(get_origin(inner) is tuple, bounds)}
    origin, parts = get_origin(kind), get_args(kind)
    if dataclasses.is_dataclass(kind):
        return of_class(kind)
    if origin in (Union, types.UnionType):
        return {"anyOf": [of_type(part) for part in parts]}
    if origin is tuple and parts[-1] is Ellipsis:
        return listed(of_type(parts[0]))
    if origin is tuple:
        entries = [of_type(part) for part in parts]
        return {"type": "array", "prefixItems": entries, "items": False, "minItems": len(entries)}
    if origin is not None:
        return free(of_type(parts[-1]))
    return OF_TYPE[kind]


def _limits(is_list: bool, bounds: Any) -> Schema:
    """Return what `typed.Within` or `typed.Shown` asks of a value."""
    if isinstance(bounds, Shown):
        return {"minLength": 1}
    names = ("minItems", "maxItems") if is_list else ("minimum", "maximum")
    limits = zip(names, (bounds.at_least, bounds.at_most), strict=True)
    return {name: limit for name, limit in limits if limit is not None}


def of_class(kind: Any) -> Schema:
    """Return the schema of a dataclass as its file has it: a field that has a default may be missing."""
    hints = get_type_hints(kind, include_extras=True)
    own = dataclasses.fields(kind)
    lacking = dataclasses.MISSING
    required = [item.name for item in own if item.default is lacking and item.default_factory is lacking]
    return keyed({item.name: of_type(hints[item.name]) for item in own}, required)


def run_spec() -> Schema:
    """Return the schema of a run's specification."""
    wrappers = [
        keyed({"wrapper": {"const": name}, **of_class(kind)["properties"]}, ["wrapper"])
        for name, kind in ((name, wrapper_config_class(name)) for name in WRAPPERS)
    ]
    fields = {
        "scenario": of_class(ScenarioConfig),
        "policy": TEXT,
        "parameters": free(ANY),
        "wrappers": listed({"oneOf": wrappers}),
        "criterion": TEXT,
        "criterion_value": NUMBER,
        "seed": COUNT,
    }
    return keyed(fields, ["scenario", "policy"], description="everything that decides a run")


def provenance() -> Schema:
    """Return the schema of what made a run."""
    return free(TEXT, properties=dict.fromkeys(VERSION_NAMES, TEXT), description="versions, digest of the code, times")


def column(name: str, about: Column, *, or_null: bool = False) -> Schema:
    """Return the schema of a column: one value per row."""
    values = OF_KIND[about.kind]
    dtype = COLUMN_DTYPES.get(name)
    if dtype is not None and dtype.__name__.startswith("int"):
        values = {**values, "type": "integer"}
    if or_null:
        values = {**values, "type": [values["type"], "null"]}
    unit = {"unit": about.unit} if about.unit else {}
    return listed(values, description=about.meaning, **unit)


def record_columns(*, or_null: bool = False) -> Schema:
    """Return the schema of the columns of records; those of wrappers and policies may be missing, or be others."""
    fields = {name: column(name, about, or_null=or_null) for name, about in ALL_COLUMNS.items()}
    parts = {
        f"^{name.replace('_K_', '_[0-9]+_')}$": fields.pop(name) for name in ALL_COLUMNS if name.startswith("part_K_")
    }
    assert part_column("K", "") == "part_K_", "the names of these columns"
    required = [name for name in fields if name not in CONTRIBUTED_COLUMNS]
    values = listed(
        {"type": ["number", "null"] if or_null else "number"}, description="contributed by a wrapper or policy"
    )
    return keyed(fields, required, patternProperties=parts) | {"additionalProperties": values}


def record() -> Schema:
    """Return the schema of a run record."""
    stamp = {
        "schema_version": {"const": str(SCHEMA_VERSION)},
        "spec": run_spec(),
        "provenance": provenance(),
        "digest": DIGEST,
    }
    columns = record_columns()
    columns["properties"]["run_id"]["items"] = RUN_ID
    return keyed({"metadata": keyed(stamp), "columns": columns})


def study() -> Schema:
    """Return the schema of a study with all values written out, as study.json and packed studies have it."""
    policy = {"label": TEXT, "policy": TEXT, "parameters": free(ANY), "caches": TEXT_OR_NULL}
    assert set(policy) == set(POLICY_KEYS)
    fields = {
        "name": TEXT,
        "title": TEXT,
        "scenario": TEXT,
        "settings": free(ANY, propertyNames={"enum": [*SCENARIO_FIELDS]}),
        "wrappers": run_spec()["properties"]["wrappers"],
        "policies": listed(keyed(policy), minItems=1),
        "axes": listed(keyed({"name": TEXT, "values": listed(LEVEL, minItems=1)})),
        "reference": {"type": ["number", "string", "boolean", "null"]},
        FORMER_RULES: listed(one_of([*RULES_NAMES]), minItems=1),
        "budget": TEXT,
        "seeds": listed(COUNT, minItems=1),
        "horizon_s": NUMBER,
        "interval_s": NUMBER,
        "file": TEXT,
        "looks": listed(COUNT, minItems=1),
    }
    return keyed(fields, [name for name in fields if name not in ("file", "looks")])


def packed_study() -> Schema:
    """Return the schema of a packed study: rows of runs that are not there have no values."""
    stamp = {
        "table_version": {"const": str(TABLE_VERSION)},
        "study": study(),
        "versions": listed(provenance()),
        "digest": DIGEST,
    }
    columns = record_columns(or_null=True)
    first = {"study": TEXT, "cell": COUNT, "reading": one_of([*RULES_NAMES]), "policy": TEXT}
    last = {"state": one_of(STATES), **dict.fromkeys(LOSS_COLUMNS[1:], TEXT_OR_NULL)}
    del columns["properties"]["controller"]  # the label of the policy stands in its place
    columns["properties"] |= {name: listed(values) for name, values in (first | last).items()}
    columns["patternProperties"][f"^{AXIS}"] = listed(LEVEL)
    keys = [name for name in KEY_COLUMNS if name != "controller"]
    columns["required"] = [*first, *keys, "interval", "t_end_s", "performance", *last]
    return keyed({"metadata": keyed(stamp), "columns": columns})


def study_file() -> Schema:
    """Return the schema of a study file, which people write."""
    beside = {name: values for name, values in of_class(Waveform)["properties"].items() if name != "kind"}
    wrappers: dict[str, Schema] = {}
    for name in WRAPPERS:
        kind = wrapper_config_class(name)
        fields = dict(of_class(kind)["properties"])
        if kind.waveform_field:  # the kind alone, with its values beside it, is the short form
            kinds = {"anyOf": [fields[kind.waveform_field], one_of(WAVEFORM_KINDS)]}
            fields = {**beside, **fields, kind.waveform_field: kinds}
        wrappers[name] = keyed(fields, [])
    settings = {name: values for name, values in _settings().items() if name not in OF_THE_STUDY}
    policy = {"label": TEXT, "policy": TEXT, "parameters": free(ANY), "caches": TEXT}
    named = {"criterion": one_of([*CRITERIA]), "field": TEXT, "values": listed(PLACE, minItems=1), "reference": PLACE}
    budget = {
        "seeds": {"anyOf": [{"type": "integer", "minimum": 1}, listed(COUNT, minItems=1)]},
        "horizon_s": NUMBER,
        "interval_s": NUMBER,
        "values": free({"anyOf": [{"type": "integer", "minimum": 1}, listed(PLACE, minItems=1)]}),
    }
    rules = listed(one_of([*RULES_NAMES]), minItems=1)
    keys = {
        "name": TEXT,
        "title": TEXT,
        "scenario": TEXT,
        "policies": listed({"anyOf": [TEXT, keyed(policy, ["policy"])]}, minItems=1),
        "rules": rules,
        FORMER_RULES: {**rules, "deprecated": True},
        "set": keyed(settings, []),
        "wrappers": keyed(wrappers, []),
        "axis": listed(keyed(named, [], oneOf=[{"required": [name]} for name in ("criterion", "field")])),
        "budget": free(keyed(budget, [])),
    }
    assert (set(keys), set(named), set(budget)) == (set(FILE_KEYS), set(AXIS_KEYS), set(BUDGET_KEYS))
    return keyed(keys, ["name", "scenario", "policies"])


def _settings() -> dict[str, Schema]:
    return {name: of_type(kind) for name, kind in field_types().items()} | {"density": NUMBER, "side_m": NUMBER}


def entry() -> Schema:
    """Return the schema of an entry of the benchmark."""
    whole = of_class(EntryFile)
    fields = whole["properties"]
    fields["training"]["properties"]["worlds"] = one_of(TRAINED_IN)
    fields["benchmark"]["properties"]["identity"] = fields["digest"] = RUN_ID
    fields["runs"]["description"] = "by world"
    return whole


def replay() -> Schema:
    """Return the schema of the header of a replay page."""
    array = {"name": TEXT, "dtype": one_of(DTYPES), "shape": listed(COUNT), "offset": COUNT, "size": COUNT}
    box = listed(NUMBER, minItems=4, maxItems=4)
    world = {
        **dict.fromkeys(("width_m", "height_m", "wall_m", "cell_m", "robot_radius_m", "cache_side_m"), NUMBER),
        "interior_m": listed(NUMBER),
        **dict.fromkeys(("nest_boxes_m", "obstacles_m", "sources_m"), listed(box)),
        "lights_m": listed(listed(NUMBER, minItems=2, maxItems=2)),
        "caches": TEXT,
    }
    counters = [counter.name.lower() for counter in Counter]
    run = {
        **dict.fromkeys(("label", "scenario", "policy"), TEXT),
        "run_id": RUN_ID,
        **dict.fromkeys(("seed", "n_robots", "n_objects", "n_cache_slots", "n_frames"), COUNT),
        **dict.fromkeys(("frame_ticks", "end_tick", "remembered_frames"), COUNT),
        "kinds": listed({"type": "array", "prefixItems": [TEXT, COUNT], "items": False, "minItems": 2}),
        **dict.fromkeys(("dt_s", "position_step_m"), NUMBER),
        "has_tasks": SWITCH,
        "tasks": listed(TEXT, minItems=len(Task), maxItems=len(Task)),
        "activities": listed(TEXT),
        "counters": listed(one_of(counters)),
        "performance": keyed({"counter": one_of(counters), "words": TEXT}),
        "signals": listed(keyed({"name": TEXT, "title": TEXT, "unit": TEXT})),
        "disturbances": listed(TEXT),
        "world": keyed(world),
        "versions": free(TEXT),
        "spec": run_spec(),
        "arrays": listed(keyed(array)),
        "digest": DIGEST,
    }
    return keyed(
        {"format": {"const": FORMAT}, "version": {"const": FORMAT_VERSION}, "runs": listed(keyed(run), minItems=1)}
    )


SCHEMAS = {
    "record": ("a run record", record),
    "packed_study": ("a packed study", packed_study),
    "study_file": ("a study file", study_file),
    "entry": ("an entry of the benchmark", entry),
    "replay": ("the header of a replay page", replay),
}
"""Name of the file -> what it is of, and what makes it."""


def schemas() -> dict[str, Schema]:
    """Return all schemas by the name of their file."""
    return {
        f"{name}.schema.json": {"$schema": DIALECT, "title": f"swarm_forage_env: {title}", **made()}
        for name, (title, made) in SCHEMAS.items()
    }


def main(words: Sequence[str] | None = None) -> int:
    """Write the schemas; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=DOCS, metavar="FOLDER", help="default docs/schemas")
    arguments = parser.parse_args(words)
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, schema in schemas().items():
        (arguments.out / name).write_text(json.dumps(schema, indent=1) + "\n", encoding="utf-8")
        print(arguments.out / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
