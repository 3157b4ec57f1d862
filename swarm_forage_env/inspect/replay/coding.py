"""Arrays of a replay as compressed bytes, and back.

An integer array is coded in four steps: differences along its first axis, from zero on, modulo the range of its type;
"zigzag" numbers, 0 -1 1 -2 2 as 0 1 2 3 4, so that small changes of either sign have a high byte of zero; the first
axis last, so that what one robot does lies together; and all lowest bytes before all next ones. zlib then finds little
that is not a surprise. An array of floats goes to zlib as it is. The page does the same in `decode.js`.
"""

import math
import zlib

import numpy as np

from swarm_forage_env._internal.fields import ConfigError

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


def unpack(packed: bytes, dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return the array that `pack` has packed.

    Args:
        packed: The compressed bytes.
        dtype: "u1", "u2", "i4" or "f4".
        shape: Shape of the array.

    Raises:
        ConfigError: bytes that are damaged, or of an array of another size.
    """
    size = int(dtype[1])
    try:
        raw = zlib.decompress(packed)
    except zlib.error as error:
        raise ConfigError(f"Expected compressed numbers, got damaged ones ({error}).") from error
    if len(raw) != size * math.prod(shape):
        raise ConfigError(f"Expected numbers of an array of shape {shape}, got {len(raw)} bytes.")
    if dtype == "f4":
        return np.frombuffer(raw, "<f4").reshape(shape)
    zigzag = np.frombuffer(raw, np.uint8).reshape(size, -1).T.copy().reshape(-1).view(f"<u{size}")
    changes = (zigzag >> 1 ^ -(zigzag & 1)).reshape(*shape[1:], shape[0])
    rows = np.cumsum(changes, axis=-1, dtype=changes.dtype)  # modulo the range of the type
    return np.ascontiguousarray(np.moveaxis(rows.view(f"<{dtype}"), -1, 0))
