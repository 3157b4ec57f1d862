"""Record: one run as columns over its intervals, and the Parquet file that holds it.

`scenarios.columns` says what each column means, and in which unit. A file is self-contained: its metadata hold the
complete specification of the run, and what made it.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarm_forage_env._internal.files import parse_json, replacing
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.versions import VERSION_NAMES
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS, KEY_COLUMNS
from swarm_forage_env.scenarios.performance import performance_curve

if TYPE_CHECKING:
    import polars as pl

_SPEC, _MADE_WITH = "swarm_forage_env.spec", "swarm_forage_env.made_with"


class RecordError(ValueError):
    """A record that cannot be built, or a file that holds no undamaged record; the message names the file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """What a run was: its specification, and arrays over T intervals.

    After an early end (every robot dead) the remaining intervals are zeros.

    Raises:
        RecordError: a column is missing, or holds other than T finite numbers.
    """

    spec: RunSpec
    columns: Mapping[str, np.ndarray]
    """Column -> (T,), read-only: all of `INTERVAL_COLUMNS`, then those of wrappers and policies by name."""
    made_with: Mapping[str, str]
    """Versions, commit, time of creation, seconds of the clock and of a core."""

    def __post_init__(self) -> None:
        missing = [name for name in INTERVAL_COLUMNS if name not in self.columns]
        if missing:
            raise RecordError(f"Expected a record with the column {missing[0]}, got one without.")
        in_order = [*INTERVAL_COLUMNS, *sorted(set(self.columns) - set(INTERVAL_COLUMNS))]
        columns = {name: np.array(self.columns[name]) for name in in_order}
        shape = (len(columns["interval"]),)
        for name, values in columns.items():
            if values.shape != shape or not shape[0] or values.dtype.kind not in "iuf" or not np.isfinite(values).all():
                raise RecordError(f"Expected column {name} to hold finite numbers, one per interval, got {values}.")
            values.flags.writeable = False
        object.__setattr__(self, "columns", columns)

    def __getitem__(self, column: str) -> np.ndarray:
        if column not in self.columns:
            raise KeyError(f"Unknown column {column!r}.{suggestion(str(column), self.columns)}")
        return self.columns[column]

    @property
    def run_id(self) -> str:
        """Identity of the run: a hash of its specification."""
        return self.spec.run_id

    @property
    def seed(self) -> int:
        """Seed of the run."""
        return self.spec.seed

    @property
    def horizon_s(self) -> float:
        """Length of the run in simulated seconds."""
        return float(self["t_end_s"][-1])

    @property
    def wall_time_s(self) -> float:
        """Wall-clock seconds that the run took, policy and recording included; NaN where unknown."""
        return float(self.made_with.get("wall_time_s", "nan"))

    @property
    def cpu_time_s(self) -> float:
        """Seconds of a core that the run took, other work of the machine left out; NaN where unknown."""
        return float(self.made_with.get("cpu_time_s", "nan"))

    @property
    def keys(self) -> dict[str, str | int | float]:
        """What tells runs apart, by name, see `KEY_COLUMNS`."""
        world = self.spec.world
        names = self.run_id, world.scenario.name, self.spec.policy
        return dict(zip(KEY_COLUMNS, (*names, world.n_robots, world.criterion, world.value, self.seed), strict=True))

    @cached_property
    def frame(self) -> "pl.DataFrame":
        """One row per interval; the keys are repeated in front of each."""
        import polars as pl

        keys = [
            pl.lit(key, dtype=pl.Int64 if isinstance(key, int) else None).alias(name) for name, key in self.keys.items()
        ]
        return pl.DataFrame(dict(self.columns)).select(*keys, pl.all())

    def per_1000_s(self, column: str) -> float:
        """Return the sum of a column over the run, per 1,000 simulated seconds."""
        return float(self[column].sum()) * 1000.0 / self.horizon_s

    def read_as(self, performance: str) -> "Record":
        """Return the same run with another performance; column and specification say so, the identity stays.

        Args:
            performance: As in `swarm_forage_env.scenarios.performance.performance_of`.

        Raises:
            ConfigError: there is no such performance.
        """
        if performance == self.spec.scenario.performance:
            return self
        world = replace(self.spec.world, scenario=replace(self.spec.scenario, performance=performance))
        curve = performance_curve(performance, self.columns)
        return replace(self, spec=replace(self.spec, world=world), columns={**self.columns, "performance": curve})

    def made_by(self, versions: Mapping[str, str]) -> bool:
        """Return whether these `software_versions` made the run: the same packages and the same commit."""
        return all(self.made_with.get(name, "") == versions.get(name, "") for name in VERSION_NAMES)

    def equals(self, other: "Record") -> bool:
        """Return whether both hold the same columns, bit for bit, whatever run they are of."""
        mine, theirs = self.columns, other.columns
        return mine.keys() == theirs.keys() and all(np.array_equal(mine[name], theirs[name]) for name in mine)

    def describe(self) -> str:
        """Return one line about the run for people."""
        delivered = f"{self['collected'].sum()} ({self.per_1000_s('collected'):.1f} per 1,000 s)"
        return f"{self.spec.describe()}: {self.horizon_s:g} s, delivered {delivered}"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the record to a Parquet file, whole or not at all; raises OSError where that cannot be."""
        told = {_SPEC: self.spec.to_mapping(), _MADE_WITH: dict(self.made_with)}
        texts = {key: json.dumps(content, sort_keys=True) for key, content in told.items()}
        write_parquet(Path(path), self.frame, texts)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "Record":
        """Read a record back.

        Raises:
            RecordError: the file is missing, no record, or damaged; the message names it.
        """
        texts, frame = read_parquet(path)
        if _SPEC not in texts or _MADE_WITH not in texts:
            raise RecordError(f"Cannot read {path}: it is a Parquet file, but no run record of swarm_forage_env.")
        try:
            made_with = parse_json(texts[_MADE_WITH])
            return cls(
                spec=RunSpec.from_mapping(parse_json(texts[_SPEC])),
                columns={name: frame[name].to_numpy() for name in frame.columns if name not in KEY_COLUMNS},
                made_with={str(name): str(value) for name, value in made_with.items()},
            )
        except (AttributeError, ValueError) as error:
            raise RecordError(f"Cannot read {path}: {str(error).removesuffix('.')}.") from error


def read_parquet(path: str | os.PathLike[str]) -> "tuple[Mapping[str, str], pl.DataFrame]":
    """Return the texts in the metadata of a Parquet file, by key, and its table.

    Raises:
        RecordError: the file cannot be read, or is no Parquet file or a damaged one.
    """
    import polars as pl

    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise RecordError(f"Cannot read {path}: {error.strerror or error}.") from error
    try:
        return pl.read_parquet_metadata(BytesIO(content)), pl.read_parquet(BytesIO(content))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        reason = str(error).strip().partition("\n")[0]
        raise RecordError(f"Cannot read {path}: it is no Parquet file or a damaged one ({reason}).") from error


def write_parquet(path: Path, frame: "pl.DataFrame", texts: Mapping[str, str], compression_level: int = 3) -> None:
    """Write a table, with texts by key in its metadata, whole or not at all; raises OSError where that cannot be."""
    buffer = BytesIO()  # polars tells a full disk as an error of its own, among many others
    frame.write_parquet(buffer, metadata=dict(texts), compression_level=compression_level)
    with replacing(path) as draft:
        draft.write_bytes(buffer.getvalue())
