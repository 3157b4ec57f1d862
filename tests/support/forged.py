"""Files with whatever somebody puts into them, and digests that fit: what a reader must refuse by itself."""

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl

from swarm_forage_env.runs import record
from swarm_forage_env.studies import study_table


@cache
def _parts(source: Path) -> tuple[Mapping[str, str], pl.DataFrame]:
    return pl.read_parquet_metadata(source), pl.read_parquet(source)


def forge_study(
    source: Path,
    file: Path,
    *,
    frame: Callable[[pl.DataFrame], pl.DataFrame] = lambda frame: frame,
    study: Mapping[str, Any] | str = "",
    versions: str | None = None,
) -> None:
    """Write a packed study as `source`, with another table, other keys of its study, or a whole other text for it."""
    stamp, whole = _parts(source)
    _, told, made, digest = (stamp[key] for key in study_table._FILE_KEYS)
    told = json.dumps({**json.loads(told), **study}) if isinstance(study, Mapping) else study or told
    made = made if versions is None else versions
    changed = frame(whole)
    with suppress(pl.exceptions.PolarsError):
        digest = study_table._digest(changed, told, made)  # else nobody looks at it
    values = (str(study_table.TABLE_VERSION), told, made, digest)
    changed.write_parquet(file, metadata=dict(zip(study_table._FILE_KEYS, values, strict=True)))


def forge_record(
    source: Path,
    file: Path,
    *,
    frame: Callable[[pl.DataFrame], pl.DataFrame] = lambda frame: frame,
    spec: str | None = None,
    provenance: str | None = None,
) -> None:
    """Write a record as `source`, with another table or other texts; its digest fits where it can."""
    stamp, whole = _parts(source)
    _, told, made, digest = (stamp[key] for key in record._FILE_KEYS)
    told, made = told if spec is None else spec, made if provenance is None else provenance
    changed = frame(whole)
    with suppress(ValueError, TypeError, LookupError, OverflowError, pl.exceptions.PolarsError):
        digest = record._digest(record.record_of(changed, told, {}), made)  # else nobody looks at it
    values = (str(record.SCHEMA_VERSION), told, made, digest)
    changed.write_parquet(file, metadata=dict(zip(record._FILE_KEYS, values, strict=True)))
