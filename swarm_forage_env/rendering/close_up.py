"""A close-up of one robot: its surroundings in true size, its beams, and its line-of-sight window."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.detection import BEAM_ANGLES_RAD
from swarm_forage_env.contract.layout import WINDOW_CELLS, ObservationLayout
from swarm_forage_env.contract.policy import RememberedPlaces
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray
from swarm_forage_env.rendering.paint import (
    Canvas,
    Canvases,
    Colour,
    paint_box,
    paint_crosses,
    paint_discs,
    paint_frame,
    paint_needles,
    paint_rings,
    paint_squares,
    plain,
)
from swarm_forage_env.rendering.view import CACHE_OPACITY, NEST_OPACITY, THEMES, Palette
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WALL_M
from swarm_forage_env.world.sensors import PROXIMITY_RANGE_M
from swarm_forage_env.world.state import CacheState, ObjectState, SwarmState

_GAP_AT_FULL_READING_M = 0.01
"""A reading r tells of a gap of about this / r."""
_FAINT = 0.35
_MEMORY_LINE_PX = 2.0


@dataclass(frozen=True, slots=True)
class _Lens:
    """Metres to pixels of a square picture around a place, and its colours."""

    centre: FloatArray
    scale: float
    size_px: int
    palette: Palette

    def pixels(self, position_m: NDArray[np.floating]) -> FloatArray:
        middle = self.size_px / 2.0
        return (np.asarray(position_m, np.float64) - self.centre) * (self.scale, -self.scale) + middle

    def shows(self, pixel: FloatArray, reach_px: float) -> BoolArray:
        """Return which of the things at `pixel` (n, 2) reach into the picture."""
        half = self.size_px / 2.0
        return np.abs(pixel - half).max(axis=1) < half + reach_px

    def box(self, box_m: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
        (left, bottom), (right, top) = self.pixels(np.array([box_m[:2], box_m[2:]]))
        return float(left), float(top), float(right), float(bottom)


def render_close_up(
    scenario: ScenarioConfig,
    swarm: SwarmState,
    objects: ObjectState,
    caches: CacheState,
    *,
    robot: int,
    obs: ObsArray,
    layout: ObservationLayout,
    remembered: RememberedPlaces | None = None,
    side_m: float = 1.6,
    size_px: int = 300,
    theme: str = "dark",
) -> NDArray[np.uint8]:
    """Draw the surroundings of one robot. Reads the state, never writes it.

    Everything has its true size. Beams of the proximity sensor are lines from the body: faint where nothing is near,
    and else red, as long as the gap that the robot reads. The line-of-sight window is a square of 5 x 5 cells; objects
    that the robot sees in it are bright, others are pale. A frame is around each cell in which the robot remembers an
    object, and around each cache that it remembers, whether it is still there or not.

    Args:
        scenario: The configuration.
        swarm: Robots.
        objects: Objects.
        caches: Caches.
        robot: Row of the robot.
        obs: (D,) what it observes, noise included.
        layout: Columns of `obs`.
        remembered: Where it remembers things, if its policy tells.
        side_m: Side of the square that is shown.
        size_px: Side of the picture.
        theme: "dark" or "light".

    Returns:
        (size_px, size_px, 3) uint8 picture.
    """
    lens = _Lens(swarm.position[robot].copy(), size_px / side_m, size_px, THEMES[theme])
    canvases = _canvases(size_px, lens.palette.floor)
    canvas = canvases.borrow()
    _draw_ground(canvas, lens, scenario, caches)
    _draw_objects(canvas, lens, objects, obs[layout["los_object"]])
    if remembered is not None:
        _draw_memory(canvas, lens, remembered, scenario.cache_side_cells * CELL_M)
    _draw_window(canvas, lens, swarm.position[robot])
    _draw_beams(canvas, lens, scenario, swarm, robot, obs[layout["proximity"]])
    _draw_robots(canvas, lens, scenario, swarm, robot)
    picture = canvas.take_picture()
    canvases.give_back(canvas)
    return picture


@lru_cache(maxsize=2)
def _canvases(size_px: int, floor: Colour) -> Canvases:
    return Canvases(plain(size_px, size_px, floor))


def _draw_ground(canvas: Canvas, lens: _Lens, scenario: ScenarioConfig, caches: CacheState) -> None:
    arena = scenario.arena
    left, top, right, bottom = lens.box(arena.interior_m)
    if max(left, top) > 0.0 or min(right, bottom) < lens.size_px:  # more is to be seen than the floor
        paint_box(canvas, (0.0, 0.0, lens.size_px, lens.size_px), lens.palette.page)
        paint_box(
            canvas, lens.box((-WALL_M, -WALL_M, arena.width_m + WALL_M, arena.height_m + WALL_M)), lens.palette.wall
        )
        paint_box(canvas, (left, top, right, bottom), lens.palette.floor)
    for nest in arena.nest_boxes_m:
        paint_box(canvas, lens.box(nest), lens.palette.nest, NEST_OPACITY)
    for obstacle in arena.obstacles:
        paint_box(canvas, lens.box(obstacle), lens.palette.wall)
    half = scenario.cache_side_cells * CELL_M / 2
    for x, y in (caches.cell[caches.alive] + 0.5) * CELL_M:
        box = lens.box((x - half, y - half, x + half, y + half))
        paint_box(canvas, box, lens.palette.cache, CACHE_OPACITY)
        paint_frame(canvas, box, 2.0, lens.palette.cache)


def _draw_objects(canvas: Canvas, lens: _Lens, objects: ObjectState, los_object: ObsArray) -> None:
    seen = np.rint(los_object[los_object > 0] * len(objects.status)).astype(np.int64) - 1
    side = 0.8 * CELL_M * lens.scale
    place = lens.pixels((objects.cell + 0.5) * CELL_M)
    lying = (objects.status == ObjectStatus.FREE) & lens.shows(place, side)
    paint_squares(canvas, place[lying], side, lens.palette.object, _FAINT)
    paint_squares(canvas, place[seen], side, lens.palette.object)


def _draw_memory(canvas: Canvas, lens: _Lens, remembered: RememberedPlaces, cache_side_m: float) -> None:
    for places_m, side_m in ((remembered.objects_m, CELL_M), (remembered.caches_m, cache_side_m + CELL_M)):
        half = side_m / 2.0
        for x, y in places_m[lens.shows(lens.pixels(places_m), half * lens.scale)].tolist():
            paint_frame(canvas, lens.box((x - half, y - half, x + half, y + half)), _MEMORY_LINE_PX, lens.palette.text)


def _draw_window(canvas: Canvas, lens: _Lens, position: FloatArray) -> None:
    low = (np.floor(position / CELL_M) - WINDOW_CELLS // 2) * CELL_M
    side = WINDOW_CELLS * CELL_M
    x, y = low.tolist()
    paint_frame(canvas, lens.box((x, y, x + side, y + side)), 2.0, lens.palette.light, 0.6)


def _draw_beams(
    canvas: Canvas, lens: _Lens, scenario: ScenarioConfig, swarm: SwarmState, robot: int, readings: ObsArray
) -> None:
    angle = swarm.heading[robot] + BEAM_ANGLES_RAD
    direction = np.column_stack([np.cos(angle), -np.sin(angle)])
    radius_px = scenario.robots.radius_m * lens.scale
    centre = lens.pixels(swarm.position[robot])
    start = centre + radius_px * direction
    reach_px = PROXIMITY_RANGE_M * lens.scale
    line = max(1.0, 0.008 * lens.scale)
    near = readings > 0
    paint_needles(canvas, start[~near], direction[~near], reach_px, line, lens.palette.wall)
    for beam in np.flatnonzero(near):  # each has a length of its own
        length = min(reach_px, _GAP_AT_FULL_READING_M / float(readings[beam]) * lens.scale)
        rows = slice(beam, beam + 1)
        paint_needles(canvas, start[rows], direction[rows], length, 2.0 * line, lens.palette.interference)


def _draw_robots(canvas: Canvas, lens: _Lens, scenario: ScenarioConfig, swarm: SwarmState, robot: int) -> None:
    radius = scenario.robots.radius_m * lens.scale
    centre = lens.pixels(swarm.position)
    visible = lens.shows(centre, 2.0 * radius)
    shown = swarm.present & visible
    paint_crosses(canvas, centre[swarm.dead & visible], radius, 0.4 * radius, lens.palette.repair)
    carrying = swarm.carried_object >= 0
    direction = np.column_stack([np.cos(swarm.heading), -np.sin(swarm.heading)])
    paint_rings(canvas, centre[shown & ~swarm.active], 0.8 * radius, 0.4 * radius, lens.palette.repair)
    for is_loaded, colour in ((False, lens.palette.empty), (True, lens.palette.carrying)):
        rows = shown & swarm.active & (carrying == is_loaded)
        paint_discs(canvas, centre[rows], radius, colour)
        paint_needles(canvas, centre[rows], direction[rows], radius, 0.15 * radius, lens.palette.page)
    paint_squares(canvas, centre[shown & carrying], 0.85 * radius, lens.palette.object)
    paint_rings(canvas, centre[robot : robot + 1], radius + 2.0, 2.0, lens.palette.text)
