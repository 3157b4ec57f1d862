"""One picture of the world. Drawing reads the state arrays and never changes them."""

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError, whole
from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.contract.types import BoolArray
from swarm_forage_env.rendering.view import (
    CACHE_OPACITY,
    DETAIL,
    LEAST_TEXT_PX,
    NEST_OPACITY,
    SOURCE_OPACITY,
    Box,
    Colour,
    Palette,
    View,
    arena_view,
    legend_rows,
    scale_bar_m,
    text_font,
    text_width,
)
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WALL_M
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState

if TYPE_CHECKING:
    from PIL import Image

_SMALLEST_TEXT_PX = 6.0
_SMALLEST_DETAILED_PX = 2.0
"""Robots below this radius are plain discs."""
_TRAIL_OPACITY = 0.55
"""Of the newest part of a trail."""


class Trails:
    """Recent positions of all robots, for `render_frame` to draw as fading lines.

    Attributes:
        position: (n_samples, N, 2) m, oldest first; NaN where there is no position.
        carrying: (n_samples, N) whether the robot carried an object then.
    """

    def __init__(self, n_robots: int, n_samples: int) -> None:
        """Remember `n_samples` positions, at least 2, of each robot; one is added per call of `add`."""
        whole("n_samples", n_samples, at_least=2)
        self.position = np.full((n_samples, n_robots, 2), np.nan)
        self.carrying: BoolArray = np.zeros((n_samples, n_robots), np.bool_)

    def add(self, swarm: SwarmState) -> None:
        """Remember where the robots are now; robots without a body leave a gap."""
        now = np.where(swarm.present[:, None], swarm.position, np.nan)
        self.position = np.concatenate((self.position[1:], now[None]))
        self.carrying = np.concatenate((self.carrying[1:], swarm.carried_object[None] >= 0))


def render_frame(
    scenario: ScenarioConfig,
    swarm: SwarmState,
    objects: ObjectState,
    caches: CacheState,
    events: StepEvents,
    *,
    tick: int,
    size_px: int = 900,
    trails: Trails | None = None,
    title: str | None = None,
) -> NDArray[np.uint8]:
    """Draw the world. Reads the state, never writes it; equal states give equal pictures.

    Robots are far smaller than an arena (0.17 m across in 32 m). They are therefore drawn with a minimum radius of a
    few pixels, larger than life, and may look as if they overlap each other or a wall when they only come close; in
    very large swarms the minimum shrinks so that the swarm does not cover the floor. The same holds for objects.

    Args:
        scenario: The configuration.
        swarm: Robots: blue discs when empty, orange ones around a square while carrying, grey rings in repair; the
            needle shows the heading, a red ring interference, a grey cross where a robot died. Robots that are not
            born yet are left out.
        objects: Objects; the free ones are drawn where they lie.
        caches: Caches, drawn with the number of objects inside.
        events: Counters for the line of figures, and which robots are in interference.
        tick: Ticks done since reset, for the clock.
        size_px: Longer side of the drawn arena in pixels; a header and a legend come on top.
        trails: Past positions to draw as fading lines.
        title: Headline; default the scenario's name and size.

    Returns:
        (H, W, 3) uint8 picture, first row at the top.

    Raises:
        ConfigError: `size_px` out of range, or trails of another number of robots.
        ImportError: Pillow is not installed.
    """
    view = arena_view(scenario, size_px)
    image = _ground(scenario, size_px).copy()
    if trails is not None:
        _draw_trails(image, view, trails, len(swarm.heading))
    pen = _Pen(image)
    there = caches.alive
    places = [*zip(view.pixels((caches.cell[there] + 0.5) * CELL_M).tolist(), caches.count[there], strict=True)]
    for (x, y), _ in places:
        pen.sign("cache", x, y, scenario.cache_side_cells * CELL_M * view.scale / 2, line=max(1.0, 1.5 * view.unit))
    for x, y in view.pixels((objects.cell[objects.status == ObjectStatus.FREE] + 0.5) * CELL_M).tolist():
        pen.square(x, y, view.object_px, Palette.object)
    _draw_robots(pen, view, swarm, events)
    for (x, y), n_objects in places:
        pen.text(x, y, str(n_objects), Palette.text, 1.5 * view.text_px, "mm", rim=Palette.floor)
    _write_header(pen, view, scenario, swarm, events, tick, title)
    return np.asarray(image.reduce(DETAIL))


class _Pen:
    """Draws on an image of `DETAIL` times the size; places and lengths are pixels of the finished picture."""

    def __init__(self, image: "Image.Image") -> None:
        from PIL import ImageDraw

        self._draw = ImageDraw.Draw(image, "RGBA")

    def box(self, box: Box, colour: Colour, opacity: float = 1.0) -> None:
        left, top, right, bottom = (round(DETAIL * edge) for edge in box)
        if right > left and bottom > top:
            self._draw.rectangle((left, top, right - 1, bottom - 1), fill=(*colour, round(255 * opacity)))

    def frame(self, box: Box, line: float, colour: Colour) -> None:
        left, top, right, bottom = (round(DETAIL * edge) for edge in box)
        self._draw.rectangle((left, top, right - 1, bottom - 1), outline=colour, width=max(1, round(DETAIL * line)))

    def square(self, x: float, y: float, side: float, colour: Colour) -> None:
        self.box((x - side / 2, y - side / 2, x + side / 2, y + side / 2), colour)

    def disc(self, x: float, y: float, radius: float, colour: Colour, opacity: float = 1.0) -> None:
        edges = [DETAIL * edge for edge in (x - radius, y - radius, x + radius, y + radius)]
        self._draw.ellipse(edges, fill=(*colour, round(255 * opacity)))

    def ring(self, x: float, y: float, radius: float, line: float, colour: Colour) -> None:
        reach = radius + line / 2
        edges = [DETAIL * edge for edge in (x - reach, y - reach, x + reach, y + reach)]
        self._draw.ellipse(edges, outline=colour, width=max(1, round(DETAIL * line)))

    def line(self, ends: Box, width: float, colour: Colour) -> None:
        self._draw.line([DETAIL * end for end in ends], fill=colour, width=max(1, round(DETAIL * width)))

    def text(
        self, x: float, y: float, words: str, colour: Colour, text_px: float, anchor: str, rim: Colour | None = None
    ) -> None:
        self._draw.text(
            (DETAIL * x, DETAIL * y),
            words,
            fill=colour,
            font=text_font(text_px),
            anchor=anchor,
            stroke_width=0 if rim is None else 2 * DETAIL,
            stroke_fill=rim,
        )

    def sign(self, name: str, x: float, y: float, radius: float, *, heading: float = 0.0, line: float = 1.0) -> None:
        """Draw a thing by its name in the legend."""
        box = (x - radius, y - radius, x + radius, y + radius)
        if name in ("empty", "carrying"):
            colour = Palette.empty if name == "empty" else Palette.carrying
            if radius >= _SMALLEST_DETAILED_PX:  # a rim separates robots that touch
                self.disc(x, y, radius + max(0.5, 0.22 * radius), Palette.floor)
                ahead, aside = 2.1 * radius * math.cos(heading), -2.1 * radius * math.sin(heading)
                self.line((x, y, x + ahead, y + aside), 0.5 * radius, colour)
            self.disc(x, y, radius, colour)
            if name == "carrying":
                self.square(x, y, 0.85 * radius, Palette.object)
        elif name == "in interference":
            self.ring(x, y, 1.55 * radius + 0.5, max(1.5, 0.4 * radius), Palette.interference)
        elif name == "in repair":
            self.ring(x, y, 0.8 * radius, 0.4 * radius, Palette.repair)
        elif name == "dead":
            half = 0.75 * radius
            self.line((x - half, y - half, x + half, y + half), 0.4 * radius, Palette.repair)
            self.line((x - half, y + half, x + half, y - half), 0.4 * radius, Palette.repair)
        elif name == "object":
            self.square(x, y, 1.2 * radius, Palette.object)
        elif name == "obstacle":
            self.box(box, Palette.wall)
        elif name == "source":
            self.box(box, Palette.source, 4 * SOURCE_OPACITY)
        else:
            colour, opacity = (Palette.nest, NEST_OPACITY) if name == "nest" else (Palette.cache, CACHE_OPACITY)
            self.box(box, colour, opacity)
            self.frame(box, line, colour)


@lru_cache(maxsize=4)
def _ground(scenario: ScenarioConfig, size_px: int) -> "Image.Image":
    """Return what never changes during a run, at `DETAIL` times the size."""
    from PIL import Image

    view, arena = arena_view(scenario, size_px), scenario.arena
    image = Image.new("RGB", (DETAIL * view.width, DETAIL * view.height), Palette.page)
    pen = _Pen(image)
    outer = view.box((-WALL_M, -WALL_M, arena.width_m + WALL_M, arena.height_m + WALL_M))
    inner, line = view.box(arena.interior_m), 2.0 * view.unit  # walls of huge arenas would vanish
    pen.box(outer, Palette.wall)
    lows = max(inner[0], outer[0] + line), max(inner[1], outer[1] + line)
    pen.box((*lows, min(inner[2], outer[2] - line), min(inner[3], outer[3] - line)), Palette.floor)
    if not scenario.objects.is_drawn:
        for left, low, right, high in scenario.source_cells:
            box = view.box((CELL_M * left, CELL_M * low, CELL_M * right, CELL_M * high))
            pen.box(box, Palette.source, SOURCE_OPACITY)
    for nest in map(view.box, arena.nest_boxes_m):
        pen.box(nest, Palette.floor)  # a source may reach under a nest
        pen.box(nest, Palette.nest, NEST_OPACITY)
        pen.frame(nest, max(1.0, 1.5 * view.unit), Palette.nest)
    for box in arena.obstacles:
        pen.box(view.box(box), Palette.wall)
    for x, y in view.pixels(np.asarray(arena.lights_m)[:, :2]).tolist():
        for ring in range(12):
            pen.disc(x, y, 22.0 * view.unit * (12 - ring) / 12, Palette.light, 0.03)
        pen.disc(x, y, max(1.5, 3.0 * view.unit), Palette.light)
    _draw_legend(pen, view, scenario)
    return image


def _draw_legend(pen: _Pen, view: View, scenario: ScenarioConfig) -> None:
    text_px, colour = view.text_px, Palette.faint_text
    top = view.bottom + WALL_M * view.scale
    rows = legend_rows(scenario, view.width, view.scale)
    for name, x, y in (entry for row in rows for entry in row):
        room = 0.42 * text_px
        small = {"empty": 0.75, "carrying": 0.75, "in interference": 0.6}
        pen.sign(name, x + 0.5 * text_px, top + y, small.get(name, 1.0) * room)
        pen.text(x + 1.45 * text_px, top + y, name, colour, text_px, "lm")
    bar_m = scale_bar_m(scenario.arena.width_m)
    right, middle = view.width - text_px, top + rows[0][0][2]
    start = right - bar_m * view.scale
    pen.box((start, middle - 1, right, middle + 1), colour)
    for x in (start, right - 1.5):
        pen.box((x, middle - 4, x + 1.5, middle + 4), colour)
    pen.text(start - 0.5 * text_px, middle, f"{bar_m} m", colour, text_px, "rm")


def _draw_trails(image: "Image.Image", view: View, trails: Trails, n_robots: int) -> None:
    from PIL import Image, ImageDraw

    n_samples, n_known = trails.carrying.shape
    if n_known != n_robots:
        raise ConfigError(f"Expected trails of {n_robots} robots, got {n_known}; make new ones per world.")
    ends = DETAIL * view.pixels(np.concatenate((trails.position[:-1], trails.position[1:]), axis=2).reshape(-1, 2))
    ends = ends.reshape(n_samples - 1, n_robots, 4)
    width = max(1, round(DETAIL * max(0.8, 0.4 * view.robot_px)))
    for loaded, colour in ((False, Palette.empty), (True, Palette.carrying)):
        share = Image.new("L", image.size)
        pen = ImageDraw.Draw(share)
        for sample in range(n_samples - 1):
            strength = round(255 * _TRAIL_OPACITY * ((sample + 1) / n_samples) ** 1.5)
            rows = np.isfinite(ends[sample]).all(axis=1) & (trails.carrying[sample] == loaded)
            for piece in ends[sample, rows].tolist():
                pen.line(piece, fill=strength, width=width)
        image.paste(colour, mask=share)


def _draw_robots(pen: _Pen, view: View, swarm: SwarmState, events: StepEvents) -> None:
    working, carrying = swarm.present & swarm.active, swarm.carried_object >= 0
    shown = {
        "dead": swarm.dead,
        "in repair": swarm.present & ~swarm.active,
        "empty": working & ~carrying,
        "carrying": working & carrying,
        "in interference": working & events.interfering,
    }
    places: list[tuple[float, float]] = [*map(tuple, view.pixels(swarm.position).tolist())]
    heading: list[float] = swarm.heading.tolist()
    for name, rows in shown.items():
        for robot in np.flatnonzero(rows).tolist():
            pen.sign(name, *places[robot], view.robot_px, heading=heading[robot])
    for robot in np.flatnonzero(shown["in repair"] & carrying).tolist():
        pen.square(*places[robot], 0.85 * view.robot_px, Palette.object)


def _write_header(
    pen: _Pen,
    view: View,
    scenario: ScenarioConfig,
    swarm: SwarmState,
    events: StepEvents,
    tick: int,
    title: str | None,
) -> None:
    """Write headline, clock and figures above the arena."""
    arena, count, margin = scenario.arena, events.counters, view.text_px
    headline = title or f"{scenario.name.replace('_', ' ')}, {arena.width_m:g} x {arena.height_m:g} m"
    clock = f"{tick * scenario.dt_s:,.0f} s"
    carrying = swarm.present & (swarm.carried_object >= 0)
    done = f"{count[Counter.COLLECTED]:,} delivered    {count[Counter.FIRST_PICKED]:,} first pick-ups"
    now = (
        f"{np.count_nonzero(swarm.active & swarm.present):,} robots    {np.count_nonzero(carrying):,} carrying    "
        f"{np.count_nonzero(events.interfering & swarm.active):,} in interference"
    )
    room = view.width - 2 * margin
    wide = room - text_width(f"{clock}  ", 1.35 * margin)
    size = _fitting(headline, 1.35 * margin, wide, LEAST_TEXT_PX)
    n_letters = int(len(headline) * wide / text_width(headline, size))
    shown = headline if n_letters >= len(headline) else f"{headline[: max(1, n_letters - 4)]} ..."
    pen.text(margin, 0.33 * view.header, shown, Palette.text, size, "lm")
    pen.text(margin + room, 0.33 * view.header, clock, Palette.text, 1.35 * margin, "rm")
    size = _fitting(f"{done}    {now}", margin, room)
    pen.text(margin, 0.75 * view.header, done, Palette.faint_text, size, "lm")
    pen.text(margin + room, 0.75 * view.header, now, Palette.faint_text, size, "rm")


def _fitting(words: str, text_px: float, room: float, least_px: float = _SMALLEST_TEXT_PX) -> float:
    """Return a height, at most `text_px`, in which a line fits into `room` pixels, if any down to `least_px` does."""
    while text_width(words, text_px) > room and text_px > least_px:
        text_px = max(least_px, text_px - 1.0)
    return text_px
