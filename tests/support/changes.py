"""Small changes of valid content: of bytes, nested values, lines of TOML, tables and arrays; content stays as it is.

A change is a wrong type, a number out of bounds, NaN, a key or column that is missing, renamed or new; content is cut
off, or some of its bytes are others.
"""

import copy
import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import BytesIO
from random import Random
from typing import Any

import numpy as np
import polars as pl

from tests.support.malformed import BAD_LITERALS

BAD: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 0.5, 1e308, -1e308, 1e-320, 10**320, 2**63, 2**31, 1_000_000_000, "", "x", [], {}, [1, 2]),
    *(math.nan, math.inf, "../../x", "/tmp/x", "evil.zip", "\x1b[31m", "\ud800", "x" * 5000, [[]], {"a": 1}, "none"),
)
BAD_CELLS = (None, True, -1, 0, 2**31, 2**62, 0.5, 1e308, math.nan, math.inf, "", "../x", b"x")
HOW_OFTEN = (0, 1, 1, 1, 2)
"""Changes of one file."""


def other_bytes(random: Random, content: bytes) -> bytes:
    """Return content that is cut off, or some of whose bytes are others."""
    if not content or random.random() < 0.3:
        return content[: random.randrange(len(content) + 1)]
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 4, 40))):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def other_values(random: Random, content: Any) -> Any:
    """Return nested plain values of which some are others, gone, renamed or new."""
    for _ in range(random.choice(HOW_OFTEN)):
        content = _other_value(random, content)
    return content


def _other_value(random: Random, content: Any) -> Any:
    if random.random() < 0.02 or not isinstance(content, dict | list) or not content:
        return random.choice(BAD)
    place = content = copy.copy(content)
    while True:
        key = random.choice(list(place)) if isinstance(place, dict) else random.randrange(len(place))
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or random.random() < 0.2:
            break
        place[key] = place = copy.copy(inner)
    how = random.random()
    if how < 0.6:
        place[key] = random.choice(BAD)
    elif how < 0.75 or isinstance(place, list):
        del place[key]
    elif how < 0.9:
        place[random.choice(("new", "", "name", "seed", f"{key}_"))] = place.pop(key)
    else:
        place["further"] = random.choice(BAD)
    return content


def other_json(random: Random, content: Any, seal: Callable[[Any], None] = lambda content: None) -> str:
    """Return changed values as JSON; mostly with digests that fit, which `seal` puts into what it can."""
    changed = other_values(random, content)
    if random.random() < 0.8:
        with suppress(TypeError, ValueError, LookupError, AttributeError, OverflowError, RecursionError):
            seal(changed)  # else nobody will look at its digest
    return json.dumps(changed)


def other_lines(random: Random, text: str) -> str:
    """Return TOML with other values and names, and lines that are gone or there twice."""
    lines = text.splitlines()
    places = [k for k, line in enumerate(lines) if "=" in line]
    for place in random.sample(places, min(len(places), random.choice(HOW_OFTEN))):
        key, _, value = lines[place].partition("=")
        how = random.randrange(9)
        if how < 5:
            lines[place] = f"{key}= {random.choice(BAD_LITERALS)}"
        else:
            renamed, twice = f"{key.strip()}x ={value}", f"{lines[place]}\n{lines[place]}"
            lines[place] = ("", renamed, twice, f"further = 1\n{lines[place]}")[how - 5]
    return "\n".join(lines)


def other_table(random: Random, frame: pl.DataFrame) -> pl.DataFrame:
    """Return a table with other columns, rows and values."""
    for _ in range(random.choice(HOW_OFTEN)):
        if frame.width:
            frame = _other_part(random, frame, random.choice(frame.columns))
    return frame


def _other_part(random: Random, frame: pl.DataFrame, name: str) -> pl.DataFrame:
    how = random.randrange(6)
    if how == 0:
        return frame.drop(name)
    if how == 1:
        new = random.choice(("new", f"{name}_", "é"))
        return frame if new in frame.columns else frame.rename({name: new})
    if how == 2:
        return frame.with_columns(further=pl.lit(random.choice((1, 0.5, "x", True, None, math.nan, b"x"))))
    if how == 3:
        return random.choice((frame.head(0), frame.head(1), frame.reverse(), pl.concat([frame, frame])))
    value = random.choice(BAD_CELLS)
    if how == 4:
        return frame.with_columns(pl.lit(value).alias(name))
    row = random.randrange(max(1, len(frame)))
    one = pl.when(pl.int_range(pl.len()) == row).then(pl.lit(value).cast(frame[name].dtype, strict=False))
    try:
        return frame.with_columns(one.otherwise(pl.col(name)).alias(name))
    except pl.exceptions.PolarsError:  # the type does not let it
        return frame.with_columns(pl.lit(value).alias(name))


def other_arrays(random: Random, parts: Mapping[str, np.ndarray]) -> bytes:
    """Return an archive of arrays (.npz) of which one is another; texts are taken for JSON."""
    changed = dict(parts)
    name = random.choice(list(changed))
    values = changed[name]
    if values.dtype.kind == "U" and values.ndim == 0:
        changed[name] = np.array(other_json(random, json.loads(str(values))))
    else:
        changed[name] = _other_array(random, values)
    if random.random() < 0.15:
        changed[f"{name}_"] = changed.pop(name)
    content = BytesIO()
    np.savez(content, **changed)
    return content.getvalue()


def _other_array(random: Random, values: np.ndarray) -> np.ndarray:
    how = random.randrange(10)
    if how == 9:  # one value
        changed = values.copy()
        changed.reshape(-1)[random.randrange(values.size or 1) :][:1] = random.choice((0, 1, -1, 100))
        return changed
    with np.errstate(all="ignore"):
        return (
            values.astype(np.float64), np.full(values.shape, np.inf, "f4"), values[:0], values[None],
            values.astype("f8") + 1e300, values.astype("U5"), values.T, -values.astype("f4"), values.astype("i1"),
        )[how]  # fmt: skip
