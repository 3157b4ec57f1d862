"""The arrays of a replay page, read number by number."""

import base64
import json
import re
import struct
import zlib
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

_PARTS = re.compile(r'<script type="(?:application/json|text/plain)"[^>]*>(.*?)</script>')


def runs_of(page: str | Path) -> list[tuple[dict[str, Any], dict[str, np.ndarray]]]:
    """Return what the header of a page says of each run, and its arrays by name."""
    header, *data = _PARTS.findall(page if isinstance(page, str) else page.read_text(encoding="utf-8"))
    runs = zip(json.loads(header)["runs"], map(base64.b64decode, data), strict=True)
    return [(about, {place["name"]: _array(place, block) for place in about["arrays"]}) for about, block in runs]


def _array(place: dict[str, Any], block: bytes) -> np.ndarray:
    raw = zlib.decompress(block[place["offset"] : place["offset"] + place["size"]])
    return unpacked(raw, np.dtype(f"<{place['dtype']}"), place["shape"])


def unpacked(raw: bytes, dtype: np.dtype, shape: tuple[int, ...]) -> np.ndarray:
    """Undo what `coding` says: bytes, zigzag numbers, the first axis last, differences along it."""
    if dtype.kind == "f":
        return np.array([one for (one,) in struct.iter_unpack("<f", raw)], dtype).reshape(shape)
    n, size = len(raw) // dtype.itemsize, dtype.itemsize
    found = np.zeros(shape, dtype)
    codes = iter(sum(raw[byte * n + one] << 8 * byte for byte in range(size)) for one in range(n))
    for others in product(*map(range, shape[1:])):
        value = 0
        for first in range(shape[0]):
            code = next(codes)
            value += code // 2 if code % 2 == 0 else -(code + 1) // 2
            whole = value % 256**size
            found[first, *others] = whole - 256**size * (dtype.kind == "i" and whole >= 256**size // 2)
    return found
