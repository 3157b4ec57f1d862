"""What the folder of a data set holds.

    <folder>/dataset.json                 the card (`Card`)
    <folder>/seed_000003_0000.npz         first chunk of the run with seed 3
    <folder>/seed_000003_0001.npz         second chunk
    <folder>/seed_000003.json             summary of the run (`RunSummary`), written when all of its chunks are there

A chunk has n decisions of all N robots; row i is robot i. The observations that follow its last decision are its last
row, and the first row of the next chunk.

    observations  (n + 1, N, d) float32
    actions       (n, N) int64 or (n, N, k) float32
    rewards       (n, N) float64, sums over the ticks of a decision
    terminated    (n, N) bool, robots that died in this decision
    truncated     (n, N) bool, robots that could have gone on when the run ended
    active        (n + 1, N) bool, robots at work when the observation was made; others do not act
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, known_keys, table
from swarm_forage_env._internal.files import parse_json, replacing
from swarm_forage_env.policies.interface import InterfaceConfig, interface_from_mapping
from swarm_forage_env.runs.spec import RunSpec

SCHEMA_VERSION = 1
"""Version of the folder; raised whenever an array or a field changes its name, type or meaning."""
CARD_FILE = "dataset.json"
ARRAYS = ("observations", "actions", "rewards", "terminated", "truncated", "active")


class DatasetError(ValueError):
    """A folder that holds no data set, a damaged one, or another one than was asked for; the message names it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Card:
    """What is true of all runs of a data set."""

    run: Mapping[str, Any]
    """Specification of the runs (`RunSpec.to_mapping`), with the first seed."""
    interface: InterfaceConfig
    """What is seen, and which actions were taken how often. Without a learned policy, actions are the commands
    (left wheel, right wheel, gripper) of every tick."""
    seeds: tuple[int, ...]
    """Seeds that were asked for."""
    columns: tuple[str, ...]
    """Name of the slice that each column of an observation belongs to, d entries."""
    n_actions: int | None
    """Number of discrete actions, None for continuous ones."""
    parts: Mapping[str, int]
    """Of a mixed swarm, its parts and how many robots each has, in the order of the rows."""
    versions: Mapping[str, str]
    """Software that made it."""
    schema_version: int = SCHEMA_VERSION

    @property
    def spec(self) -> RunSpec:
        """Specification of the first run."""
        return RunSpec.from_mapping(self.run)

    def write(self, folder: Path) -> None:
        """Write the card, whole or not at all."""
        _write_json(folder / CARD_FILE, asdict(self))

    @classmethod
    def read(cls, folder: Path) -> "Card":
        """Read the card of a folder.

        Raises:
            DatasetError: there is none, or it is damaged or of another version.
        """
        values = _read_json(folder / CARD_FILE)
        if values.get("schema_version") != SCHEMA_VERSION:
            raise DatasetError(
                f"Expected a data set of schema version {SCHEMA_VERSION} in {folder}, got "
                f"{values.get('schema_version')!r}; read it with the version that wrote it."
            )
        try:
            known_keys(values, [item.name for item in fields(cls)], "key of a card")
            values["interface"] = interface_from_mapping(table("interface", values["interface"]))
            values["seeds"], values["columns"] = tuple(values["seeds"]), tuple(values["columns"])
            return cls(**values)
        except (ConfigError, LookupError, TypeError) as error:
            raise DatasetError(f"Cannot use {folder / CARD_FILE}: {error}") from error


@dataclass(frozen=True, kw_only=True, slots=True)
class RunSummary:
    """A run of a data set, of which all chunks are there."""

    seed: int
    chunks: tuple[int, ...]
    """Decisions in each chunk."""
    truncated: bool
    """Whether the horizon was reached; if not, all robots died before."""
    collected: int
    """Objects delivered."""
    first_picked: int
    """Objects picked up for the first time."""

    def write(self, folder: Path) -> None:
        """Write the summary, whole or not at all."""
        _write_json(summary_file(folder, self.seed), asdict(self))

    @classmethod
    def read(cls, folder: Path, seed: int) -> "RunSummary":
        """Read the summary of a run.

        Raises:
            DatasetError: there is none, or it is damaged.
        """
        file = summary_file(folder, seed)
        values = _read_json(file)
        try:
            return cls(**{**values, "chunks": tuple(values["chunks"])})
        except (LookupError, TypeError) as error:
            raise DatasetError(f"Cannot use {file}: {error}") from error


def summary_file(folder: Path, seed: int) -> Path:
    """Return where the summary of a run is; if it is there, the run is whole."""
    return folder / f"seed_{seed:06d}.json"


def chunk_file(folder: Path, seed: int, chunk: int) -> Path:
    """Return where a chunk of a run is; chunks count from 0."""
    return folder / f"seed_{seed:06d}_{chunk:04d}.npz"


def _write_json(file: Path, values: Mapping[str, Any]) -> None:
    with replacing(file) as draft:
        draft.write_text(json.dumps(values, indent=1, sort_keys=True), encoding="utf-8")


def _read_json(file: Path) -> dict[str, Any]:
    try:
        values = parse_json(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise DatasetError(f"Cannot read {file}: {error.strerror or error}.") from error
    except ValueError as error:
        raise DatasetError(f"Cannot use {file}: {error}") from error
    if not isinstance(values, dict):
        raise DatasetError(f"Expected {file} to hold a JSON object, got {type(values).__name__}.")
    return values
