"""Valid files of every format, changed by field or by byte, and given to what reads them.

Most go to the reader of their format, which must return or raise an error that it documents, in little memory, without
a word on stderr and without writing anything. Every `EVERY`-th goes through a whole command, which reads it in the same
way and then uses it. Digests are mostly made to fit where the change is inside, so that it is read.
"""

import base64
import contextlib
import json
import os
import re
import resource
import shlex
import shutil
import stat
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import polars as pl

from metrics.benchmark import BenchmarkError, load_protocol, read_entry
from metrics.benchmark import entry as benchmark_entry
from metrics.benchmark.protocol import Protocol
from metrics.checks import CurveError
from metrics.scoring.curves_file import read_curves
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.app import PACKAGES
from swarm_forage_env.inspect.replay import files as replay_files
from swarm_forage_env.inspect.replay.coding import pack, unpack
from swarm_forage_env.inspect.replay.frames import ReplayError
from swarm_forage_env.policies.model_files import ModelError, open_network
from swarm_forage_env.policies.network import NetworkError
from swarm_forage_env.policies.pretrained import network_file, plan_file
from swarm_forage_env.rendering.pages import take_replay_page_apart
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import read_failure
from swarm_forage_env.studies.study_file import load_study
from swarm_forage_env.studies.study_table import read_study
from swarm_forage_env.training.datasets.layout import DatasetError
from swarm_forage_env.training.datasets.reading import TrajectoryDataset
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.wrappers.world import read_world
from tests.support.changes import other_arrays, other_bytes, other_json, other_lines, other_table
from tests.support.curve_tables import CROWDING
from tests.support.entries import TINY
from tests.support.forged import forge_record, forge_study
from tests.support.kills import STUDY
from tests.support.malformed import outcome

FILES = Path(__file__).parents[1] / "files"
SUPPORT = Path(__file__).parent
EVERY = 200
"""Of so many cases, one is a command."""
MOST_GROWN = 2**30
"""By so many bytes at most may the memory of this process grow in a case; our choice."""
PEAK = Path("/proc/self/status")
"""Where Linux says how much memory this process has held."""
OF_THE_RUN = re.compile(
    r"^((swarm_forage_env|baselines)\.\S*Error: .*"
    r"|TypeError: \S+\(\) (got an unexpected keyword argument|takes no arguments).*)\n"
    r"swarm-forage: the run failed again$",
    re.MULTILINE,
)
"""How `rerun` ends for a failure of a run that cannot be made: it shows the traceback of whatever fails."""
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


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of file."""

    make: Callable[[Random, Path], Path]
    """Writes a changed file into a folder."""
    read: Callable[[Path], Any]
    """What a command calls first."""
    refusals: tuple[type[Exception], ...]
    """Errors that it documents."""
    commands: tuple[str, ...] = ()
    """Those that read it; FILE is the file."""
    share: int
    """Of 1,000 cases: the more, the faster it is read."""


def changed_file(random: Random, folder: Path, kind: str) -> Path:
    """Write a changed file of a format into a folder; returns it."""
    file = FORMATS[kind].make(random, folder)
    if random.random() < 0.25 and file.is_file():
        file.write_bytes(other_bytes(random, file.read_bytes()))
    return file


def drawn_format(random: Random) -> str:
    """Draw a format by its share."""
    return random.choices(tuple(FORMATS), [one.share for one in FORMATS.values()])[0]


def words_for(random: Random, file: Path, kind: str) -> tuple[str, ...]:
    """Draw a command that reads a file; returns its words, none for a format that no command reads."""
    commands = FORMATS[kind].commands
    return tuple(word.replace("FILE", str(file)) for word in random.choice(commands).split()) if commands else ()


def give(random: Random, folder: Path, kind: str, *, to_a_command: bool) -> tuple[str, str]:
    """Write a changed file of a format into a folder, and give it to its reader, or to a command that reads it.

    Returns what came of it, in words for figures, and the fault or nothing.
    """
    here = folder / "here"
    if not here.is_dir() or _names(here):
        shutil.rmtree(here, ignore_errors=True)
        here.mkdir()
        os.chdir(here)
    file = changed_file(random, folder, kind)
    words = words_for(random, file, kind) if to_a_command else ()
    _forget_peak()
    before, n_errors, held = _names(folder), _n_errors(), _peak_bytes()
    if words:
        code, fault = given_to_a_command(words)
        told = f"ended with exit code {code}"
    else:
        told, fault = read_by_its_reader(kind, file)
        fault = fault or ("wrote into the current folder" if _names(here) else "")
    new = _names(folder) - before
    grown = _peak_bytes() - held
    fault = fault or (f"wrote {', '.join(new)}" if new else "") or _errors(n_errors)
    fault = fault or (f"took {grown:,} bytes of memory" if grown > MOST_GROWN else "")
    return told, f"{shlex.join(words or (kind, file.name))[:2000]}\n{fault}" if fault else ""


def _names(folder: Path) -> set[str]:
    return {entry.name for entry in os.scandir(folder)}


def _n_errors() -> int:
    """Bytes that this process, libraries included, has written to stderr, if that is a file."""
    about = os.fstat(2)
    return about.st_size if stat.S_ISREG(about.st_mode) else 0


def _errors(n_before: int) -> str:
    """What was written to stderr since."""
    return os.pread(2, 4000, n_before).decode("utf-8", "replace") if _n_errors() > n_before else ""


def _forget_peak() -> None:
    """Let `_peak_bytes` begin anew, where the system can."""
    with contextlib.suppress(OSError):
        PEAK.with_name("clear_refs").write_text("5")


def _peak_bytes() -> int:
    """Return the most memory that this process has held since `_forget_peak`, or ever where it cannot be forgotten."""
    if not PEAK.exists():  # not Linux
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    _, _, held = PEAK.read_bytes().partition(b"VmHWM:")
    return int(held.split(b"kB", 1)[0]) * 1024


def read_by_its_reader(kind: str, file: Path) -> tuple[str, str]:
    """Give a file to the reader of its format; returns "accepted" or "refused", and the fault or nothing."""
    told = "accepted"
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        try:
            FORMATS[kind].read(file)
        except FORMATS[kind].refusals as error:
            told = "refused"
            if not str(error):
                return told, f"{error!r} says nothing"
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is a fault
            return "", "".join(traceback.format_exception(error))
    strange = [one for one in noticed if one.category.__module__.partition(".")[0] not in PACKAGES]
    return told, str(strange[0]) if strange else ""


def given_to_a_command(words: tuple[str, ...]) -> tuple[int, str]:
    """Give words to the command, in the current folder; returns its exit code, and the fault or nothing."""
    ended = outcome(words)
    fault = "" if words[0] == "rerun" and OF_THE_RUN.search(ended.errors) else ended.fault
    return ended.code, fault or (ended.errors if "Not enough memory" in ended.errors else "")


@cache
def _content(file: Path) -> bytes:
    return file.read_bytes()


@cache
def _values(file: Path) -> Any:
    return json.loads(_content(file))


@cache
def _stamp(file: Path) -> dict[str, str]:
    return pl.read_parquet_metadata(file)


def _forged(random: Random, forge: Callable[..., Any], source: Path, file: Path, prefix: str, *parts: str) -> Path:
    """Change bytes alone, the table, or one part of the stamp; then seal the file anew."""
    part = random.choice(("bytes", "table", *parts))
    if part == "bytes":
        file.write_bytes(other_bytes(random, _content(source)))
    elif part == "table":
        forge(source, file, frame=lambda frame: other_table(random, frame))
    else:
        forge(source, file, **{part: other_json(random, json.loads(_stamp(source)[prefix + part]))})
    return file


def _record(random: Random, folder: Path) -> Path:
    file = folder / "record.parquet"
    return _forged(random, forge_record, FILES / file.name, file, "swarm_forage_env.", "spec", "provenance")


def _packed(random: Random, folder: Path) -> Path:
    source, file = SUPPORT / "blessed_noise.parquet", folder / "packed.parquet"
    return _forged(random, forge_study, source, file, "swarm_forage_env.study.", "study", "versions")


def _toml(name: str, text: Callable[[], str]) -> Callable[[Random, Path], Path]:
    def make(random: Random, folder: Path) -> Path:
        file = folder / name
        file.write_text(other_lines(random, text()), encoding="utf-8")
        return file

    return make


def _read_record(file: Path) -> Any:
    return RunSpec.from_json(RunRecord.read(file).spec)


def _entry(random: Random, folder: Path) -> Path:
    """One of a tiny benchmark, or one of the real one, which takes longer."""
    if random.random() < 0.97:
        source, file = FILES / "entry.json", folder / "tiny.json"
    else:
        source, file = Path(benchmark_entry.__file__).parent / "scripted/crw.json", folder / "entry.json"

    def seal(content: Any) -> None:
        content["digest"] = benchmark_entry._digest({k: v for k, v in content.items() if k != "digest"})

    file.write_text(other_json(random, _values(source), seal))
    return file


@cache
def _protocol(name: str) -> Protocol:
    return load_protocol(TINY) if name == "tiny.json" else load_protocol()


def _failure(random: Random, folder: Path) -> Path:
    file = folder / "failure.json"
    file.write_text(other_json(random, _values(FILES / file.name)))
    return file


@cache
def _parts_of_page() -> tuple[str, Any, tuple[bytes, ...], str]:
    """The page up to its header, the header, the blocks of its runs as they stand there, and what follows."""
    text = _content(FILES / "replay.html").decode()
    begin = text.index(">", text.index('id="header"')) + 1
    end = text.index("</script>", begin)
    header, blocks = take_replay_page_apart(text)
    return text[:begin], header, tuple(blocks), text[end:]


def _page(random: Random, folder: Path) -> Path:
    file, (before, header, blocks, after) = folder / "page.html", _parts_of_page()
    header, (block,) = json.loads(json.dumps(header)), blocks
    if random.random() < 0.4:
        old, block = block, _other_block(random, header["runs"][0]["arrays"], block)
        after = after.replace(_in_base64(old), _in_base64(block))

    def seal(content: Any) -> None:
        about = content["runs"][0]
        about["digest"] = replay_files._digest({k: v for k, v in about.items() if k != "digest"}, block)

    written = other_json(random, header, seal)
    file.write_text(before + written.replace("<", "\\u003c") + after, encoding="utf-8")
    return file


def _in_base64(block: bytes) -> str:
    return base64.b64encode(block).decode("ascii")


def _other_block(random: Random, places: list[dict[str, Any]], block: bytes) -> bytes:
    """Return a block with other bytes, or with an array that has one other number; `places` then has it, too."""
    if random.random() < 0.3:
        return other_bytes(random, block)
    chosen = random.choice(places)
    parts = {place["name"]: block[place["offset"] : place["offset"] + place["size"]] for place in places}
    array = unpack(parts[chosen["name"]], chosen["dtype"], tuple(chosen["shape"])).copy()
    if array.size:
        kind = array.dtype
        ends = (0.0, np.inf, np.nan, 1e30) if kind.kind == "f" else (0, 1, np.iinfo(kind).min, np.iinfo(kind).max)
        array.reshape(-1)[random.randrange(array.size)] = random.choice(ends)
    parts[chosen["name"]] = pack(array)
    block = b""
    for place in places:
        packed = parts[place["name"]]
        place["offset"], place["size"] = len(block), len(packed)
        block += packed
    return block


@cache
def _arrays(file: Path) -> dict[str, np.ndarray]:
    with np.load(file) as stored:
        return dict(stored)


@cache
def _small_network() -> dict[str, np.ndarray]:
    """One layer, as large as its interface says."""
    layer = np.linspace(-1.0, 1.0, 111 * 3, dtype=np.float32).reshape(111, 3)
    return {**_arrays(FILES / "network.npz"), "weight_0": layer, "bias_0": layer[0]}


def _network(random: Random, folder: Path) -> Path:
    """A small one, or the one that comes with the package, which takes longer."""
    file, shipped = folder / "network.npz", network_file("ppo_warehouse_small")
    assert shipped is not None
    file.write_bytes(other_arrays(random, _small_network() if random.random() < 0.8 else _arrays(shipped)))
    return file


def _dataset(random: Random, folder: Path) -> Path:
    place = folder / "dataset"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    sources = sorted((FILES / "dataset").iterdir())
    chosen = random.choice(sources)
    for source in sources:
        file, content = place / source.name, _content(source)
        if source != chosen:
            file.write_bytes(content)
        elif random.random() < 0.2:
            file.write_bytes(other_bytes(random, content))
        elif file.suffix == ".npz":
            file.write_bytes(other_arrays(random, _arrays(source)))
        else:
            file.write_text(other_json(random, _values(source)))
    return place


def _curves(random: Random, folder: Path) -> Path:
    file, how = folder / random.choice(("curves.csv", "curves.parquet")), random.random()
    if how < 0.4:
        file.write_bytes(other_bytes(random, _whole_curves(file.suffix)))
    else:
        file.write_bytes(_written_curves(other_table(random, CROWDING), file.suffix))
    return file


@cache
def _whole_curves(suffix: str) -> bytes:
    return _written_curves(CROWDING, suffix)


def _written_curves(frame: pl.DataFrame, suffix: str) -> bytes:
    content = BytesIO()
    if suffix == ".csv":
        frame.select(name for name in frame.columns if frame[name].dtype != pl.Binary).write_csv(content)
    else:
        frame.write_parquet(content)
    return content.getvalue()


@cache
def _plan_text() -> str:
    source = plan_file("ppo_warehouse_small")
    assert source is not None
    return source.read_text(encoding="utf-8")


FORMATS = {
    "record": Format(
        make=_record,
        read=_read_record,
        refusals=(RecordError, ConfigError),
        commands=("rerun FILE", "maps FILE --picture out.png"),
        share=15,
    ),
    "packed": Format(
        make=_packed,
        read=read_study,
        refusals=(RecordError,),
        commands=("study status FILE", "study unpack FILE --out out", "study diff FILE FILE"),
        share=3,
    ),
    "study": Format(
        make=_toml("study.toml", lambda: STUDY),
        read=load_study,
        refusals=(ConfigError,),
        commands=("study show FILE", "study run FILE --dry-run --jobs 1"),
        share=50,
    ),
    "scenario": Format(
        make=_toml("world.toml", lambda: SCENARIO),
        read=read_world,
        refusals=(ConfigError,),
        commands=("info FILE", "run random --scenario FILE --seeds 1"),
        share=370,
    ),
    "entry": Format(
        make=_entry,
        read=lambda file: read_entry(file, _protocol(file.name)),
        refusals=(BenchmarkError,),
        commands=("benchmark show FILE",),
        share=90,
    ),
    "failure": Format(
        make=_failure,
        read=read_failure,
        refusals=(RecordError,),
        commands=("rerun FILE",),
        share=330,
    ),
    "replay": Format(
        make=_page,
        read=replay_files.read_replays,
        refusals=(ReplayError,),
        commands=("maps FILE --picture out.png",),
        share=35,
    ),
    "dataset": Format(
        make=_dataset,
        read=lambda place: list(TrajectoryDataset(place).chunks()),
        refusals=(DatasetError,),
        share=20,
    ),
    "network": Format(
        make=_network,
        read=open_network,
        refusals=(NetworkError, ModelError),
        commands=("info FILE", "export FILE --file out.h", "run FILE --robots 3 --objects 20 --seeds 1"),
        share=30,
    ),
    "plan": Format(
        make=_toml("plan.toml", _plan_text),
        read=read_plan,
        refusals=(ConfigError,),
        commands=("train --plan FILE",),
        share=42,
    ),
    "curves": Format(
        make=_curves,
        read=read_curves,
        refusals=(CurveError,),
        commands=("score --curves FILE --picture out.png", "predict --curves FILE --picture out.png"),
        share=15,
    ),
}
"""By name."""
