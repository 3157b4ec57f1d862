"""Valid files of every format, changed by field or by byte, and given to the command that reads them.

A change is a wrong type, a number out of bounds, NaN, a key or column that is missing, renamed or new; a file is cut
off, or some of its bytes are others. Digests are made to fit where the change is inside, so that it is read.
"""

import copy
import json
import math
import shutil
from collections.abc import Callable, Mapping
from functools import cache
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import polars as pl

from swarm_forage_env.policies.pretrained import network_file, plan_file
from swarm_forage_env.training.datasets.reading import TrajectoryDataset
from tests.support.curve_tables import CROWDING
from tests.support.forged import forge_record, forge_study
from tests.support.kills import STUDY
from tests.support.malformed import BAD_LITERALS, outcome

FILES = Path(__file__).parents[1] / "files"
SUPPORT = Path(__file__).parent
BAD: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 0.5, 1e308, -1e308, 1e-320, 10**320, 2**63, 2**31, 1_000_000_000, "", "x", [], {}, [1, 2]),
    *(math.nan, math.inf, "../../x", "/tmp/x", "evil.zip", "\x1b[31m", "\ud800", "x" * 5000, [[]], {"a": 1}, "none"),
)
SCENARIO = """
scenario = "warehouse_small"
[set]
n_robots = 3
n_objects = 20
nest_size_m = [2.0, 4.0]
obstacles = [[14.0, 4.0, 14.4, 12.0]]
[wrappers.throttle]
waveform = "square"
amplitude = 0.2
period_s = 500.0
[wrappers.sensor_noise]
sigma = 0.1
"""


def changed_file(random: Random, folder: Path, kind: str) -> tuple[str, ...]:
    """Write a changed file of a format into a folder, and draw a command that reads it; returns its words.

    A file that no command reads is read by Python: the words are "python" and the file.
    """
    make, commands = FORMATS[kind]
    file = make(random, folder)
    if random.random() < 0.25 and file.is_file():
        file.write_bytes(_other_bytes(random, file.read_bytes()))
    return tuple(word.replace("FILE", str(file)) for word in random.choice(commands).split())


def what_is_wrong(words: tuple[str, ...], folder: Path) -> tuple[int, str]:
    """Give words to the command, in the current folder; returns its exit code, and the fault or nothing."""
    before = {file for file in folder.iterdir() if file != Path.cwd()}
    if words[0] == "python":
        code, fault = _read_by_python(Path(words[1]))
    else:
        ended = outcome(words)
        code, fault = ended.code, ended.fault
        if not fault and "Not enough memory" in ended.errors:
            fault = ended.errors
    new = {file for file in folder.iterdir() if file != Path.cwd()} - before
    return code, fault or (f"wrote {', '.join(map(str, new))}" if new else "")


def _read_by_python(place: Path) -> tuple[int, str]:
    try:
        for _ in TrajectoryDataset(place).chunks():
            pass
    except (ValueError, OSError) as error:
        ours = isinstance(error, OSError) or type(error).__module__.startswith("swarm_forage_env")
        return 2, "" if ours else repr(error)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a fault
        return 70, repr(error)
    return 0, ""


def _other_bytes(random: Random, content: bytes) -> bytes:
    if not content or random.random() < 0.3:
        return content[: random.randrange(len(content) + 1)]
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 4, 40))):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def _change(random: Random, content: Any) -> Any:
    """Return nested plain values of which some are others, gone, renamed or new."""
    content = copy.deepcopy(content)
    for _ in range(random.choice((0, 1, 1, 1, 2))):
        if random.random() < 0.02 or not isinstance(content, dict | list) or not content:
            return random.choice(BAD)
        place = content
        while True:
            key = random.choice(list(place)) if isinstance(place, dict) else random.randrange(len(place))
            inner = place[key]
            if not isinstance(inner, dict | list) or not inner or random.random() < 0.2:
                break
            place = inner
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


def _dumped(content: Any) -> str:
    return json.dumps(content)


def _lines(random: Random, text: str) -> str:
    """Return TOML with other values and names, and lines that are gone or there twice."""
    lines = text.splitlines()
    places = [k for k, line in enumerate(lines) if "=" in line]
    for place in random.sample(places, min(len(places), random.choice((0, 1, 1, 1, 2)))):
        key, _, value = lines[place].partition("=")
        lines[place] = random.choice(
            (*(f"{key}= {random.choice(BAD_LITERALS)}" for _ in range(5)), "", f"{key.strip()}x ={value}",
             f"{lines[place]}\n{lines[place]}", f"further = 1\n{lines[place]}")
        )  # fmt: skip
    return "\n".join(lines)


def _other_table(random: Random, frame: pl.DataFrame) -> pl.DataFrame:
    for _ in range(random.choice((0, 1, 1, 1, 2))):
        name = random.choice(frame.columns)
        how = random.randrange(6)
        if how == 0:
            frame = frame.drop(name)
        elif how == 1:
            new = random.choice(("new", f"{name}_", "é"))
            if new not in frame.columns:
                frame = frame.rename({name: new})
        elif how == 2:
            frame = frame.with_columns(further=pl.lit(random.choice((1, 0.5, "x", True, None, math.nan, b"x"))))
        elif how == 3:
            frame = random.choice((frame.head(0), frame.head(1), frame.reverse(), pl.concat([frame, frame])))
        else:
            value = random.choice((None, True, -1, 0, 2**31, 2**62, 0.5, 1e308, math.nan, math.inf, "", "../x", b"x"))
            if how == 4:
                frame = frame.with_columns(pl.lit(value).alias(name))
            else:  # one value, where the type lets it
                row = random.randrange(max(1, len(frame)))
                one = pl.when(pl.int_range(pl.len()) == row).then(pl.lit(value).cast(frame[name].dtype, strict=False))
                try:
                    frame = frame.with_columns(one.otherwise(pl.col(name)).alias(name))
                except pl.exceptions.PolarsError:
                    frame = frame.with_columns(pl.lit(value).alias(name))
        if not frame.width:
            break
    return frame


def _record(random: Random, folder: Path) -> Path:
    parts = {name: f"swarm_forage_env.{name}" for name in ("spec", "provenance")}
    return _forged(random, forge_record, FILES / "record.parquet", folder / "record.parquet", parts)


def _packed(random: Random, folder: Path) -> Path:
    parts = {name: f"swarm_forage_env.study.{name}" for name in ("study", "versions")}
    return _forged(random, forge_study, SUPPORT / "blessed_noise.parquet", folder / "packed.parquet", parts)


def _forged(random: Random, forge: Callable[..., Any], source: Path, file: Path, parts: Mapping[str, str]) -> Path:
    """Change the table or one part of the stamp, and seal the file anew; `parts` has the key of each part."""
    stamp = pl.read_parquet_metadata(source)
    part = (None, *parts)[random.randrange(1 + len(parts))]
    if part is None:
        forge(source, file, frame=lambda frame: _other_table(random, frame))
    else:
        forge(source, file, **{part: _dumped(_change(random, json.loads(stamp[parts[part]])))})
    return file


def _toml(name: str, text: Callable[[], str]) -> Callable[[Random, Path], Path]:
    def make(random: Random, folder: Path) -> Path:
        file = folder / name
        file.write_text(_lines(random, text()), encoding="utf-8")
        return file

    return make


def _entry(random: Random, folder: Path) -> Path:
    file = folder / "entry.json"
    file.write_text(_dumped(_change(random, json.loads((FILES / "entry.json").read_text()))))
    return file


def _failure(random: Random, folder: Path) -> Path:
    file = folder / "failure.json"
    file.write_text(_dumped(_change(random, json.loads((FILES / "failure.json").read_text()))))
    return file


def _page(random: Random, folder: Path) -> Path:
    file, text = folder / "page.html", (FILES / "replay.html").read_text(encoding="utf-8")
    begin = text.index(">", text.index('id="header"')) + 1
    end = text.index("</script>", begin)
    header = _dumped(_change(random, json.loads(text[begin:end])))
    file.write_text(text[:begin] + header.replace("<", "\\u003c") + text[end:], encoding="utf-8")
    return file


def _other_arrays(random: Random, source: Path, file: Path) -> None:
    with np.load(source) as stored:
        parts = dict(stored)
    name = random.choice(list(parts))
    if parts[name].dtype.kind == "U" and parts[name].ndim == 0:
        parts[name] = np.array(_dumped(_change(random, json.loads(str(parts[name])))))
    else:
        values = parts[name]
        parts[name] = random.choice(
            (values.astype(np.float64), np.full(values.shape, np.inf, "f4"), values[:0], values[None],
             values.astype("f8") + 1e300, values.astype("U5"), values.T, -values.astype("f4"), values.astype("i1"))
        )  # fmt: skip
    if random.random() < 0.15:
        parts[f"{name}_"] = parts.pop(name)
    content = BytesIO()
    np.savez(content, **parts)
    file.write_bytes(content.getvalue())


def _network(random: Random, folder: Path) -> Path:
    source = network_file("ppo_warehouse_small")
    assert source is not None
    _other_arrays(random, source, folder / "network.npz")
    return folder / "network.npz"


def _dataset(random: Random, folder: Path) -> Path:
    place = folder / "dataset"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(FILES / "dataset", place)
    file = random.choice(sorted(place.iterdir()))
    if random.random() < 0.2:
        file.write_bytes(_other_bytes(random, file.read_bytes()))
    elif file.suffix == ".npz":
        _other_arrays(random, file, file)
    else:
        file.write_text(_dumped(_change(random, json.loads(file.read_text()))))
    return place


def _curves(random: Random, folder: Path) -> Path:
    frame = _other_table(random, CROWDING)
    file = folder / random.choice(("curves.csv", "curves.parquet"))
    if file.suffix == ".csv":
        plain = [name for name in frame.columns if frame[name].dtype != pl.Binary]
        frame.select(plain).write_csv(file)
    else:
        frame.write_parquet(file)
    return file


@cache
def _plan_text() -> str:
    source = plan_file("ppo_warehouse_small")
    assert source is not None
    return source.read_text(encoding="utf-8")


FORMATS: dict[str, tuple[Callable[[Random, Path], Path], tuple[str, ...]]] = {
    "record": (_record, ("rerun FILE", "maps FILE --picture out.png")),
    "packed": (_packed, ("study status FILE", "study unpack FILE --out out", "study diff FILE FILE")),
    "study": (_toml("study.toml", lambda: STUDY), ("study show FILE", "study run FILE --dry-run --jobs 1")),
    "scenario": (_toml("world.toml", lambda: SCENARIO), ("info FILE", "run random --scenario FILE --seeds 1")),
    "entry": (_entry, ("benchmark show FILE",)),
    "failure": (_failure, ("rerun FILE",)),
    "replay": (_page, ("maps FILE --picture out.png",)),
    "dataset": (_dataset, ("python FILE",)),
    "network": (_network, ("info FILE", "export FILE --file out.h", "run FILE --robots 3 --objects 20 --seeds 1")),
    "plan": (_toml("plan.toml", _plan_text), ("train --plan FILE --dry-run",)),
    "curves": (_curves, ("score --curves FILE --picture out.png", "predict --curves FILE --picture out.png")),
}
"""Format -> what writes a changed file of it, and the commands that read it."""
