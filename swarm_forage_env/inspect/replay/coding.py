"""Arrays of a replay as compressed bytes, and back.

An integer array is coded in four steps: differences along its first axis, from zero on, modulo the range of its type;
"zigzag" numbers, 0 -1 1 -2 2 as 0 1 2 3 4, so that small changes of either sign have a high byte of zero; the first
axis last, so that what one robot does lies together; and all lowest bytes before all next ones. zlib then finds little
that is not a surprise. An array of floats goes to zlib as it is.
"""

import math
import zlib
from typing import Any

import numpy as np

from swarm_forage_env.inspect.replay.frames import ReplayError

DTYPES = ("u1", "u2", "i4", "f4")
"""Types of arrays in a replay, little-endian; the page knows the same."""
MOST_BYTES = 2**31
"""Bytes of one array that are unpacked at most, for files may be anybody's. Our choice: three times the positions of
16,384 robots in 10,000 frames."""
_LEVEL = 9


def pack(array: np.ndarray) -> bytes:
    """Return an array of one of `DTYPES` as compressed bytes."""
    if array.dtype.kind == "f":
        return zlib.compress(np.ascontiguousarray(array, "<f4").tobytes(), _LEVEL)
    size = array.dtype.itemsize
    rows = np.moveaxis(array, 0, -1).astype(np.int64)
    half = 1 << (8 * size - 1)
    changes = (np.diff(rows, prepend=0) + half) % (2 * half) - half
    zigzag = np.where(changes < 0, -2 * changes - 1, 2 * changes).astype(f"<u{size}")
    planes = np.ascontiguousarray(zigzag).reshape(-1).view(np.uint8).reshape(-1, size).T
    return zlib.compress(planes.tobytes(), _LEVEL)


def unpack(packed: bytes, dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return the array that `pack` has packed.

    Args:
        packed: The compressed bytes.
        dtype: One of `DTYPES`.
        shape: Shape of the array.

    Raises:
        ReplayError: bytes that are damaged, or of an array of another size, or of more than `MOST_BYTES`.
    """
    if dtype not in DTYPES:
        raise ReplayError(f"Expected arrays of the types {', '.join(DTYPES)}, got {dtype!r}.")
    size = int(dtype[1])
    expected = size * math.prod(shape)
    if expected > MOST_BYTES:
        raise ReplayError(
            f"Expected arrays of at most {MOST_BYTES:,} bytes, got one of shape {shape}; write the replay with fewer "
            "frames (--frame, --seconds)."
        )
    unpacking = zlib.decompressobj()
    try:
        raw = unpacking.decompress(packed, expected + 1)  # no more, however much is packed
    except zlib.error as error:
        raise ReplayError(f"Expected compressed numbers, got damaged ones ({error}).") from error
    if len(raw) <= expected and not unpacking.eof:
        raise ReplayError("Expected compressed numbers, got some that are cut short.")
    if len(raw) != expected:
        came = "more" if len(raw) > expected else str(len(raw))
        raise ReplayError(f"Expected {expected} bytes for an array of shape {shape}, got {came}.")
    if dtype == "f4":
        return np.frombuffer(raw, "<f4").reshape(shape)
    planes = np.frombuffer(raw, np.uint8).reshape(size, -1).T
    zigzag = np.ascontiguousarray(planes).reshape(-1).view(f"<u{size}").astype(np.int64)
    changes = np.where(zigzag % 2 == 1, -(zigzag + 1) // 2, zigzag // 2)
    rows = np.cumsum(changes.reshape(*shape[1:], shape[0]), axis=-1)
    wrapped: Any = rows.astype(f"<{dtype}")  # modulo the range of the type
    return np.ascontiguousarray(np.moveaxis(wrapped, -1, 0))
