"""Parquet files that anybody may have written: what they would unpack to is added up before anything is unpacked.

A Parquet file is a row of pages, each compressed by itself, and a footer that says where they are, in the compact
encoding of Thrift. A file of a few kilobytes may unpack to gigabytes: one page of zeros, or one text in a million rows.
So the head of every page is read first. Format: https://parquet.apache.org/docs/file-format/.
"""

import os
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from swarm_forage_env._internal.wording import shown

if TYPE_CHECKING:
    import polars as pl

_MARK = b"PAR1"
"""First and last bytes of a file."""
_BYTES_PER_VALUE = 16
"""Memory of a value of any type that we read, texts left aside."""
_MOST_FOOTER = 2**22
"""Bytes of a footer; our choice: three hundred times the largest of ours, of which half is the text of its study."""
_MOST_ENTRIES = 2**17
"""Values of a footer, structures and lists among them; our choice: seventy times the most of ours, 28 per column."""
_ENCODINGS = frozenset((0, 2, 3, 8))
"""PLAIN, PLAIN_DICTIONARY, RLE and RLE_DICTIONARY, the ones that polars writes. Others, such as prefixes of the text
before, unpack to more than a page's head says."""
_DATA_PAGE, _DICTIONARY_PAGE, _DATA_PAGE_V2 = 0, 2, 3
_ALONE = Lock()
"""Held while stderr is another."""
_BROKEN = (IndexError, KeyError, UnicodeDecodeError)
"""Errors over bytes that are no Thrift, or that lack a field."""
_Structure: TypeAlias = "Mapping[int, _Layout]"
_Layout: TypeAlias = "tuple[int, ...] | _Structure | list[_Layout]"
"""What a field holds: a value, with the kinds that Thrift gives it; a structure by its fields; a list of one thing."""
_TRUTH, _BYTE, _WHOLE, _TEXT = (1, 2), (3,), (4, 5, 6), (8,)
_UNIT: _Layout = {1: _TRUTH, 2: {1: {}, 2: {}, 3: {}}}
_TYPE: _Layout = {
    **{number: {} for number in (1, 2, 3, 4, 6, 11, 12, 13, 14, 15)},
    5: {1: _WHOLE, 2: _WHOLE},
    7: _UNIT,
    8: _UNIT,
    10: {1: _BYTE, 2: _TRUTH},
}
_STATISTICS: _Layout = {**dict.fromkeys((1, 2, 5, 6), _TEXT), **dict.fromkeys((3, 4, 9), _WHOLE), 7: _TRUTH, 8: _TRUTH}
_PAGE: _Structure = {
    **dict.fromkeys((1, 2, 3, 4), _WHOLE),
    5: {**dict.fromkeys((1, 2, 3, 4), _WHOLE), 5: _STATISTICS},
    7: {1: _WHOLE, 2: _WHOLE, 3: _TRUTH},
    8: {**dict.fromkeys((1, 2, 3, 4, 5, 6), _WHOLE), 7: _TRUTH, 8: _STATISTICS},
}
"""The head of a page. Polars takes a field that it knows for what it should be, whatever kind the file gives it, so
that any other kind would make it go on at another byte than we do. Hence these are all fields that may be there."""
_PAIR: _Layout = {1: _TEXT, 2: _TEXT}
_COLUMN: _Layout = {
    **dict.fromkeys((1, 4, 5, 6, 7, 9, 10, 11, 14, 15), _WHOLE),
    2: [_WHOLE],
    3: [_TEXT],
    8: [_PAIR],
    12: _STATISTICS,
    13: [dict.fromkeys((1, 2, 3), _WHOLE)],
    16: {1: _WHOLE, 2: [_WHOLE], 3: [_WHOLE]},
}
_GROUP: _Layout = {
    1: [{**dict.fromkeys((2, 4, 5, 6, 7), _WHOLE), 3: _COLUMN}],
    4: [{1: _WHOLE, 2: _TRUTH, 3: _TRUTH}],
    **dict.fromkeys((2, 3, 5, 6, 7), _WHOLE),
}
_FOOTER: _Structure = {
    2: [{**dict.fromkeys((1, 2, 3, 5, 6, 7, 8, 9), _WHOLE), 4: _TEXT, 10: _TYPE}],
    1: _WHOLE,
    3: _WHOLE,
    4: [_GROUP],
    5: [_PAIR],
    6: _TEXT,
    7: [{1: {}, 2: {}}],
}


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
            with panics_untold():
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
    return parse_parquet(path.read_bytes(), most_bytes)


def parse_parquet(content: bytes, most_bytes: int, *, ours: bool = True) -> ParquetFile:
    """Read the footer of a file's content, and the heads of its pages; see `open_parquet`.

    Args:
        content: Of the file.
        most_bytes: As in `open_parquet`.
        ours: Whether we wrote it. Files of other programs may have any encoding, and columns of lists and tables; texts
            in such encodings may unpack to more.

    Raises:
        ParquetError: it is no Parquet file of so many bytes.
    """
    if len(content) > most_bytes:
        raise ParquetError(f"it has {len(content):,} bytes, but at most {most_bytes:,} are expected")
    if len(content) < 12 or content[:4] != _MARK or content[-4:] != _MARK:
        raise _damaged("it does not begin and end as one")
    try:
        footer = _footer(content)
        n_rows, columns = footer[3], footer[2][1:]  # the first entry is the table itself
        is_flat = not any(5 in column for column in columns)
        if ours and not is_flat:
            raise ParquetError("it has columns of lists or tables, which swarm_forage_env writes none of")
        n_columns = sum(5 not in column for column in columns)
        stamp = {pair[1].decode(): pair.get(2, b"").decode() for pair in footer.get(5, ())}
        check_size(n_rows, n_columns, most_bytes)
        pages = [page for group in footer[4] for page in _pages(content, group, n_columns, is_flat=is_flat)]
        if ours and not all(page.encoding in _ENCODINGS for page in pages):
            raise ParquetError("its values are encoded in a way in which swarm_forage_env writes none")
        unpacked = sum(max(page.n_bytes, page.n_values * (0 if is_flat else _BYTES_PER_VALUE)) for page in pages)
        if sum(group[3] for group in footer[4]) != n_rows:
            raise _damaged("its row groups have other rows than it says")
    except _BROKEN as error:
        raise _damaged("its footer or the head of a page cannot be read") from error
    if unpacked > most_bytes:
        raise ParquetError(f"it has {unpacked:,} bytes unpacked, but at most {most_bytes:,} are expected")
    return ParquetFile(content=content, stamp=stamp, n_rows=n_rows)


def check_size(n_rows: int, n_columns: int, most_bytes: int) -> None:
    """Refuse a table whose values alone would have more bytes than they may; see `open_parquet`."""
    if n_rows * n_columns * _BYTES_PER_VALUE > most_bytes:
        raise ParquetError(f"it has {n_rows:,} rows of {n_columns:,} columns, more than are expected")


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
def panics_untold() -> Iterator[None]:
    """Keep what polars says of a panic from stderr, where it would stand for dozens of lines; it raises it as well.

    Polars writes past `sys.stderr`, so stderr is another for the whole process: what other threads write there
    meanwhile is lost, and a process that one of them forks meanwhile stays mute.
    """
    with _ALONE, ExitStack() as opened:
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            opened.callback(os.close, nowhere)
            kept = os.dup(2)
        except OSError:  # there is no stderr
            yield
            return
        opened.callback(os.close, kept)
        opened.callback(os.dup2, kept, 2)
        os.dup2(nowhere, 2)
        yield


def _damaged(why: object) -> ParquetError:
    return ParquetError(f"it is no Parquet file or a damaged one ({str(why).strip().partition(chr(10))[0]})")


def _footer(content: bytes) -> dict[int, Any]:
    (length,) = struct.unpack("<I", content[-8:-4])
    if length > len(content) - 12:
        raise _damaged("its footer is longer than the file")
    if length > _MOST_FOOTER:
        raise ParquetError(f"its footer has {length:,} bytes, but at most {_MOST_FOOTER:,} are expected")
    return _Thrift(content, len(content) - 8 - length).structure(_FOOTER)


class _Page(NamedTuple):
    """What the head of a page says."""

    n_bytes: int
    """Unpacked."""
    n_values: int
    """Of rows; those of a dictionary are not."""
    encoding: int


def _pages(content: bytes, group: Mapping[int, Any], n_columns: int, *, is_flat: bool) -> Iterator[_Page]:
    """Yield the pages of a row group; with flat columns, each has as many values as rows."""
    if len(group[1]) != n_columns:
        raise _damaged("a row group has other columns than the table")
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
            head = reader.structure(_PAGE)
            start = reader.at + head[3]
            if head[2] < 0 or head[3] < 0:
                raise _damaged("a page has less than no bytes")
            page = _page(head)
            n_values += page.n_values
            yield page
        if start != end:
            raise _damaged("the pages of a column end elsewhere than it says")
        if n_values != about[5] or (is_flat and n_values != group[3]):
            raise _damaged("the pages of a column have other rows than its table")


def _page(head: Mapping[int, Any]) -> _Page:
    """Return what the head of a page says, where polars can take memory for it."""
    kind, n_bytes = head[1], head[2]
    if kind not in (_DICTIONARY_PAGE, _DATA_PAGE, _DATA_PAGE_V2):
        raise _damaged(f"a page of kind {kind}")
    about = head[{_DICTIONARY_PAGE: 7, _DATA_PAGE: 5, _DATA_PAGE_V2: 8}[kind]]
    if about[1] < 0 or (kind == _DICTIONARY_PAGE and about[1] > n_bytes):
        raise _damaged("a page has other values than its bytes can hold")
    if kind == _DATA_PAGE_V2 and (min(about[2], about[3], about[5], about[6]) < 0 or about[5] + about[6] > n_bytes):
        raise _damaged("a page has other levels than its bytes can hold")
    n_values = 0 if kind == _DICTIONARY_PAGE else about[1]
    return _Page(n_bytes, n_values, about[4 if kind == _DATA_PAGE_V2 else 2])


class _Thrift:
    """Structures in Thrift's compact encoding, as mappings from the numbers of fields; a layout says which these are.

    A structure of another layout, and one of too many values, is refused where it begins to be.
    """

    def __init__(self, content: bytes, at: int) -> None:
        self._content, self.at = content, at
        self._n_entries = 0

    def structure(self, layout: _Structure) -> dict[int, Any]:
        """Read one."""
        found: dict[int, Any] = {}
        number = 0
        while True:
            head = self._byte()
            if not head:
                return found
            number = number + (head >> 4) if head >> 4 else self._signed()
            if number not in layout:
                raise _damaged(f"its footer or the head of a page has a field {number}")
            found[number] = self._value(head & 15, layout[number])

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

    def _value(self, kind: int, layout: _Layout) -> Any:
        self._n_entries += 1
        if self._n_entries > _MOST_ENTRIES:
            raise ParquetError(f"its footer has more than the {_MOST_ENTRIES:,} values that are expected")
        kinds = layout if isinstance(layout, tuple) else (9,) if isinstance(layout, list) else (12,)
        if kind not in kinds:
            raise _damaged("its footer or the head of a page has a field of another kind")
        if isinstance(layout, list):
            return self._list(layout[0])
        if not isinstance(layout, tuple):
            return self.structure(layout)
        if layout == _TRUTH:
            return kind == 1
        return self._signed() if layout == _WHOLE else self._bytes(1 if layout == _BYTE else self._unsigned())

    def _bytes(self, count: int) -> bytes:
        self.at += count
        if self.at > len(self._content):
            raise _damaged("its footer ends early")
        return self._content[self.at - count : self.at]

    def _list(self, layout: _Layout) -> list[Any]:
        head = self._byte()
        count = head >> 4 if head >> 4 < 15 else self._unsigned()
        return [self._value(head & 15, layout) for _ in range(count)]
