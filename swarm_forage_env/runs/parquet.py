"""Parquet files that anybody may have written: what they would unpack to is added up before anything is unpacked.

A Parquet file is a row of pages, each compressed by itself, and a footer that says where they are, in the compact
encoding of Thrift. A file of a few kilobytes may unpack to gigabytes: one page of zeros, or one text in a million rows.
So the head of every page is read first. Format: https://parquet.apache.org/docs/file-format/.
"""

import os
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.wording import shown

if TYPE_CHECKING:
    import polars as pl

_MARK = b"PAR1"
"""First and last bytes of a file."""
_BYTES_PER_VALUE = 16
"""Memory of a value of any type that we read, texts left aside."""
_MOST_LEVELS = 12
"""Nested structures of a footer; those of Parquet are half as deep."""
_ENCODINGS = frozenset((0, 2, 3, 8))
"""PLAIN, PLAIN_DICTIONARY, RLE and RLE_DICTIONARY, the ones that polars writes. Others, such as prefixes of the text
before, unpack to more than a page's head says."""
_DATA_PAGE, _DICTIONARY_PAGE, _DATA_PAGE_V2 = 0, 2, 3
_ALONE = Lock()
"""Held while stderr is another."""
_BROKEN = (IndexError, KeyError, TypeError, AttributeError, struct.error, UnicodeDecodeError)
"""Errors over bytes that are no Thrift, or that tell of another structure."""


class ParquetError(ValueError):
    """No Parquet file, a damaged one, or one that is larger or of other columns than it may be."""


@dataclass(frozen=True, kw_only=True)
class ParquetFile:
    """A Parquet file of which the footer has been read, and no values yet."""

    content: bytes = field(repr=False)
    stamp: Mapping[str, str]
    """Key -> text of its metadata."""
    n_rows: int

    def frame(self) -> "pl.DataFrame":
        """Return the table.

        Raises:
            ParquetError: the file is damaged.
        """
        import polars as pl

        try:
            with _panics_untold():
                return pl.read_parquet(BytesIO(self.content), use_pyarrow=False)
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
            raise _damaged(error) from error


def open_parquet(path: Path, most_bytes: int) -> ParquetFile:
    """Read the footer of a file, and the heads of its pages.

    Args:
        path: The file.
        most_bytes: What it may have, in the file, unpacked, and in memory.

    Raises:
        OSError: the file cannot be read.
        ParquetError: it is no Parquet file of so many bytes.
    """
    size = path.stat().st_size
    if size > most_bytes:
        raise ParquetError(f"it has {size:,} bytes, but at most {most_bytes:,} are expected")
    content = path.read_bytes()
    if len(content) < 12 or content[:4] != _MARK or content[-4:] != _MARK:
        raise _damaged("it does not begin and end as one")
    try:
        footer = _footer(content)
        n_rows, columns = footer[3], footer[2][1:]  # the first entry is the table itself
        if any(5 in column for column in columns):
            raise ParquetError("it has columns of lists or tables, which swarm_forage_env writes none of")
        n_columns = len(columns)
        stamp = {pair[1].decode(): pair.get(2, b"").decode() for pair in footer.get(5, ())}
        if n_rows * n_columns * _BYTES_PER_VALUE > most_bytes:
            raise ParquetError(f"it has {n_rows:,} rows of {n_columns:,} columns, more than are expected")
        unpacked = sum(_unpacked(content, group, n_columns) for group in footer[4])
        if sum(group[3] for group in footer[4]) != n_rows:
            raise _damaged("its row groups have other rows than it says")
    except _BROKEN as error:
        raise _damaged("its footer or the head of a page cannot be read") from error
    if unpacked > most_bytes:
        raise ParquetError(f"it has {unpacked:,} bytes unpacked, but at most {most_bytes:,} are expected")
    return ParquetFile(content=content, stamp=stamp, n_rows=n_rows)


def check_columns(
    frame: "pl.DataFrame", kinds: Mapping[str, tuple[Any, ...]], others: tuple[Any, ...], *, needed: Iterable[str]
) -> None:
    """Refuse columns of other types than they may have, and numbers that are not finite; empty places may be.

    Args:
        frame: The table.
        kinds: Column -> the types that it may have.
        others: Types of columns of other names.
        needed: Columns that must be there.

    Raises:
        ParquetError: names the first such column.
    """
    for name in needed:
        if name not in frame.columns:
            raise ParquetError(f"it has no column {name}")
    for column in frame.iter_columns():
        allowed = kinds.get(column.name, others)
        if column.dtype not in allowed:
            wanted = " or ".join(str(kind) for kind in dict.fromkeys(allowed))
            raise ParquetError(f"its column {shown(column.name)} is of {column.dtype}, not of {wanted}")
        if column.dtype.is_float() and not column.is_finite().all():
            raise ParquetError(f"its column {shown(column.name)} holds numbers that are not finite")


def check_texts(frame: "pl.DataFrame", most_bytes: int) -> None:
    """Refuse a table whose texts, each written out where it stands, have more bytes than they may; see above."""
    import polars as pl

    texts = frame.select(pl.col(pl.String).str.len_bytes().cast(pl.Int64).sum())
    if sum(texts.row(0) if texts.width else ()) > most_bytes:
        raise ParquetError(f"its texts have more than the {most_bytes:,} bytes that are expected")


@contextmanager
def _panics_untold() -> Iterator[None]:
    """Keep what polars says of a panic from stderr, where it would stand for dozens of lines; it raises it as well."""
    with _ALONE:
        try:
            kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        except OSError:  # there is no stderr
            yield
            return
        try:
            os.dup2(nowhere, 2)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)


def _damaged(why: object) -> ParquetError:
    return ParquetError(f"it is no Parquet file or a damaged one ({str(why).strip().partition(chr(10))[0]})")


def _footer(content: bytes) -> dict[int, Any]:
    (length,) = struct.unpack("<I", content[-8:-4])
    if length > len(content) - 12:
        raise _damaged("its footer is longer than the file")
    return _Thrift(content, len(content) - 8 - length).structure()


def _unpacked(content: bytes, group: Mapping[int, Any], n_columns: int) -> int:
    """Return how many bytes the pages of a row group unpack to."""
    if len(group[1]) != n_columns:
        raise _damaged("a row group has other columns than the table")
    total = 0
    for chunk in group[1]:
        about = chunk[3]
        start = about.get(11, about[9])  # polars begins at the dictionary, wherever it lies
        if not 0 < start <= about[9]:
            raise _damaged("a dictionary does not lie before the values of its column")
        end = start + about[7]
        if not 4 <= start <= end <= len(content):
            raise _damaged("a column lies outside of the file")
        n_values = 0
        while start < end:
            reader = _Thrift(content, start)
            page = reader.structure()
            start = reader.at + page[3]
            if page[2] < 0 or page[3] < 0:
                raise _damaged("a page has less than no bytes")
            total += page[2]
            n_values += _values_in(page)
        if start != end:
            raise _damaged("the pages of a column end elsewhere than it says")
        if n_values != about[5] or n_values != group[3]:
            raise _damaged("the pages of a column have other rows than its table")
    return total


def _values_in(page: Mapping[int, Any]) -> int:
    """Return how many values of rows a page has; those of a dictionary are not of rows."""
    if page[1] == _DICTIONARY_PAGE:
        head, values = page[7], 0
    elif page[1] in (_DATA_PAGE, _DATA_PAGE_V2):
        head = page[5 if page[1] == _DATA_PAGE else 8]
        values = head[1]
    else:
        raise _damaged(f"a page of kind {page[1]}")
    if head[2 if page[1] != _DATA_PAGE_V2 else 4] not in _ENCODINGS or head[1] < 0:
        raise ParquetError("its values are encoded in a way in which swarm_forage_env writes none")
    return values


class _Thrift:
    """Structures in Thrift's compact encoding, as mappings from the numbers of fields."""

    def __init__(self, content: bytes, at: int) -> None:
        self._content, self.at = content, at

    def structure(self, level: int = 0) -> dict[int, Any]:
        """Read one."""
        if level > _MOST_LEVELS:
            raise _damaged("its footer is nested too deeply")
        found: dict[int, Any] = {}
        number = 0
        while True:
            head = self._byte()
            if not head:
                return found
            number = number + (head >> 4) if head >> 4 else self._signed()
            found[number] = self._value(head & 15, level)

    def _byte(self) -> int:
        value = self._content[self.at]
        self.at += 1
        return value

    def _unsigned(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7
            if shift > 63:
                raise _damaged("a number of more than 64 bits")

    def _signed(self) -> int:
        value = self._unsigned()
        return value >> 1 ^ -(value & 1)

    def _value(self, kind: int, level: int) -> Any:
        if kind in (1, 2):
            return kind == 1
        if kind == 3:
            return self._byte()
        if kind in (4, 5, 6):
            return self._signed()
        if kind == 7:
            return self._bytes(8)
        if kind == 8:
            return self._bytes(self._unsigned())
        if kind == 9:
            return self._list(level)
        if kind == 12:
            return self.structure(level + 1)
        raise _damaged("its footer has a field of no kind")

    def _bytes(self, count: int) -> bytes:
        self.at += count
        if self.at > len(self._content):
            raise _damaged("its footer ends early")
        return self._content[self.at - count : self.at]

    def _list(self, level: int) -> list[Any]:
        head = self._byte()
        count = head >> 4 if head >> 4 < 15 else self._unsigned()
        if level > _MOST_LEVELS or count > len(self._content):
            raise _damaged("its footer has a list that is too long")
        kind = head & 15
        if kind in (1, 2):  # in lists, truth values are bytes
            return [self._byte() == 1 for _ in range(count)]
        return [self._value(kind, level + 1) for _ in range(count)]
