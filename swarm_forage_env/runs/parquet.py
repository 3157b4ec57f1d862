"""Parquet files: a table, and texts by key in its metadata. Whatever is wrong with one is told in one line."""

import os
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import polars as pl


class ParquetError(ValueError):
    """No Parquet file, or a damaged one."""


def read_parquet(path: str | os.PathLike[str]) -> "tuple[Mapping[str, str], pl.DataFrame]":
    """Return the texts in the metadata of a file, by key, and its table.

    Raises:
        OSError: the file cannot be read.
        ParquetError: it is no Parquet file, or a damaged one.
    """
    import polars as pl

    content = Path(path).read_bytes()
    try:
        return pl.read_parquet_metadata(BytesIO(content)), pl.read_parquet(BytesIO(content))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        reason = str(error).strip().partition("\n")[0]
        raise ParquetError(f"it is no Parquet file or a damaged one ({reason})") from error


def write_parquet(path: Path, frame: "pl.DataFrame", texts: Mapping[str, str], compression_level: int = 3) -> None:
    """Write a table, with texts by key in its metadata.

    Raises:
        OSError: the file cannot be written.
    """
    buffer = BytesIO()  # polars tells a full disk as an error of its own, among many others
    frame.write_parquet(buffer, metadata=dict(texts), compression_level=compression_level)
    path.write_bytes(buffer.getvalue())
