"""Archives of arrays (.npz), which anybody may have written: reading one runs no code."""

import io
from pathlib import Path

import numpy as np


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
