"""Arrays of a replay as compressed bytes, and back.

An integer array is coded in four steps: differences along its first axis, from zero on, modulo the range of its type;
"zigzag" numbers, 0 -1 1 -2 2 as 0 1 2 3 4, so that small changes of either sign have a high byte of zero; the first
axis last, so that what one robot does lies together; and all lowest bytes before all next ones. zlib then finds little
that is not a surprise. An array of floats goes to zlib as it is.
"""

import math
import zlib

import numpy as np

from swarm_forage_env.inspect.replay.frames import ReplayError

DTYPES = ("u1", "u2", "i4", "f4")
"""Types of arrays in a replay, little-endian; the page knows the same."""
_LEVEL = 9


def pack(array: np.ndarray) -> bytes:
    """Return an array of one of `DTYPES` as compressed bytes."""
    if array.dtype.kind == "f":
        return zlib.compress(np.ascontiguousarray(array, "<f4").tobytes(), _LEVEL)
    size = array.dtype.itemsize
    rows = np.moveaxis(array, 0, -1).astype(f"<u{size}", order="C")
    changes = np.diff(rows, prepend=rows.dtype.type(0)).view(f"<i{size}")  # unsigned, so modulo the range
    del rows
    signs = changes >> (8 * size - 1)
    changes <<= 1
    changes ^= signs
    del signs
    planes = changes.reshape(-1).view(np.uint8).reshape(-1, size).T
    return zlib.compress(planes.tobytes(), _LEVEL)


def unpack(packed: bytes, dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return the array that `pack` has packed.

    Args:
        packed: The compressed bytes.
        dtype: One of `DTYPES`.
        shape: Shape of the array.

    Raises:
        ReplayError: bytes that are damaged, or of an array of another size.
    """
    if dtype not in DTYPES:
        raise ReplayError(f"Expected arrays of the types {', '.join(DTYPES)}, got {dtype!r}.")
    size = int(dtype[1])
    expected = size * math.prod(shape)
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
    # In the type itself, step by step in place: an array may be as large as memory allows.
    rows = np.frombuffer(raw, np.uint8).reshape(size, -1).T.copy().reshape(-1).view(f"<u{size}")
    del raw
    odd = rows & rows.dtype.type(1)
    rows >>= 1
    np.negative(odd, out=odd)
    rows ^= odd
    del odd
    rows = rows.reshape(*shape[1:], shape[0])
    np.cumsum(rows, axis=-1, dtype=rows.dtype, out=rows)  # modulo the range of the type
    return np.ascontiguousarray(np.moveaxis(rows.view(f"<{dtype}"), -1, 0))
