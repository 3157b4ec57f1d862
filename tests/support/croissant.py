"""What the specification of Croissant asks of metadata, and whether the files beside them are what they tell.

mlcroissant, the validator of ML Commons, would bring pandas and rdflib into every test environment.
"""

import hashlib
import json
import re
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

REQUIRED = {"@context", "@type", "conformsTo", "name", "description", "license", "url", "creator", "datePublished"}
"""Of a data set, by version 1.1; `distribution` is looked at below."""
TYPES = {
    "sc:Text": (str,),
    "sc:Integer": (int,),
    "sc:Float": (int, float),
    "sc:Boolean": (bool,),
    "cr:Float32": (np.float32,),
    "cr:Float64": (np.float64,),
    "cr:Int64": (np.int64,),
}
OF_SCHEMA_ORG = {
    *("license", "url", "creator", "keywords", "datePublished", "version", "distribution", "contentUrl"),
    *("contentSize", "encodingFormat", "sha256"),
}
"""Words that need no line in the context."""


def metadata(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "croissant.json").read_text(encoding="utf-8"))


def faults(folder: Path) -> list[str]:
    """What is wrong with the metadata of a folder: words, references, files, and each field in each file."""
    content = metadata(folder)
    found = [f"no {name}" for name in sorted(REQUIRED) if not content.get(name)]
    known = {*content.get("@context", {}), *OF_SCHEMA_ORG}
    found += [f"unknown word {word}" for word in sorted(words(content)) if word not in known]
    ids = [node["@id"] for node in nodes(content)]
    found += [f"{one} twice" for one in sorted(set(ids)) if ids.count(one) > 1]
    found += [f"no {one}" for one in references(content) if one not in ids]
    for node in content["distribution"]:
        found += _of_file(node, folder) if node["@type"] == "cr:FileObject" else _of_files(node, folder)
    sets = {node["@id"]: node for node in content["distribution"]}
    for record_set in content["recordSet"]:
        for field in record_set["field"]:
            for place, value in values(record_set, field, sets, folder):
                if not fits(value, field):
                    found.append(f"{field['@id']} in {place}")
    return found


def words(value: Any) -> set[str]:
    """Keys of all tables, apart from those of JSON-LD and of embedded records."""
    if isinstance(value, list):
        return set().union(*map(words, value))
    if not isinstance(value, dict):
        return set()
    inner = (words(inside) for key, inside in value.items() if key not in ("@context", "data"))
    return set().union(*inner) | {key for key in value if not key.startswith("@")}


def nodes(content: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield from content["distribution"]
    for record_set in content["recordSet"]:
        yield from (record_set, *record_set["field"])


def references(content: dict[str, Any]) -> Iterator[str]:
    for record_set in content["recordSet"]:
        yield record_set["key"]["@id"]
        yield from (field["source"]["fileSet"]["@id"] for field in record_set["field"] if "source" in field)


def _of_file(node: dict[str, Any], folder: Path) -> list[str]:
    file = folder / node["contentUrl"]
    if not file.exists():
        return [f"no file {file.name}"]
    told = (node["sha256"], node["contentSize"])
    return [] if told == (hashlib.sha256(file.read_bytes()).hexdigest(), f"{file.stat().st_size} B") else [file.name]


def _of_files(node: dict[str, Any], folder: Path) -> list[str]:
    return [] if files_of(node, folder) else [f"no files {node['includes']}"]


def files_of(node: dict[str, Any], folder: Path) -> list[Path]:
    return [file for file in sorted(folder.iterdir()) if any(fnmatch(file.name, one) for one in node["includes"])]


def values(
    record_set: dict[str, Any], field: dict[str, Any], sets: dict[str, Any], folder: Path
) -> Iterator[tuple[str, Any]]:
    """Yield what a field is in each record, with the place where that stands; a missing value is an error."""
    if "source" not in field:
        yield from ((f"record {k}", record[field["@id"]]) for k, record in enumerate(record_set["data"]))
        return
    if field["source"]["fileSet"]["@id"] not in sets:
        return
    ((how, what),) = field["source"]["extract"].items()
    for file in files_of(sets[field["source"]["fileSet"]["@id"]], folder):
        if how == "fileProperty":
            yield file.name, {"filename": file.name}[what]
        elif how == "column":
            with np.load(file) as arrays:
                yield file.name, arrays.get(what)
        else:
            yield file.name, at_path(json.loads(file.read_text(encoding="utf-8")), what)


def at_path(content: Any, path: str) -> Any:
    """Follow a JSONPath of plain and of quoted keys, such as $.runs['a room'].performance; "?" where it leads nowhere.

    A missing number is null in our files, so null fits any type.
    """
    assert re.fullmatch(r"\$(?:\.\w+|\['[^']+'\])+", path), path
    for plain, quoted in re.findall(r"\.(\w+)|\['([^']+)'\]", path):
        if (plain or quoted) not in content:
            return object()
        content = content[plain or quoted]
    return "" if content is None else content


def fits(value: Any, field: dict[str, Any]) -> bool:
    """Whether a value is what its field tells: type, and of an array the shape."""
    kinds = TYPES[field["dataType"]]
    if not field.get("isArray"):
        return type(value) in kinds or value == ""
    if isinstance(value, np.ndarray):
        (kind,) = kinds
        is_kind = value.dtype == kind
        shape = value.shape
    else:
        shape = np.shape(value)
        is_kind = all(type(item) in kinds for item in np.array(value, object).ravel())
    told = [int(length) for length in field["arrayShape"].split(",")]
    return is_kind and len(shape) == len(told) and all(a in (-1, b) for a, b in zip(told, shape, strict=True))
