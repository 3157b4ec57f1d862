"""Archives of arrays (.npz), which anybody may have written: reading one runs no code."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError


class ArchiveError(ValueError):
    """No archive of plain arrays, or a damaged one."""


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of an archive by name.

    Raises:
        OSError: the file cannot be read.
        ArchiveError: it is no archive of numbers and texts, or a damaged one.
    """
    content = path.read_bytes()
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            return dict(stored.items())
    except Exception as error:  # what zipfile and numpy raise depends on where a file is damaged
        raise ArchiveError("The file is no .npz archive of plain arrays, or a damaged one.") from error


def check_array(where: str, given: np.ndarray, dtype: Any, shape: tuple[int | None, ...]) -> None:
    """Refuse an array of another type or shape, or one of numbers that are not finite.

    Args:
        where: Name of the array, for the message.
        given: The array.
        dtype: What it must be, byte order included; nothing is converted.
        shape: The same; None = any length.

    Raises:
        ConfigError: see above.
    """
    fits = given.ndim == len(shape) and all(
        length in (None, there) for length, there in zip(shape, given.shape, strict=True)
    )
    if not fits or given.dtype != dtype:
        lengths, wanted = ", ".join("any" if length is None else str(length) for length in shape), np.dtype(dtype).name
        raise ConfigError(
            f"Expected {where} to be an array ({lengths}) of {wanted}, got {given.shape} of {given.dtype.name}."
        )
    if given.dtype.kind == "f" and not np.isfinite(given).all():
        raise ConfigError(f"Expected {where} to hold finite numbers, got some that are none.")
