"""Maps of the floor: where robots were, where they took and left objects, where they got in each other's way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import number
from swarm_forage_env._internal.files import as_file_name, replacing
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.frames import Replay, Status
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.rendering.figures import Panel, policy_words, saved_figure
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
_OBSTACLE = {"facecolor": "white", "edgecolor": "black", "hatch": "////", "linewidth": 0.5}
"""Hatched: neither a map nor a difference has that."""
_MAP_IN = 3.6
"""Width of a map with its scale, inches."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloorMaps:
    """Arrays over the squares of a floor, or differences of two such arrays."""

    label: str
    """What they are of, for people."""
    side_m: float
    """Side of a square."""
    size_m: tuple[float, float]
    """Extent of the arena along x and y."""
    arrays: Mapping[str, FloatArray]
    """Name, as in `MEANINGS` -> (ny, nx), row = y from below."""
    is_difference: bool = False
    obstacles_m: tuple[Rectangle, ...] = ()
    """Boxes on the floor; of a difference, those of the first."""
    nests_m: tuple[Rectangle, ...] = ()
    """Boxes that are nests; of a difference, those of the first."""

    def minus(self, other: "FloorMaps") -> "FloorMaps":
        """Return what is more here than in `other`, a map of the same arena, square by square."""
        return replace(
            self,
            label=f"{self.label} minus {other.label}",
            arrays={name: array - other.arrays[name] for name, array in self.arrays.items()},
            is_difference=True,
        )

    def write(self, path: str | Path) -> None:
        """Write the arrays to an .npz file, whole or not at all."""
        sizes: dict[str, Any] = {"side_m": self.side_m, "size_m": self.size_m}
        with replacing(Path(path)) as draft, draft.open("wb") as file:
            np.savez_compressed(file, **self.arrays, **sizes)


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
    sides_m = [np.diff(np.minimum(marks, extent)) for marks, extent in zip(edges, extents, strict=True)]
    area_m2 = np.outer(*sides_m)

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
        obstacles_m=arena.obstacles,
        nests_m=arena.nest_boxes_m,
        arrays={
            "density": count(position_m[active]) * of_frames,
            "interference": count(position_m[active & replay.has(Status.INTERFERING)]) * of_frames,
            "pickups": count(places_m[signs > 0]) * of_events,
            "drops": count(places_m[signs < 0]) * of_events,
        },
    )


def maps_of_runs(specs: Sequence[RunSpec], *, advance: Callable[[float], None] | None = None) -> list[FloorMaps]:
    """Make runs and return the mean of the maps of each policy, and what is more in each than in the first.

    Args:
        specs: The runs; those of a policy differ in their seeds, and all arenas are of one size.
        advance: Called with the robot-ticks that are done when a run ends.

    Raises:
        ValueError: a policy that is not installed, or refuses its file.
    """
    found: dict[str, FloorMaps] = {}
    for spec, maps in each_run(_map_run, specs):
        found[spec.run_id] = maps
        if advance is not None:
            advance(sum(spec.robot_ticks for spec in specs if spec.run_id in found))
    made: dict[str, list[FloorMaps]] = {}
    for spec in specs:
        made.setdefault(policy_label(spec.policy), []).append(found[spec.run_id])
    means = [_mean_maps(maps, label) for label, maps in made.items()]
    return [*means, *(one.minus(means[0]) for one in means[1:])]


def write_maps(picture: str | Path, maps: Sequence[FloorMaps]) -> None:
    """Write arrays to .npz files beside a picture, and then draw it.

    Raises:
        ConfigError: an ending that no picture has.
        ImportError: matplotlib is not installed; the arrays are written.
    """
    for one in maps:
        one.write(Path(picture).with_suffix(f".{as_file_name(one.label)}.npz"))
    draw_maps(picture, maps)


def draw_maps(path: str | Path, maps: Sequence[FloorMaps]) -> None:
    """Draw maps of floors of the same proportions: a row of panels per map or difference, a column per quantity.

    All maps in a column share one scale, and so do all differences, where white is 0.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        maps: One per row.
    """
    width_m, height_m = maps[0].size_m
    names = [name for name in MEANINGS if name in maps[0].arrays]
    size_in = _MAP_IN * len(names), (0.75 * height_m / width_m * _MAP_IN + 0.25) * len(maps) + 0.6
    with saved_figure(path, size_in) as figure:
        panels = figure.subplots(len(maps), len(names), squeeze=False, sharex=True, sharey=True)
        for column, name in enumerate(names):
            what, unit = MEANINGS[name]
            panels[0, column].set_title(what)
            for is_difference in (False, True):
                rows = [row for row, one in enumerate(maps) if one.is_difference == is_difference]
                if not rows:
                    continue
                top = _map_top([maps[row].arrays[name] for row in rows])
                image: Any = None
                for row in rows:
                    image = _draw_map(panels[row, column], maps[row], name, top)
                ends = "both" if is_difference else "max"
                scale = figure.colorbar(image, ax=[panels[row, column] for row in rows], extend=ends)
                scale.set_label(f"more {unit}" if is_difference else unit)
        for one, line in zip(maps, panels[:, 0], strict=True):
            line.set_ylabel(f"{policy_words(one.label)}\ny (m)")
        for panel in panels[-1]:
            panel.set_xlabel("x (m)")


def _draw_map(panel: Panel, maps: FloorMaps, name: str, top: float) -> Any:
    """Draw the squares of one map, and what stands on its floor; returns the image."""
    low, colours, nest = (-top, "RdBu_r", "black") if maps.is_difference else (0.0, "cividis", "white")
    extent = (0, maps.size_m[0], 0, maps.size_m[1])
    image = panel.imshow(maps.arrays[name], origin="lower", extent=extent, vmin=low, vmax=top, cmap=colours)
    outline = {"facecolor": "none", "edgecolor": nest, "linestyle": "--", "linewidth": 0.8}
    for boxes, look in ((maps.obstacles_m, _OBSTACLE), (maps.nests_m, outline)):
        for x_low, y_low, x_high, y_high in boxes:
            panel.fill([x_low, x_high, x_high, x_low], [y_low, y_low, y_high, y_high], **look)
    panel.grid(visible=False)
    return image


def _map_top(arrays: Sequence[FloatArray]) -> float:
    """Return the end of the scale of maps: few squares hold most; the last percent would hide all others."""
    values = np.abs(np.concatenate([array.ravel() for array in arrays]))
    return float(np.quantile(values[values > 0], 0.99)) if values.any() else 1.0


def _map_run(spec: RunSpec) -> FloorMaps:
    """Make a run and return its maps."""
    return floor_maps(record_replay(spec))


def _mean_maps(maps: Sequence[FloorMaps], label: str) -> FloorMaps:
    """Return the mean of maps of several runs of one experiment, under another label."""
    arrays = {name: np.mean([one.arrays[name] for one in maps], axis=0) for name in MEANINGS}
    return replace(maps[0], label=label, arrays=arrays)
