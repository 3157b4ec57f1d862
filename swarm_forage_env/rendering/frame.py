"""One picture of the world. Drawing reads the state arrays and never changes them."""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.contract.types import BoolArray, FloatArray
from swarm_forage_env.rendering.paint import (
    Canvas,
    Canvases,
    Colour,
    paint_box,
    paint_crosses,
    paint_discs,
    paint_frame,
    paint_glows,
    paint_needles,
    paint_rings,
    paint_squares,
    plain,
)
from swarm_forage_env.rendering.view import (
    CACHE_OPACITY,
    NEST_OPACITY,
    SOURCE_OPACITY,
    Palette,
    RenderError,
    View,
    arena_view,
    legend_rows,
    scale_bar_m,
    text_font,
    text_height,
)
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WALL_M
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState

if TYPE_CHECKING:
    from PIL import ImageDraw

_SMALLEST_TEXT_PX = 6.0
_SMALLEST_DETAILED_PX = 2.0
"""Robots below this radius are plain discs."""


class Trails:
    """Recent positions of all robots, for `render_frame` to draw as fading lines.

    Args:
        n_robots: Number of robots N.
        n_samples: Positions remembered per robot; one is added per call of `add`.
    """

    def __init__(self, n_robots: int, n_samples: int) -> None:
        if n_samples < 2:
            raise RenderError(f"Expected n_samples >= 2 positions to join by a line, got {n_samples}.")
        self._position = np.full((n_samples, n_robots, 2), np.nan)
        self._carrying = np.zeros((n_samples, n_robots), np.bool_)

    def add(self, swarm: SwarmState) -> None:
        """Remember where the robots are now; robots without a body leave a gap."""
        self._position[:-1] = self._position[1:]
        self._carrying[:-1] = self._carrying[1:]
        self._position[-1] = np.where(swarm.present[:, None], swarm.position, np.nan)
        self._carrying[-1] = swarm.carried_object >= 0

    @property
    def position(self) -> FloatArray:
        """(n_samples, N, 2) m, oldest first; NaN where there is no position."""
        return self._position

    @property
    def carrying(self) -> BoolArray:
        """(n_samples, N) whether the robot carried an object then."""
        return self._carrying


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
    theme: str = "dark",
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
        theme: "dark" or "light".

    Returns:
        (H, W, 3) uint8 picture, first row at the top.

    Raises:
        RenderError: `size_px` out of range, no such theme, or trails of another number of robots.
        ImportError: Pillow is not installed.
    """
    view = arena_view(scenario, size_px, theme)
    canvases = _canvases(scenario, size_px, theme)
    canvas = canvases.borrow()
    if trails is not None:
        _draw_trails(canvas, view, trails, len(swarm.heading))
    _draw_caches(canvas, view, scenario, caches)
    lying = objects.cell[objects.status == ObjectStatus.FREE]
    paint_squares(canvas, view.pixels((lying + 0.5) * CELL_M), view.object_px, view.palette.object)
    _draw_robots(canvas, view, swarm, events)
    picture = canvas.take_picture()
    canvases.give_back(canvas)
    _write_header(picture, view, scenario, swarm, events, tick, title)
    _write_counts(picture, view, caches)
    return picture


@lru_cache(maxsize=4)
def _canvases(scenario: ScenarioConfig, size_px: int, theme: str) -> Canvases:
    """Canvases that show all parts that never change during a run; these are painted once."""
    view = arena_view(scenario, size_px, theme)
    arena = scenario.arena
    canvas = Canvas(plain(view.height, view.width, view.palette.page))
    left, top, right, bottom = view.box((-WALL_M, -WALL_M, arena.width_m + WALL_M, arena.height_m + WALL_M))
    paint_box(canvas, (left, top, right, bottom), view.palette.wall)
    inner = view.box(arena.interior_m)
    line = 2.0 * view.unit  # walls of huge arenas would vanish
    paint_box(
        canvas,
        (
            max(inner[0], left + line),
            max(inner[1], top + line),
            min(inner[2], right - line),
            min(inner[3], bottom - line),
        ),
        view.palette.floor,
    )
    if scenario.objects.placement != "power_law":  # its clusters are drawn anew in each run
        for cells in scenario.source_cells:
            x_low, y_low, x_high, y_high = (CELL_M * cell for cell in cells)
            paint_box(canvas, view.box((x_low, y_low, x_high, y_high)), view.palette.source, SOURCE_OPACITY)
    for nest in map(view.box, arena.nest_boxes_m):
        paint_box(canvas, nest, view.palette.floor)  # a source may reach under a nest
        paint_box(canvas, nest, view.palette.nest, NEST_OPACITY)
        paint_frame(canvas, nest, max(1.0, 1.5 * view.unit), view.palette.nest)
    for box in arena.obstacles:
        paint_box(canvas, view.box(box), view.palette.wall)
    lights = view.pixels(np.asarray(arena.lights_m)[:, :2])
    paint_glows(canvas, lights, 26.0 * view.unit, view.palette.light, 0.5)
    paint_discs(canvas, lights, max(1.5, 3.0 * view.unit), view.palette.light)
    return Canvases(_draw_legend(canvas, view, scenario))


def _draw_trails(canvas: Canvas, view: View, trails: Trails, n_robots: int) -> None:
    position, carrying = trails.position, trails.carrying
    n_samples = len(position)
    if position.shape[1] != n_robots:
        raise RenderError(f"Expected trails of {n_robots} robots, got {position.shape[1]}; make new ones per world.")
    start, step = position[:-1], np.diff(position, axis=0)
    known = np.isfinite(step).all(axis=2)
    if not known.any():
        return
    longest_px = view.scale * float(np.abs(step[known]).max())
    n_dots = int(np.clip(np.ceil(longest_px / 1.5), 1, 16))
    age = (np.arange(1, n_samples) / n_samples)[:, None]
    fade = np.broadcast_to(0.55 * age**1.5, known.shape)
    for loaded, colour in ((False, view.palette.empty), (True, view.palette.carrying)):
        rows = known & (carrying[:-1] == loaded)
        dots = [start[rows] + (k / n_dots) * step[rows] for k in range(n_dots)]
        radius = max(0.4, 0.2 * view.robot_px)
        paint_discs(canvas, view.pixels(np.concatenate(dots)), radius, colour, np.tile(fade[rows], n_dots))


def _draw_caches(canvas: Canvas, view: View, scenario: ScenarioConfig, caches: CacheState) -> None:
    for x, y in (caches.cell[caches.alive] + 0.5) * CELL_M:
        half = scenario.cache_side_cells * CELL_M / 2
        box = view.box((x - half, y - half, x + half, y + half))
        paint_box(canvas, box, view.palette.cache, CACHE_OPACITY)
        paint_frame(canvas, box, max(1.0, 1.5 * view.unit), view.palette.cache, 0.8)


def _draw_robots(canvas: Canvas, view: View, swarm: SwarmState, events: StepEvents) -> None:
    radius = view.robot_px
    centre = view.pixels(swarm.position)
    direction = np.stack((np.cos(swarm.heading), -np.sin(swarm.heading)), axis=1)
    working = swarm.present & swarm.active
    carrying = swarm.carried_object >= 0
    interfering = working & events.interfering
    paint_crosses(canvas, centre[swarm.dead], radius, 0.4 * radius, view.palette.repair)
    paint_rings(canvas, centre[swarm.present & ~swarm.active], 0.8 * radius, 0.4 * radius, view.palette.repair)
    for rows, colour in ((working & ~carrying, view.palette.empty), (working & carrying, view.palette.carrying)):
        _draw_bodies(canvas, centre[rows], direction[rows], radius, colour, view.palette)
    paint_squares(canvas, centre[swarm.present & carrying], 0.85 * radius, view.palette.object)
    paint_rings(canvas, centre[interfering], 1.55 * radius + 0.5, max(1.0, 0.36 * radius), view.palette.interference)


def _draw_bodies(
    canvas: Canvas, centre: FloatArray, direction: FloatArray, radius: float, colour: Colour, palette: Palette
) -> None:
    """Discs of one colour; unless they are tiny, they get needles and rims that separate robots that touch."""
    detailed = radius >= _SMALLEST_DETAILED_PX
    if detailed:
        paint_discs(canvas, centre, radius + max(0.5, 0.22 * radius), palette.floor)
    paint_discs(canvas, centre, radius, colour)
    if detailed:
        paint_rings(canvas, centre, radius + 0.2, max(0.5, 0.14 * radius), palette.page)
        paint_needles(canvas, centre, direction, 2.1 * radius, 0.4 * radius, colour)


def _draw_legend(canvas: Canvas, view: View, scenario: ScenarioConfig) -> NDArray[np.uint8]:
    """Paint the legend's symbols and write its text; returns the finished picture."""
    from PIL import Image, ImageDraw

    text_px = text_height(view.unit)
    top = round(view.bottom + WALL_M * view.scale)
    rows = legend_rows(scenario, view.width, view.scale)
    for row in rows:
        for name, x, y in row:
            _draw_symbol(canvas, view.palette, name, x + 0.5 * text_px, top + y, 0.42 * text_px)
    bar_m = scale_bar_m(scenario.arena.width_m)
    right, middle = view.width - text_px, top + rows[0][0][2]
    start = right - bar_m * view.scale
    paint_box(canvas, (start, middle - 1, right, middle + 1), view.palette.faint_text)
    for x in (start, right - 1.5):
        paint_box(canvas, (x, middle - 4, x + 1.5, middle + 4), view.palette.faint_text)
    picture = Image.fromarray(canvas.take_picture())
    pen = ImageDraw.Draw(picture)
    font = text_font(text_px)
    for row in rows:
        for name, x, y in row:
            pen.text((x + 1.45 * text_px, top + y), name, fill=view.palette.faint_text, font=font, anchor="lm")
    pen.text((start - 0.5 * text_px, middle), f"{bar_m} m", fill=view.palette.faint_text, font=font, anchor="rm")
    return np.array(picture)


def _draw_symbol(canvas: Canvas, palette: Palette, name: str, x: float, y: float, radius: float) -> None:
    """Paint the legend's symbol for `name` in a box of half side `radius` around (x, y)."""
    centre, ahead = np.array([[x, y]]), np.array([[1.0, 0.0]])
    box = (x - radius, y - radius, x + radius, y + radius)
    body = 0.75 * radius
    if name in ("empty", "carrying"):
        _draw_bodies(canvas, centre, ahead, body, palette.empty if name == "empty" else palette.carrying, palette)
        if name == "carrying":
            paint_squares(canvas, centre, 0.85 * body, palette.object)
    elif name == "in interference":
        paint_rings(canvas, centre, radius, max(1.0, 0.3 * radius), palette.interference)
    elif name == "in repair":
        paint_rings(canvas, centre, 0.8 * radius, 0.4 * radius, palette.repair)
    elif name == "dead":
        paint_crosses(canvas, centre, 0.8 * radius, 0.4 * radius, palette.repair)
    elif name == "object":
        paint_squares(canvas, centre, 1.2 * radius, palette.object)
    elif name == "source":
        paint_box(canvas, box, palette.source, 4 * SOURCE_OPACITY)
    elif name == "nest":
        paint_box(canvas, box, palette.nest, NEST_OPACITY)
        paint_frame(canvas, box, 1.0, palette.nest)
    elif name == "obstacle":
        paint_box(canvas, box, palette.wall)
    else:
        paint_box(canvas, box, palette.cache, CACHE_OPACITY)
        paint_frame(canvas, box, 1.0, palette.cache)


def _write_header(
    picture: NDArray[np.uint8],
    view: View,
    scenario: ScenarioConfig,
    swarm: SwarmState,
    events: StepEvents,
    tick: int,
    title: str | None,
) -> None:
    """Write headline, clock and figures above the arena."""
    from PIL import Image, ImageDraw

    top = view.bottom - (scenario.arena.height_m + WALL_M) * view.scale
    header = picture[: int(top)]
    written = Image.fromarray(header)  # a copy, so it is of no more than the rows that have text in them
    pen = ImageDraw.Draw(written)
    margin = text_height(view.unit)
    arena, count = scenario.arena, events.counters
    headline = title or f"{scenario.name.replace('_', ' ')}, {arena.width_m:g} x {arena.height_m:g} m"
    seconds = tick * scenario.dt_s
    n_active = int(np.count_nonzero(swarm.active & swarm.present))
    n_carrying = int(np.count_nonzero(swarm.present & (swarm.carried_object >= 0)))
    n_interfering = int(np.count_nonzero(events.interfering & swarm.active))
    done = f"{count[Counter.COLLECTED]:,} delivered    {count[Counter.FIRST_PICKED]:,} first pick-ups"
    now = f"{n_active:,} robots    {n_carrying:,} carrying    {n_interfering:,} in interference"
    room = view.width - 2 * margin
    _write_line(pen, 0.33 * top, headline, f"{seconds:,.0f} s", 1.35 * margin, margin, room, view.palette.text)
    _write_line(pen, 0.72 * top, done, now, margin, margin, room, view.palette.faint_text)
    header[:] = np.asarray(written)


def _write_counts(picture: NDArray[np.uint8], view: View, caches: CacheState) -> None:
    """Write into each cache how many objects it has."""
    from PIL import Image, ImageDraw

    font, line_px = text_font(1.5 * text_height(view.unit)), 2
    for (x, y), n_objects in zip(caches.cell[caches.alive], caches.count[caches.alive], strict=True):
        column, row = view.pixels(((x + 0.5) * CELL_M, (y + 0.5) * CELL_M)).tolist()
        text = str(n_objects)
        wide, high = int(font.getlength(text) / 2) + 2 * line_px, int(font.size) + 2 * line_px
        left, top = max(0, int(column) - wide), max(0, int(row) - high)
        place = picture[top : int(row) + high, left : int(column) + wide]
        written = Image.fromarray(place)
        ImageDraw.Draw(written).text(
            (column - left, row - top),
            text,
            fill=view.palette.text,
            font=font,
            anchor="mm",
            stroke_width=line_px,
            stroke_fill=view.palette.floor,
        )
        place[:] = np.asarray(written)


def _write_line(
    pen: "ImageDraw.ImageDraw",
    y: float,
    left: str,
    right: str,
    text_px: float,
    margin: float,
    room: float,
    colour: Colour,
) -> None:
    """Write one line with a left and a right part, smaller if the two would not fit into `room` pixels."""
    font = text_font(text_px)
    while font.getlength(left) + font.getlength(right) + 1.5 * text_px > room and text_px > _SMALLEST_TEXT_PX:
        text_px -= 1.0
        font = text_font(text_px)
    pen.text((margin, y), left, fill=colour, font=font, anchor="lm")
    pen.text((margin + room, y), right, fill=colour, font=font, anchor="rm")
