"""Files that are there complete or not at all, whether they can be written, and what JSON and TOML of anybody's say."""

import errno
import json
import os
import re
import tomllib
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

import msgspec

_PROBE = bytes(1 << 16)
"""What a folder must have room for, as large as a small record (our choice)."""
_NO_LOCKS = (errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""How disks answer that keep no locks, or none of folders, as some network disks do."""


@contextmanager
def replacing(path: Path, *, ending: str = ".tmp") -> Generator[Path]:
    """Give a draft beside `path` to write to; it takes the place of `path` when all went well, else it is removed.

    No two drafts have the same name, whichever threads, processes or machines write to the folder. It is made if it is
    missing. A link stays one: the file that it leads to is replaced.

    Args:
        path: File to create or replace.
        ending: Of the draft's name, for libraries that choose a format by it.

    Raises:
        OSError: it cannot be written, or is a folder, a device or a pipe; the error names `path`.
    """
    _check_regular(path)
    path = path.resolve() if path.is_symlink() else path
    draft = path.with_name(f".{path.name[:50]}.{uuid4().hex}{ending}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield draft
        draft.replace(path)
    except OSError as error:
        if error.filename not in (None, str(draft)):  # it is about another file
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def alone_in(folder: Path, refusal: type[ValueError] | None = None) -> Generator[None]:
    """Keep a folder to this process, as long as others ask in the same way.

    It is made if it is missing, with the folders around it; what was made is removed if it is still empty at the end.
    The system forgets the lock when the process ends, however it ends, and nothing of it is in the folder. Where the
    system or the disk has no such locks (Windows, some network disks), everybody is let in.

    Args:
        folder: The folder.
        refusal: What is raised while another process has the folder; None = wait until it has ended.

    Raises:
        ValueError: `refusal`, see there.
        OSError: the folder cannot be made or opened.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    opened = _locked(folder, refusal)
    try:
        yield
    finally:
        with suppress(OSError):  # one of them holds something
            for place in made:
                place.rmdir()
        if opened is not None:
            os.close(opened)


def _locked(folder: Path, refusal: type[ValueError] | None) -> int | None:
    """Lock a folder; returns what to close, None where there are no locks."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock
    except ImportError:
        return None
    opened = os.open(folder, os.O_RDONLY)
    try:
        flock(opened, LOCK_EX if refusal is None else LOCK_EX | LOCK_NB)
        if folder.exists() and folder.stat().st_ino == os.fstat(opened).st_ino:
            return opened
    except BaseException as error:
        os.close(opened)
        if isinstance(error, BlockingIOError) and refusal is not None:
            raise refusal(
                f"Expected to be the only one that writes to {folder}, but another command does; wait until it has "
                "ended, or give another --out."
            ) from error
        if isinstance(error, OSError) and error.errno in _NO_LOCKS:
            return None
        raise
    os.close(opened)  # whoever had it found it empty, and removed it
    return _locked(folder, refusal)


def check_folder(folder: Path) -> None:
    """Try whether a folder, there or still to be made, can be written to, before hours of work; nothing of it stays.

    Raises:
        OSError: it cannot be made or written to; the error names the folder.
    """
    place = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not place.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    probe = place / f".{uuid4().hex}.tmp"
    try:
        probe.write_bytes(_PROBE)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from error
    finally:
        probe.unlink(missing_ok=True)


def check_file(path: Path) -> None:
    """Refuse a file that cannot be written, before the work whose result it takes; see `check_folder`.

    Raises:
        OSError: there is a folder, a device or a pipe of that name, or its folder cannot be written to.
    """
    _check_regular(path)
    check_folder((path.resolve() if path.is_symlink() else path).parent)


def _check_regular(path: Path) -> None:
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "a device or a pipe"
        raise OSError(errno.EINVAL, f"Expected a file to write, got {kind}", str(path))


def as_file_name(text: str) -> str:
    """Return a text as a part of a file name: what is no letter, digit, dot, = + or - becomes an underscore."""
    return re.sub(r"[^\w.=+-]", "_", text)


def parse_json(text: str) -> Any:
    """Return what a JSON text holds; ValueError for no JSON, or one that is nested too deep."""
    return _parsed(msgspec.json.decode, text)


def json_text(what: str, value: Any, **options: Any) -> str:
    """Return a value as JSON; ValueError for what JSON cannot hold, such as infinity."""
    try:
        return json.dumps(value, allow_nan=False, **options)
    except (RecursionError, TypeError, ValueError) as error:
        raise ValueError(f"Expected {what} to be plain JSON values: {error}.") from error


def read_json(path: Path, refusal: type[ValueError]) -> Any:
    """Return what a JSON file holds.

    Args:
        path: The file.
        refusal: What is raised where it cannot be used; the message names the file.

    Raises:
        ValueError: `refusal`: there is no such file, or see `parse_json`.
    """
    try:
        return parse_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise refusal(f"Cannot read {path}: {error.strerror or error}.") from error
    except ValueError as error:
        raise refusal(f"Cannot use {path}: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text; ValueError for no TOML, or one that is nested too deep."""
    return _parsed(tomllib.loads, text)


def _parsed(parse: Callable[[str], Any], text: str) -> Any:
    try:
        return parse(text)
    except RecursionError as error:
        raise ValueError("Expected fewer nested levels, got more than can be read.") from error
