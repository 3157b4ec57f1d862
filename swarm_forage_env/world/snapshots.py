"""Snapshots: the whole state of a run as one value, from which the same or another environment goes on.

A snapshot is made of the states of the layers of an environment: the ForageEnv, the arena, the wrappers. All are
pickled together, because arrays of the world belong to several of them, and must still be one array afterwards. The
layers themselves and what they are made from (scenario, configurations of wrappers) are only named: a reference to them
means those of the environment that takes the snapshot over.
"""

import io
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from swarm_forage_env.scenarios.config import ScenarioConfig


class SnapshotError(ValueError):
    """A snapshot that does not fit an environment, or an environment of which none can be taken."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Origin:
    """Of what a snapshot was taken; it can be restored where all of this is the same."""

    scenario: ScenarioConfig
    max_cycles: int
    reads: tuple[str, ...]
    """Observation slices that are read."""
    wrappers: tuple[tuple[str, Any], ...]
    """Name of the class and configuration of each wrapper, outermost first; None for one without configuration."""


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Snapshot:
    """The state of a run after a tick. It is never changed, can be pickled, and can be restored any number of times.

    As with every pickle: restore only what comes from a source that you trust.
    """

    origin: Origin = field(repr=False)
    seed: int
    """Of the run."""
    tick: int
    """Ticks done since reset."""
    content: bytes = field(repr=False)


def take(origin: Origin, seed: int, tick: int, states: Sequence[Any], parts: Sequence[object]) -> Snapshot:
    """Make a snapshot.

    Args:
        origin: What is needed to restore it.
        seed: Of the run.
        tick: Ticks done since reset.
        states: State of every layer, as `read` is to return it.
        parts: Objects that are no state: only their place in this list is stored.

    Raises:
        SnapshotError: Chipmunk moves the bodies, or a state cannot be pickled.
    """
    file = io.BytesIO()
    try:
        _Writer(file, parts).dump(states)
    except SnapshotError:
        raise
    except Exception as error:
        raise SnapshotError(
            f"Expected a state that can be pickled, got {type(error).__name__}: {error}. A wrapper of your own that "
            "holds something else leaves it out by `__getstate__`."
        ) from error
    return Snapshot(origin=origin, seed=seed, tick=tick, content=file.getvalue())


def read(snapshot: Snapshot, origin: Origin, parts: Sequence[object]) -> list[Any]:
    """Return the states in a snapshot, new objects in every call.

    Args:
        snapshot: What `take` made.
        origin: Of the environment that takes it over.
        parts: As in `take`, of that environment.

    Raises:
        SnapshotError: not a snapshot, or one of another origin.
    """
    if not isinstance(snapshot, Snapshot):  # pyright: ignore[reportUnnecessaryIsInstance] - it comes from users
        raise SnapshotError(f"Expected a Snapshot, as `snapshot()` returns it, got {type(snapshot).__name__}.")
    if snapshot.origin != origin:
        raise SnapshotError(
            "Expected a snapshot of an environment with the scenario, length, reads and wrappers of this one, got "
            "another. Restore it in an environment that is made as that one was."
        )
    return _Reader(io.BytesIO(snapshot.content), parts).load()


class _Writer(pickle.Pickler):
    """Names parts by their place."""

    def __init__(self, file: io.BytesIO, parts: Sequence[object]) -> None:
        super().__init__(file, protocol=5)
        self._places = {id(part): place for place, part in enumerate(parts)}

    def persistent_id(self, obj: Any) -> int | None:
        return self._places.get(id(obj))


class _Reader(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, parts: Sequence[object]) -> None:
        super().__init__(file)
        self._parts = parts

    def persistent_load(self, pid: int) -> Any:
        return self._parts[pid]
