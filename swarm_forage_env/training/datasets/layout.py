"""What the folder of a data set holds.

    <folder>/dataset.json                 the card (`Card`)
    <folder>/seed_000003_0000.npz         first chunk of the run with seed 3
    <folder>/seed_000003_0001.npz         second chunk
    <folder>/seed_000003.json             summary of the run (`RunSummary`), written when all of its chunks are there
    <folder>/croissant.json               the same for others (`describe_dataset`); nothing here reads it

A chunk has n decisions of all N robots; row i is robot i. The observations that follow its last decision are its last
row, and the first row of the next chunk.

    observations  (n + 1, N, d) float32
    actions       (n, N) int64 or (n, N, k) float32
    rewards       (n, N) float64, sums over the ticks of a decision
    terminated    (n, N) bool, robots that died in this decision
    truncated     (n, N) bool, robots that could have gone on when the run ended
    active        (n + 1, N) bool, robots at work when the observation was made; others do not act

Types are exact, and numbers are finite.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from swarm_forage_env._internal.archives import Kind
from swarm_forage_env._internal.fields import ConfigError, table
from swarm_forage_env._internal.files import read_json, replacing
from swarm_forage_env._internal.typed import Count, Within, typed
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.contract.policy import COMMANDS
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.runs.spec import RunSpec

SCHEMA_VERSION = 1
"""Version of the folder; raised whenever an array or a field is new, or changes its name, type or meaning."""
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
    seeds: Annotated[tuple[Count, ...], Within(at_least=1)]
    """Seeds that were asked for."""
    columns: Annotated[tuple[str, ...], Within(at_least=1)]
    """Name of the slice that each column of an observation belongs to, d entries."""
    n_actions: Annotated[int, Within(at_least=1)] | None
    """Number of discrete actions, None for continuous ones."""
    parts: Mapping[str, Count]
    """Of a mixed swarm, its parts and how many robots each has, in the order of the rows."""
    versions: Mapping[str, str]
    """Software that made it."""
    schema_version: int = SCHEMA_VERSION

    @property
    def spec(self) -> RunSpec:
        """Specification of the first run."""
        return RunSpec.from_mapping(self.run)

    def __post_init__(self) -> None:
        if len(set(self.seeds)) < len(self.seeds):
            raise ConfigError("Expected different seeds, got one twice.")

    @property
    def action_shape(self) -> tuple[int, ...]:
        """Shape of one action of all robots, (N,) or (N, k)."""
        n_robots, config = self.spec.scenario.robots.n_robots, self.interface
        if self.n_actions is not None:
            return (n_robots,)
        driven = COMMANDS - 1 if config.automatic_gripper else COMMANDS
        return (n_robots, driven + (config.message_size or 0))

    @property
    def n_decisions(self) -> int:
        """Decisions of a run that nothing ends early."""
        return math.ceil(self.spec.scenario.horizon_ticks / self.interface.decision_ticks)

    def write(self, folder: Path) -> None:
        """Write the card, whole or not at all."""
        _write_json(folder / CARD_FILE, asdict(self))

    @classmethod
    def read(cls, folder: Path) -> "Card":
        """Read the card of a folder.

        Raises:
            DatasetError: there is none, or it is damaged or of another version.
        """
        file = folder / CARD_FILE
        values = read_json(file, DatasetError)
        version = values.get("schema_version") if isinstance(values, dict) else None
        if version is not None and version != SCHEMA_VERSION:
            raise DatasetError(
                f"Expected a data set of schema version {SCHEMA_VERSION} in {folder}, got {shown(version)}; "
                "read it with the version that wrote it."
            )
        try:
            card: Card = typed(cls, {**table("a card", values), "schema_version": version}, "")
            _ = card.spec  # refuses what describes no run
        except ConfigError as error:
            raise DatasetError(f"Cannot use {file}: {error}") from error
        return card


@dataclass(frozen=True, kw_only=True, slots=True)
class RunSummary:
    """A run of a data set, of which all chunks are there."""

    seed: Count
    chunks: Annotated[tuple[Annotated[int, Within(at_least=1)], ...], Within(at_least=1)]
    """Decisions in each chunk."""
    truncated: bool
    """Whether the horizon was reached; if not, all robots died before."""
    collected: Count
    """Objects delivered."""
    first_picked: Count
    """Objects picked up for the first time."""

    def write(self, folder: Path) -> None:
        """Write the summary, whole or not at all."""
        _write_json(summary_file(folder, self.seed), asdict(self))

    @classmethod
    def read(cls, folder: Path, seed: int, card: Card) -> "RunSummary":
        """Read the summary of a run.

        Raises:
            DatasetError: there is none, or it is damaged, or of another run than the card tells of.
        """
        file = summary_file(folder, seed)
        content = read_json(file, DatasetError)
        try:
            summary: RunSummary = typed(cls, content, "")
        except ConfigError as error:
            raise DatasetError(f"Cannot use {file}: {error}") from error
        if summary.seed != seed:
            raise DatasetError(f"Expected {file} to be of seed {seed}, got seed {summary.seed}.")
        if sum(summary.chunks) > card.n_decisions:
            raise DatasetError(
                f"Expected at most {card.n_decisions:,} decisions in the chunks of {file}, got {sum(summary.chunks):,}."
            )
        return summary


def summary_file(folder: Path, seed: int) -> Path:
    """Return where the summary of a run is; if it is there, the run is whole."""
    return folder / f"seed_{seed:06d}.json"


def chunk_file(folder: Path, seed: int, chunk: int) -> Path:
    """Return where a chunk of a run is; chunks count from 0."""
    return folder / f"seed_{seed:06d}_{chunk:04d}.npz"


def _write_json(file: Path, values: Mapping[str, Any]) -> None:
    with replacing(file) as draft:
        draft.write_text(json.dumps(values, indent=1, sort_keys=True), encoding="utf-8")


def chunk_kinds(card: Card, n_decisions: int | None = None) -> dict[str, Kind]:
    """Return type and shape of each array of a chunk of some decisions; None = of any number."""
    n_robots = card.spec.scenario.robots.n_robots
    each, longer = (n_decisions, n_robots), (None if n_decisions is None else n_decisions + 1, n_robots)
    return {
        "observations": (np.float32, (*longer, len(card.columns))),
        "actions": (np.float32 if card.n_actions is None else np.int64, (n_decisions, *card.action_shape)),
        "rewards": (np.float64, each),
        "terminated": (np.bool_, each),
        "truncated": (np.bool_, each),
        "active": (np.bool_, longer),
    }
