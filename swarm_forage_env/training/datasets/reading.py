"""Reading a data set back: runs as the environment gave them, episodes of single robots, and transitions."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.archives import ArchiveError, Kind, open_arrays, read_array
from swarm_forage_env.contract.types import BoolArray, ObsArray
from swarm_forage_env.training.datasets.layout import (
    ARRAYS,
    Card,
    DatasetError,
    RunSummary,
    chunk_file,
    chunk_kinds,
    summary_file,
)

_HEADERS_BYTES = 1 << 16
"""What names, headers and the table of contents of a chunk take at most."""
_LONGER_BY_ONE = ("observations", "active")
"""Arrays that also have what follows the last decision."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Steps:
    """Decisions of all robots, a chunk or a whole run of n; `datasets.layout` has shapes and meaning.

    Those of one robot, from the start to its death or the end of the run, have no axis of robots. After a death the
    last observation is zeros.
    """

    seed: int
    robot: int | None = None
    """Row of the one robot; None = all of them."""
    observations: ObsArray
    actions: np.ndarray
    rewards: np.ndarray
    terminated: BoolArray
    truncated: BoolArray
    active: BoolArray

    def __len__(self) -> int:
        return len(self.rewards)

    def of_robot(self, robot: int) -> "Steps":
        """Return what one robot of a whole run saw and did."""
        deaths = np.flatnonzero(self.terminated[:, robot])
        end = int(deaths[0]) + 1 if len(deaths) else len(self)
        arrays: dict[str, Any] = {name: getattr(self, name)[: end + (name in _LONGER_BY_ONE), robot] for name in ARRAYS}
        return Steps(seed=self.seed, robot=robot, **arrays)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Transitions:
    """Single decisions of single robots, all of them active; R rows."""

    observations: ObsArray
    """(R, d)."""
    actions: np.ndarray
    """(R,) or (R, k)."""
    rewards: np.ndarray
    """(R,) float64."""
    next_observations: ObsArray
    """(R, d)."""
    terminated: BoolArray
    """(R,)."""
    truncated: BoolArray
    """(R,)."""

    def __len__(self) -> int:
        return len(self.rewards)


class TrajectoryDataset:
    """The runs of a folder that are whole.

        dataset = TrajectoryDataset("results/dpo_small")
        for episode in dataset.episodes():
            print(episode.robot, episode.rewards.sum())

    Attributes:
        folder: Where it lies.
        card: What is true of all runs.
        runs: Summary of each whole run, in the order of the seeds that were asked for.
    """

    def __init__(self, folder: str | Path) -> None:
        """Open a folder; raises DatasetError where it holds no data set."""
        self.folder = Path(folder)
        self.card = Card.read(self.folder)
        whole = [seed for seed in self.card.seeds if summary_file(self.folder, seed).exists()]
        self.runs = tuple(RunSummary.read(self.folder, seed, self.card) for seed in whole)

    @property
    def is_complete(self) -> bool:
        """Whether all runs are there that were asked for."""
        return len(self.runs) == len(self.card.seeds)

    def chunks(self) -> Iterator[Steps]:
        """Yield all chunks, run by run, one in memory at a time; raises DatasetError for a damaged one."""
        for run in self.runs:
            yield from self._chunks_of(run)

    def _chunks_of(self, run: RunSummary) -> Iterator[Steps]:
        for number, n_decisions in enumerate(run.chunks):
            file = chunk_file(self.folder, run.seed, number)
            arrays = _read(file, chunk_kinds(self.card, n_decisions))
            if self.card.n_actions is not None and not _are_below(arrays["actions"], self.card.n_actions):
                raise DatasetError(f"Expected actions from 0 to {self.card.n_actions - 1} in {file}, got others.")
            fields: dict[str, Any] = arrays
            yield Steps(seed=run.seed, **fields)

    def steps(self, seed: int) -> Steps:
        """Return a whole run.

        Raises:
            DatasetError: the run is not there, or damaged.
        """
        run = next((run for run in self.runs if run.seed == seed), None)
        if run is None:
            seeds = ", ".join(str(run.seed) for run in self.runs) or "none"
            raise DatasetError(f"Expected one of the runs in {self.folder}, seeds {seeds}, got seed {seed}.")
        chunks = list(self._chunks_of(run))
        joined: dict[str, Any] = {
            # Of the two arrays with one row more, the last row of a chunk is the first of the next one.
            name: np.concatenate(
                [getattr(chunk, name)[: len(chunk)] for chunk in chunks]
                + ([getattr(chunks[-1], name)[-1:]] if name in _LONGER_BY_ONE else [])
            )
            for name in ARRAYS
        }
        return Steps(seed=seed, **joined)

    def episodes(self) -> Iterator[Steps]:
        """Yield the episode of every robot, run by run."""
        for run in self.runs:
            steps = self.steps(run.seed)
            yield from map(steps.of_robot, range(steps.rewards.shape[1]))

    def transitions(self) -> Transitions:
        """Return all decisions of robots that were at work, in memory; for more than that, use `chunks`."""
        found: dict[str, list[np.ndarray]] = {name: [] for name in Transitions.__dataclass_fields__}
        for chunk in self.chunks():
            working = chunk.active[:-1]
            for name in ("actions", "rewards", "terminated", "truncated"):
                found[name].append(getattr(chunk, name)[working])
            found["observations"].append(chunk.observations[:-1][working])
            found["next_observations"].append(chunk.observations[1:][working])
        if not found["rewards"]:
            raise DatasetError(f"Expected a run in {self.folder} that is whole, found none; record it to its end.")
        return Transitions(**{name: np.concatenate(parts) for name, parts in found.items()})


def _are_below(actions: np.ndarray, n_actions: int) -> bool:
    return bool((actions >= 0).all() and (actions < n_actions).all())


def _read(file: Path, kinds: Mapping[str, Kind]) -> dict[str, np.ndarray]:
    most = sum(math.prod(length or 0 for length in shape) * np.dtype(dtype).itemsize for dtype, shape in kinds.values())
    try:
        stored = open_arrays(file, most + most // 100 + _HEADERS_BYTES)  # what cannot be compressed becomes longer
        return {name: read_array(stored, name, kind) for name, kind in kinds.items()}
    except OSError as error:
        raise DatasetError(f"Cannot read {file}: {error.strerror or error}.") from error
    except ArchiveError as error:
        raise DatasetError(f"Cannot read {file}: {error}") from error
