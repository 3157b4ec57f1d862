"""Snapshots: the whole state of a run as one value, from which the same or another environment goes on.

A snapshot is made of the states of the layers of an environment: the ForageEnv, the arena, the wrappers. All are
pickled together, because arrays of the world belong to several of them, and must still be one array afterwards. The
layers themselves and what they are made from (scenario, configurations of wrappers) are only named: a reference to them
means those of the environment that takes the snapshot over.
"""

import io
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from functools import cache
from importlib import metadata
from typing import Any
from zlib import crc32

from swarm_forage_env.scenarios.config import ScenarioConfig

_KEPT_BYTES = 4096
"""Bytes objects of at least this size are shared by snapshots, not copied: nobody can change them."""
_SHOWN = 3
"""Differences that a message names."""


class SnapshotError(ValueError):
    """A snapshot that does not fit an environment, or an environment of which none can be taken."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Origin:
    """Of what a snapshot was taken; it can be restored where all of this is the same."""

    version: str
    """Of the package."""
    scenario: ScenarioConfig
    max_cycles: int
    reads: tuple[str, ...]
    """Observation slices that are read."""
    wrappers: tuple[tuple[str, Any], ...]
    """Name of the class and configuration of each wrapper, outermost first; None for one without configuration."""

    def differences(self, other: "Origin") -> list[str]:
        """Return what differs, each as "x is 1 there and 2 here"; `self` is there.

        Configurations are compared for wrappers that both have.
        """
        there, here = _flat(self), _flat(other)
        return [
            f"{name} is {value} there and {here[name]} here"
            for name, value in there.items()
            if name in here and here[name] != value
        ]


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
    kept: tuple[bytes, ...] = field(repr=False)
    """Parts of the content that other snapshots share."""
    checksum: int = field(repr=False)
    """Of `content` and `kept`, see `checksum_of`."""


def take(origin: Origin, seed: int, tick: int, states: Sequence[Any], parts: Sequence[object]) -> Snapshot:
    """Make a snapshot.

    Args:
        origin: What is needed to restore it.
        seed: Of the run.
        tick: Ticks done since reset.
        states: State of every layer, as `read` is to return it.
        parts: Objects that are no state: only their place in this list is stored.

    Raises:
        SnapshotError: a state that cannot be pickled.
    """
    file = io.BytesIO()
    writer = _Writer(file, parts)
    try:
        writer.dump(states)
    except SnapshotError:
        raise
    except Exception as error:
        raise SnapshotError(
            f"Expected a state that can be pickled, got {type(error).__name__}: {error}. A wrapper of your own that "
            "holds something else leaves it out by `__getstate__`."
        ) from error
    content, kept = file.getvalue(), tuple(writer.kept)
    return Snapshot(
        origin=origin, seed=seed, tick=tick, content=content, kept=kept, checksum=checksum_of(content, kept)
    )


def checksum_of(content: bytes, kept: Sequence[bytes]) -> int:
    """Return a number that changes when a bit does: a damaged array may hold indices that compiled code follows."""
    found = crc32(content)
    for part in kept:
        found = crc32(part, found)
    return found


def read(snapshot: Snapshot, origin: Origin, parts: Sequence[object]) -> list[Any]:
    """Return the states in a snapshot, new objects in every call.

    Args:
        snapshot: What `take` made.
        origin: Of the environment that takes it over.
        parts: As in `take`, of that environment.

    Raises:
        SnapshotError: not a snapshot, one of another origin, or a damaged one.
    """
    if not isinstance(snapshot, Snapshot):  # pyright: ignore[reportUnnecessaryIsInstance] - it comes from users
        raise SnapshotError(f"Expected a Snapshot, as `snapshot()` returns it, got {type(snapshot).__name__}.")
    if snapshot.origin != origin:
        found = snapshot.origin.differences(origin)
        more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
        raise SnapshotError(
            "Expected a snapshot of an environment with the scenario, wrappers and version of this one, got another: "
            f"{'; '.join(found[:_SHOWN])}{more}. Restore it in an environment that is made as that one was."
        )
    try:
        is_whole = checksum_of(snapshot.content, snapshot.kept) == snapshot.checksum
    except TypeError:  # no bytes
        is_whole = False
    if not is_whole:
        raise SnapshotError("Expected a snapshot as it was taken, got a damaged one; take it, or copy its file, again.")
    try:
        return _Reader(io.BytesIO(snapshot.content), [*parts, *snapshot.kept]).load()
    except Exception as error:
        raise SnapshotError(
            f"Expected a snapshot of this Python's packages, got one that cannot be read here: "
            f"{type(error).__name__}: {error}."
        ) from error


class _Writer(pickle.Pickler):
    """Names parts by their place; whatever is large and cannot change becomes a further part."""

    def __init__(self, file: io.BytesIO, parts: Sequence[object]) -> None:
        super().__init__(file, protocol=5)
        self._places = {id(part): place for place, part in enumerate(parts)}
        self.kept: list[bytes] = []

    def persistent_id(self, obj: Any) -> int | None:
        place = self._places.get(id(obj))
        if place is None and type(obj) is bytes and len(obj) >= _KEPT_BYTES:
            place = self._places[id(obj)] = len(self._places)
            self.kept.append(obj)
        return place


class _Reader(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, parts: Sequence[object]) -> None:
        super().__init__(file)
        self._parts = parts

    def persistent_load(self, pid: int) -> Any:
        return self._parts[pid]


@cache
def package_version() -> str:
    """Return the version of this package."""
    return metadata.version("swarm-forage-env")


def _flat(origin: Origin) -> dict[str, Any]:
    """Return the plain values of an origin by their path."""
    flat: dict[str, Any] = {}

    def add(values: Mapping[str, Any], where: str) -> None:
        for name, value in values.items():
            if isinstance(value, Mapping):
                add(value, f"{where}{name}.")
            else:
                flat[f"{where}{name}"] = value

    names = ", ".join(name for name, _ in origin.wrappers) or "none"
    add({"version": origin.version, "wrappers": names}, "")
    add(asdict(origin.scenario), "scenario.")
    add({"max_cycles": origin.max_cycles, "reads": ", ".join(origin.reads)}, "")
    for name, config in origin.wrappers:
        if is_dataclass(config) and not isinstance(config, type):
            add(asdict(config), f"{name}.")
        else:
            flat[f"{name}.config"] = config
    return flat
