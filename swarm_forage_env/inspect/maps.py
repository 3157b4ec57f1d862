"""Maps of the floor: where robots were, where they took and left objects, where they got in each other's way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.files import as_file_name, replacing
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.frames import Replay, Status
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.workers import each_run
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.obstacles import Rectangle

MEANINGS: Mapping[str, tuple[str, str]] = {
    "density": ("active robots, mean over time", "per m²"),
    "interference": ("robots in interference, mean over time", "per m²"),
    "pickups": ("objects picked up", "per m² and 1,000 s"),
    "drops": ("objects dropped", "per m² and 1,000 s"),
}
"""Map -> what is counted, and in which unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloorMaps:
    """Arrays over the squares of a floor, or differences of two such arrays."""

    label: str
    """What they are of, for people."""
    side_m: float
    """Side of a square."""
    size_m: tuple[float, float]
    """Extent of the arena along x and y."""
    n_robots: int
    """Swarm size; of a difference, that of the first swarm."""
    arrays: Mapping[str, FloatArray]
    """Name, as in `MEANINGS` -> (ny, nx), row = y from below."""
    is_difference: bool = False
    obstacles_m: tuple[Rectangle, ...] = ()
    """Boxes on the floor; of a difference, those of the first."""
    nests_m: tuple[Rectangle, ...] = ()
    """Boxes that are nests; of a difference, those of the first."""

    def minus(self, other: "FloorMaps") -> "FloorMaps":
        """Return what is more here than in `other`, square by square.

        Raises:
            ConfigError: arenas or squares of other sizes.
        """
        mine, theirs = ((*maps.size_m, maps.side_m) for maps in (self, other))
        if mine != theirs:
            raise ConfigError(
                f"Expected maps of one arena in equal squares, got sizes and sides of {mine} and {theirs} m."
            )
        return replace(
            self,
            label=f"{self.label} minus {other.label}",
            arrays={name: array - other.arrays[name] for name, array in self.arrays.items()},
            is_difference=True,
        )

    def write(self, path: str | Path) -> None:
        """Write the arrays to an .npz file, whole or not at all."""
        content: dict[str, Any] = {
            **self.arrays,
            "side_m": self.side_m,
            "size_m": self.size_m,
            "n_robots": self.n_robots,
        }
        with replacing(Path(path)) as draft, draft.open("wb") as file:
            np.savez_compressed(file, **content)


def floor_maps(replay: Replay, *, side_m: float = 2 * CELL_M) -> FloorMaps:
    """Count robots, pick-ups and drops of a replay in squares of the floor.

    Args:
        replay: The run. Robots count at its frames; pick-ups that are undone before the next frame are missing.
        side_m: Side of a square, default two cells. Where the arena is no multiple of it, the squares at its upper and
            right border are cut off there, and their numbers are per m² of what is left of them.

    Raises:
        ConfigError: `side_m` is smaller than a cell, or larger than the arena.
    """
    arena = replay.scenario.arena
    number("side_m", side_m, at_least=CELL_M, at_most=max(arena.width_m, arena.height_m))
    extents = arena.height_m, arena.width_m
    edges = [np.arange(0.0, extent + side_m - 1e-9, side_m) for extent in extents]
    area_m2 = np.outer(*(_sides(side_m, len(marks) - 1, extent) for marks, extent in zip(edges, extents, strict=True)))

    def count(places_m: FloatArray) -> FloatArray:
        inside = np.clip(places_m, 0.0, [arena.width_m, arena.height_m])
        return np.histogram2d(inside[:, 1], inside[:, 0], bins=edges)[0]

    active = ~(replay.has(Status.ABSENT) | replay.has(Status.REPAIR))
    position_m = replay.position_m
    _, signs, places_m = replay.handovers
    of_frames = 1.0 / (area_m2 * replay.n_frames)
    of_events = 1000.0 / (area_m2 * float(replay.times_s[-1]))
    return FloorMaps(
        label=replay.label,
        side_m=side_m,
        size_m=(arena.width_m, arena.height_m),
        n_robots=replay.scenario.robots.n_robots,
        obstacles_m=arena.obstacles,
        nests_m=arena.nest_boxes_m,
        arrays={
            "density": count(position_m[active]) * of_frames,
            "interference": count(position_m[active & replay.has(Status.INTERFERING)]) * of_frames,
            "pickups": count(places_m[signs > 0]) * of_events,
            "drops": count(places_m[signs < 0]) * of_events,
        },
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedMaps:
    """Maps of several swarms, and what is more in each after the first than in the first."""

    maps: tuple[FloorMaps, ...]

    @property
    def rows(self) -> tuple[FloorMaps, ...]:
        """Maps and differences."""
        return (*self.maps, *(one.minus(self.maps[0]) for one in self.maps[1:]))

    def write(self, picture: str | Path) -> None:
        """Write arrays to .npz files beside a picture, and then draw it.

        Args:
            picture: File to write.

        Raises:
            ImportError: matplotlib is not installed; the arrays are written.
        """
        from swarm_forage_env.rendering.plots import MapRow, draw_maps

        rows = self.rows
        for one in rows:
            one.write(Path(picture).with_suffix(f".{as_file_name(one.label)}.npz"))
        shown = [
            MapRow(one.label, one.arrays, one.is_difference, one.size_m, one.obstacles_m, one.nests_m) for one in rows
        ]
        draw_maps(picture, shown, MEANINGS)


def maps_of_runs(
    specs: Sequence[RunSpec],
    *,
    jobs: int | None,
    advance: Callable[[float], None],
) -> ComparedMaps:
    """Make runs and return the mean of the maps of each policy.

    Args:
        specs: The runs; those of a policy differ in their seeds, and all arenas are of one size.
        jobs: As in `runs.workers.each_run`.
        advance: Called with the robot-ticks that are done when a run ends.

    Raises:
        ValueError: a policy that is not installed, or refuses its file.
    """
    found: dict[str, FloorMaps] = {}
    for spec, maps in each_run(_map_run, specs, jobs=jobs):
        found[spec.run_id] = maps
        if advance is not None:
            advance(sum(spec.robot_ticks for spec in specs if spec.run_id in found))
    made: dict[str, list[FloorMaps]] = {}
    for spec in specs:
        made.setdefault(policy_label(spec.policy), []).append(found[spec.run_id])
    return ComparedMaps(maps=tuple(_mean_maps(maps, label) for label, maps in made.items()))


def _map_run(spec: RunSpec) -> FloorMaps:
    """Make a run and return its maps."""
    return floor_maps(record_replay(spec)[0])


def _sides(side_m: float, n: int, extent_m: float) -> FloatArray:
    """Return the sides of squares along one axis, (n,) m: the last is what is left of the arena."""
    return np.append(np.full(n - 1, side_m), min(side_m, extent_m - (n - 1) * side_m))


def _mean_maps(maps: Sequence[FloorMaps], label: str) -> FloorMaps:
    """Return the mean of maps of several runs of one experiment, under another label."""
    arrays = {name: np.mean([one.arrays[name] for one in maps], axis=0) for name in MEANINGS}
    return replace(maps[0], label=label, arrays=arrays)
