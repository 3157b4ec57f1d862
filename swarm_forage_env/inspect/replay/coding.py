"""Arrays of a replay as compressed bytes.

An integer array is coded in four steps: differences along its first axis, from zero on, modulo the range of its type;
"zigzag" numbers, 0 -1 1 -2 2 as 0 1 2 3 4, so that small changes of either sign have a high byte of zero; the first
axis last, so that what one robot does lies together; and all lowest bytes before all next ones. zlib then finds little
that is not a surprise. An array of floats goes to zlib as it is. The page undoes it in `decode.js`.
"""

import zlib

import numpy as np

_LEVEL = 9


def pack(array: np.ndarray) -> bytes:
    """Return an array of uint8, uint16, int32 or float32 as compressed bytes."""
    if array.dtype.kind == "f":
        return zlib.compress(np.ascontiguousarray(array, "<f4").tobytes(), _LEVEL)
    size = array.dtype.itemsize
    rows = np.moveaxis(array, 0, -1).astype(f"<u{size}", order="C")
    changes = np.diff(rows, prepend=rows.dtype.type(0)).view(f"<i{size}")  # unsigned, so modulo the range
    zigzag = changes << 1 ^ changes >> (8 * size - 1)
    return zlib.compress(zigzag.reshape(-1).view(np.uint8).reshape(-1, size).T.tobytes(), _LEVEL)
