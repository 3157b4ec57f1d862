"""Archives of arrays (.npz) that anybody may have written: size, type and shape are checked before an array is read."""

import io
import math
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.typed import check_array, check_kind

_FIRST = b"PK\x03\x04"
"""First bytes of a zip file, which an `.npz` is."""
BROKEN_ARCHIVE = (LookupError, TypeError, EOFError, OSError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""Errors that zipfile raises for a file that is damaged or not an archive, besides ValueError."""
_BROKEN = (*BROKEN_ARCHIVE, ValueError, tokenize.TokenError, SyntaxError, OverflowError)
"""The same, and those of numpy over the header of an array."""
_READERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}

Kind: TypeAlias = tuple[Any, tuple[int | None, ...]]
"""Type and shape of an array; None = any length."""


class ArchiveError(ValueError):
    """No archive of arrays, a damaged one, or one of other arrays than were expected."""


def open_arrays(path: Path, most_bytes: int) -> zipfile.ZipFile:
    """Return an archive, its arrays not read yet.

    Args:
        path: The file.
        most_bytes: What it may have, in the file and unpacked.

    Raises:
        OSError: the file cannot be read.
        ArchiveError: it is no archive of so many bytes.
    """
    size = path.stat().st_size
    if size > most_bytes:
        raise ArchiveError(f"The file has {size:,} bytes, but at most {most_bytes:,} are expected.")
    content = path.read_bytes()
    if not content:
        raise ArchiveError("The file is empty.")
    if not content.startswith(_FIRST):
        raise ArchiveError("The file is not an .npz archive.")
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except _BROKEN as error:
        raise ArchiveError("The file is a damaged .npz archive; its table of contents cannot be read.") from error
    size = sum(part.file_size for part in archive.infolist())
    if size > most_bytes:
        raise ArchiveError(f"The archive has {size:,} bytes unpacked, but at most {most_bytes:,} are expected.")
    return archive


def read_array(stored: zipfile.ZipFile, name: str, kind: Kind | None = None) -> np.ndarray:
    """Return an array; its header must agree with its bytes before memory is taken for it.

    Args:
        stored: The archive.
        name: Name of the array.
        kind: What it must be, and then of finite numbers; None = a plain array of whatever type and shape.

    Raises:
        ArchiveError: there is none of the name, it is damaged, or of another kind.
    """
    try:
        about = stored.getinfo(f"{name}.npy")
    except KeyError as error:
        raise ArchiveError(f"The archive has no part {name!r}; it is damaged, or holds something else.") from error
    try:
        with stored.open(about) as file:
            shape, _, dtype = _READERS[np.lib.format.read_magic(file)](file)
            if kind is not None:
                check_kind(name, dtype, shape, *kind)
            content = file.read(about.file_size)
        if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(content):
            raise ValueError("the header tells of another array than the bytes that follow")
        array = np.load(io.BytesIO(stored.read(about)), allow_pickle=False)
        if kind is not None:
            check_array(name, array, *kind)
    except ConfigError as error:
        raise ArchiveError(str(error)) from error
    except _BROKEN as error:
        raise ArchiveError(f"Its part {name!r} is damaged, or not a plain array of numbers or text.") from error
    return array
