"""ObservationLayout: the named slices of an observation row. Sensors write them, policies read them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

from swarm_forage_env.scenarios.floor import WHEEL_SCALE_MPS

RING_SENSORS = 24
"""Proximity beams, and as many light sensors: on one ring, every 15 degrees, the first at 7.5 degrees to the left."""
LIGHT_IF_CARRYING = "light if carrying"
"""Entry of `reads`: light is read in rows of robots that carry; the others may stay zero."""
GROUND_SENSORS = 4
WINDOW_CELLS = 5
"""Side of the square line-of-sight window, in cells (1.0 m)."""
VISIBLE_CACHES = 4
"""Caches listed in an observation, nearest first."""
CACHE_FIELDS = 4
"""serial, centre x, centre y, number of objects."""
SERIAL_SCALE = 2.0**24
"""Cache serial numbers below this are exact in float32."""
EVENT_SCALE = 16.0
NEIGHBOURS = "neighbours"
"""Name of the slice of the nearest robots, which a scenario may switch on."""
NEIGHBOUR_FIELDS = 4
"""forward, left, carrying, there; of each neighbour that an observation has room for."""
MESSAGES = "messages"
"""Name of the slice of what was heard, which a scenario may switch on."""
LayoutRow: TypeAlias = tuple[str, tuple[float, ...], str, str]
"""Name, scale, noise group and meaning of a slice, as in `ObservationSlice`; the columns follow from the order."""


@dataclass(frozen=True, slots=True)
class ObservationSlice:
    """One named group of columns.

    Attributes:
        name: Name of the slice.
        start: First column.
        size: Number of columns.
        scale: Natural units per 1.0 of observation, one number per column.
        noise_group: Group that `SensorNoise` may perturb, or "" for exact columns.
        meaning: What the columns hold, as a text for readers.
    """

    name: str
    start: int
    size: int
    scale: tuple[float, ...]
    noise_group: str
    meaning: str

    @property
    def stop(self) -> int:
        """One past the last column."""
        return self.start + self.size

    @property
    def row(self) -> LayoutRow:
        """What `layout_of` takes, to give another layout the same slice."""
        return self.name, self.scale, self.noise_group, self.meaning


@dataclass(frozen=True, slots=True)
class ObservationLayout:
    """Named slices of one observation row, in column order.

    `layout["proximity"]` is a `slice` for indexing columns: `obs[:, layout["proximity"]]`.
    """

    slices: tuple[ObservationSlice, ...]

    @property
    def size(self) -> int:
        """Number of columns D."""
        return self.slices[-1].stop

    @property
    def names(self) -> tuple[str, ...]:
        """Slice names in column order."""
        return tuple(part.name for part in self.slices)

    def part(self, name: str) -> ObservationSlice:
        """Return the slice called `name`; raises KeyError listing the known names."""
        for part in self.slices:
            if part.name == name:
                return part
        raise KeyError(f"Unknown observation slice {name!r}; known slices: {', '.join(self.names)}.")

    def __getitem__(self, name: str) -> slice:
        part = self.part(name)
        return slice(part.start, part.stop)

    def __iter__(self) -> Iterator[ObservationSlice]:
        return iter(self.slices)

    def describe(self) -> str:
        """Return the layout as a text table, one line per slice."""
        lines = [f"{'columns':>9}  {'slice':<13} {'noise':<12} meaning"]
        for part in self.slices:
            columns = f"{part.start}..{part.stop - 1}" if part.size > 1 else f"{part.start}"
            lines.append(f"{columns:>9}  {part.name:<13} {part.noise_group or 'exact':<12} {part.meaning}")
        return "\n".join(lines)


def layout_of(rows: Iterable[LayoutRow]) -> ObservationLayout:
    """Lay out slices one after the other, from column 0."""
    slices: list[ObservationSlice] = []
    start = 0
    for name, scale, noise_group, meaning in rows:
        slices.append(ObservationSlice(name, start, len(scale), scale, noise_group, meaning))
        start += len(scale)
    return ObservationLayout(tuple(slices))


@cache
def observation_layout(
    width_m: float, height_m: float, n_objects: int, further: tuple[LayoutRow, ...] = ()
) -> ObservationLayout:
    """Build the layout of an arena of `width_m` x `height_m` metres with `n_objects` objects.

    All columns lie in [-1, 1]; readings keep their natural [0, 1]. The slices `further` come last.
    """
    half_x, half_y, rows = width_m / 2.0, height_m / 2.0, float(n_objects)
    cache_scale = (SERIAL_SCALE, half_x, half_y, rows)
    window = WINDOW_CELLS * WINDOW_CELLS
    table: list[LayoutRow] = [
        ("proximity", (1.0,) * RING_SENSORS, "proximity", "beam k at 7.5 + 15 k deg: 0 nothing, 1 contact"),
        ("light", (1.0,) * RING_SENSORS, "light", "nest light, sensor k at 7.5 + 15 k deg"),
        ("ground", (1.0,) * GROUND_SENSORS, "ground", "floor grey: object 0, cache 0.4, nest 0.7, empty 1"),
        ("wheel_speed", (WHEEL_SCALE_MPS,) * 2, "wheel_speed", "applied left, right wheel speed / 0.20 m/s"),
        ("position", (half_x, half_y), "position", "2 x / X - 1, 2 y / Y - 1"),
        ("heading", (1.0, 1.0), "heading", "cos, sin of the heading"),
        ("carrying", (1.0,), "", "1 while carrying an object"),
        ("interacting", (1.0,), "", "1 while a pick-up or drop is in progress"),
        ("active", (1.0,), "", "1 while part of the tasked swarm"),
        ("cargo", (rows,), "", "(object row + 1) / M of the carried object, 0 = none"),
        ("event_object", (rows,), "", "(object row + 1) / M of this step's event, 0 = none"),
        ("event", (EVENT_SCALE,), "", "Event code / 16 of this step, 0 = none"),
        ("event_cache", cache_scale, "", "cache of this step's event: serial x 2^-24, centre x, y, count / M"),
        ("los_cell", (half_x, half_y), "", "centre of the robot's own cell"),
        ("los_object", (rows,) * window, "", "(row + 1) / M per cell of the 5 x 5 window, row-major from lower left"),
        ("los_cache", cache_scale * VISIBLE_CACHES, "", "up to 4 caches meeting the window, nearest first"),
    ]
    return layout_of((*table, *further))


def neighbours_row(n_seen: int, range_m: float) -> LayoutRow:
    """Return the slice of the `n_seen` nearest robots within `range_m` metres."""
    meaning = f"{n_seen} nearest robots: forward, left / {range_m:g} m, 1 if carrying, 1 if there is one"
    return NEIGHBOURS, (range_m, range_m, 1.0, 1.0) * n_seen, "", meaning


def messages_row(message_size: int) -> LayoutRow:
    """Return the slice of what was heard: the mean of the messages, and whether there was any."""
    return MESSAGES, (1.0,) * (message_size + 1), "", "mean of the messages heard; 1 if there was one"


BUILT_IN_SLICES = observation_layout(1.0, 1.0, 1).names
"""Names of the slices that every observation has."""
