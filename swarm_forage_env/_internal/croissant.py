"""Croissant: what a data set is and holds, as JSON-LD beside its files, for search engines and libraries of data sets.

https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html says which words there are and what they mean.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import metadata
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.files import as_file_name, read_json, replacing

CROISSANT_FILE = "croissant.json"
JSON_FORMAT = "application/json"
NPZ_FORMAT = "application/zip"
"""Of arrays of NumPy: there is no name for an archive of them alone."""
_OF_CROISSANT = (
    *("arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract", "field", "fileProperty"),
    *("fileObject", "fileSet", "format", "includes", "isArray", "isLiveDataset", "jsonPath", "key", "md5"),
    *("parentField", "path", "recordSet", "references", "regex", "repeated", "replace", "samplingRate", "separator"),
    *("source", "subField", "transform"),
)
"""Words that Croissant adds to schema.org; validators ask for all of them, used or not."""
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "name": {"@container": "@language"},
    "description": {"@container": "@language"},
    "data": {"@id": "cr:data", "@type": "@json"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    **{word: f"cr:{word}" for word in _OF_CROISSANT},
}
_TYPES = {"bool": "sc:Boolean", "float32": "cr:Float32", "float64": "cr:Float64", "int64": "cr:Int64"}
"""Type of NumPy -> type of Croissant."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Field:
    """What every record of a set has."""

    name: str
    description: str
    data_type: str
    """"sc:Text", "sc:Integer", "sc:Float", "sc:Boolean", or of an array what `type_of` says."""
    extract: Mapping[str, str] | None = None
    """How a file is asked for it: {"jsonPath": "$.seed"}, {"column": "rewards"}; None = the records have it."""
    shape: tuple[int | None, ...] | None = None
    """Shape of an array, in which None stands for any length; None = a single value."""


def type_of(dtype: Any) -> str:
    """Return the type of the values of a NumPy array."""
    return _TYPES[np.dtype(dtype).name]


def file_object(file: Path, encoding_format: str) -> dict[str, Any]:
    """Describe a file beside the metadata, with its size and digest."""
    with file.open("rb") as opened:
        digest = hashlib.file_digest(opened, "sha256").hexdigest()
    return {
        "@type": "cr:FileObject",
        "@id": file.name,
        "name": file.name,
        "contentUrl": file.name,
        "contentSize": f"{file.stat().st_size} B",
        "encodingFormat": encoding_format,
        "sha256": digest,
    }


def file_set(name: str, description: str, encoding_format: str, includes: Sequence[str]) -> dict[str, Any]:
    """Describe files of one kind, from which records are extracted."""
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "description": description,
        "encodingFormat": encoding_format,
        "includes": list(includes),
    }


def record_set(
    name: str,
    description: str,
    fields: Sequence[Field],
    *,
    files: str = "",
    records: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Describe records; the first field tells them apart.

    Args:
        name: Name of the set.
        description: What a record is.
        fields: What each record has.
        files: Name of the file set from which they are extracted.
        records: Instead of files, the records themselves: name of a field -> its value.
    """
    ids = {one.name: f"{name}/{as_file_name(one.name)}" for one in fields}
    described = {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": description,
        "key": {"@id": ids[fields[0].name]},
        "field": [_field(one, ids[one.name], files) for one in fields],
    }
    if records:
        described["data"] = [{ids[key]: value for key, value in record.items()} for record in records]
    return described


def _field(field: Field, identity: str, files: str) -> dict[str, Any]:
    described: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": identity,
        "name": field.name,
        "description": field.description,
        "dataType": field.data_type,
    }
    if field.shape is not None:
        shape = ",".join("-1" if length is None else str(length) for length in field.shape)
        described |= {"isArray": True, "arrayShape": shape}
    if field.extract is not None:
        described["source"] = {"fileSet": {"@id": files}, "extract": dict(field.extract)}
    return described


def write_croissant(
    folder: Path,
    *,
    distribution: Sequence[Mapping[str, Any]],
    record_sets: Sequence[Mapping[str, Any]],
    about: Mapping[str, Any],
) -> Path:
    """Write the metadata of the files of a folder into it; returns the file.

    The day of publication is today, or that of the file before if it told the same.

    Args:
        folder: Where the files are.
        distribution: The files, see `file_object` and `file_set`.
        record_sets: What is in them, see `record_set`.
        about: Properties of the whole, such as name and description. If creator, license and address are not among
            them, they are those of the file before, or else of this package.
    """
    package = metadata("swarm-forage-env")
    publisher: dict[str, Any] = {
        "creator": {"@type": "Organization", "name": package["Author"]},
        "license": f"https://spdx.org/licenses/{package['License-Expression']}",
        "url": package["Project-URL"].partition(", ")[2],
    }
    file = folder / CROISSANT_FILE
    before = _before(file)
    content: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        **{name: before.get(name, value) for name, value in publisher.items()},
        "keywords": package["Keywords"].split(","),
        "datePublished": "",
        **about,
        "distribution": list(distribution),
        "recordSet": list(record_sets),
    }
    content["datePublished"] = content["datePublished"] or _day(before, content)
    with replacing(file) as draft:
        draft.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return file


def _before(file: Path) -> dict[str, Any]:
    """Return what the file that is there tells; nothing if there is none, or one that cannot be read."""
    with suppress(ValueError):
        before = read_json(file, ValueError)
        if isinstance(before, dict):
            return before
    return {}


def _day(before: Mapping[str, Any], content: Mapping[str, Any]) -> str:
    """Return the day of the file before if it tells the same, else today."""
    if before and {**content, "datePublished": before.get("datePublished")} == before:
        return str(before["datePublished"])
    return datetime.now(UTC).date().isoformat()
