"""How a picture is laid out: colours, fonts, and where the arena and the legend go.

Robots, objects and caches are bright on a dark floor (our choice). The colours differ for
readers with the common forms of colour blindness, and shape is a second sign: interference is a ring, repair a hollow
disc.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from swarm_forage_env._internal.fields import whole
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WALL_M

if TYPE_CHECKING:
    from PIL import ImageFont

Colour: TypeAlias = tuple[int, int, int]
"""Red, green, blue in 0..255."""
Box: TypeAlias = tuple[float, float, float, float]
DETAIL = 2
"""Pictures are drawn at so many times their size, and made smaller at the end: that smooths all edges."""
MIN_SIZE_PX = 240
MAX_SIZE_PX = 4000
LEAST_TEXT_PX = 9.0
_REFERENCE_PX = 900.0
"""Picture width for which text and symbol sizes are given; other widths scale them."""


class Palette:
    """Colours of everything that is drawn."""

    page: Colour = (13, 17, 23)
    floor: Colour = (24, 31, 42)
    wall: Colour = (72, 85, 104)
    nest: Colour = (38, 166, 145)
    light: Colour = (255, 240, 190)
    source: Colour = (222, 190, 110)
    cache: Colour = (151, 80, 249)
    object: Colour = (240, 224, 170)
    empty: Colour = (76, 180, 255)
    carrying: Colour = (255, 150, 40)
    interference: Colour = (255, 72, 112)
    repair: Colour = (150, 160, 176)
    text: Colour = (230, 236, 244)
    faint_text: Colour = (150, 160, 176)


NEST_OPACITY = 0.30
SOURCE_OPACITY = 0.07
CACHE_OPACITY = 0.22


@dataclass(frozen=True, slots=True)
class View:
    """Where the arena lies in the picture: metres to pixels, y up to rows down."""

    width: int
    """Of the whole picture, pixels."""
    height: int
    scale: float
    """Pixels per metre."""
    left: float
    """Pixel column of the arena's origin."""
    bottom: float
    """Pixel row of the arena's origin."""
    header: int
    """Height of the header, pixels."""
    robot_px: float
    """Radius that robots are drawn with."""
    object_px: float
    """Side that objects are drawn with."""

    @property
    def unit(self) -> float:
        """Size of text and symbols relative to a picture 900 pixels wide."""
        return self.width / _REFERENCE_PX

    @property
    def text_px(self) -> float:
        """Height of ordinary text."""
        return text_height(self.unit)

    def pixels(self, position_m: ArrayLike) -> FloatArray:
        """Return pixel coordinates (column, row), shape (..., 2), of arena positions (..., 2) in metres."""
        return np.asarray(position_m, np.float64) * (self.scale, -self.scale) + (self.left, self.bottom)

    def box(self, box_m: Box) -> Box:
        """Return (left, top, right, bottom) in pixels of a rectangle (x low, y low, x high, y high) in metres."""
        (left, bottom), (right, top) = self.pixels(((box_m[0], box_m[1]), (box_m[2], box_m[3]))).tolist()
        return left, top, right, bottom


@lru_cache(maxsize=8)
def arena_view(scenario: ScenarioConfig, size_px: int = 900) -> View:
    """Return where `render_frame` puts the arena in its picture.

    Raises:
        ConfigError: `size_px` is not a whole number in [240, 4000].
        ImportError: Pillow is not installed (the legend's height depends on its text).
    """
    whole("size_px", size_px, at_least=MIN_SIZE_PX, at_most=MAX_SIZE_PX)
    arena = scenario.arena
    width_m, height_m = arena.width_m + 2 * WALL_M, arena.height_m + 2 * WALL_M
    scale = size_px / max(width_m, height_m)
    width = max(MIN_SIZE_PX, round(width_m * scale))
    unit = width / _REFERENCE_PX
    header, floor_px = round(max(40.0, 66.0 * unit)), round(height_m * scale)
    footer = round(legend_rows(scenario, width, scale)[-1][-1][2] + text_height(unit) * 1.2)
    area_px = arena.width_m * arena.height_m * scale * scale
    robot_gap = (area_px / scenario.robots.n_robots) ** 0.5
    object_gap = (area_px / scenario.objects.n_objects) ** 0.5
    grow = size_px / _REFERENCE_PX
    least_px = min(1.2, 0.3 * robot_gap)  # where they are as many as pixels, a dot each would cover all
    return View(
        width=width,
        height=header + floor_px + footer,
        scale=scale,
        left=(width - width_m * scale) / 2 + WALL_M * scale,
        bottom=header + floor_px - WALL_M * scale,
        header=header,
        robot_px=max(scenario.robots.radius_m * scale, min(4.6 * grow, max(least_px, 0.065 * robot_gap))),
        object_px=max(0.9 * CELL_M * scale, min(2.6 * grow, max(0.8, 0.35 * object_gap))),
    )


def legend_rows(scenario: ScenarioConfig, width: int, scale: float) -> list[list[tuple[str, float, float]]]:
    """Flow the legend into rows of (name, x, y of the middle below the arena) that fit `width` pixels."""
    there = {
        "source": not scenario.objects.is_drawn,
        "obstacle": bool(scenario.arena.obstacles),
        "cache": scenario.caches != "none",
    }
    names = (
        "empty",
        "carrying",
        "in interference",
        "in repair",
        "dead",
        "object",
        "source",
        "nest",
        "obstacle",
        "cache",
    )
    text_px = text_height(width / _REFERENCE_PX)
    bar = scale_bar_m(scenario.arena.width_m) * scale + 3.5 * text_px
    rows: list[list[tuple[str, float, float]]] = [[]]
    x, y = text_px, 1.3 * text_px
    for name in names:
        if not there.get(name, True):
            continue
        length = 1.45 * text_px + text_width(name, text_px)
        if rows[-1] and x + length > width - text_px - (bar if len(rows) == 1 else 0.0):
            rows.append([])
            x, y = text_px, y + 1.6 * text_px
        rows[-1].append((name, x, y))
        x += length + text_px
    return rows


def scale_bar_m(width_m: float) -> int:
    """Round length of about a tenth of the arena's width."""
    return max((length for length in (1, 2, 5, 10, 20, 50, 100) if length <= width_m / 6), default=1)


def text_height(unit: float) -> float:
    """Height of ordinary text, never too small to read."""
    return max(LEAST_TEXT_PX, 14.0 * unit)


def text_width(words: str, text_px: float) -> float:
    """Width of a text in pixels of the finished picture."""
    return text_font(text_px).getlength(words) / DETAIL


@lru_cache(maxsize=32)
def text_font(text_px: float) -> "ImageFont.FreeTypeFont":
    """The font that ships with Pillow, the same letters on every machine, as large as it is drawn."""
    try:
        from PIL import ImageFont
    except ImportError as error:
        raise ImportError(
            f"Rendering needs Pillow, which is not installed; run {install_command('render')}."
        ) from error
    return ImageFont.load_default(round(DETAIL * text_px))  # type: ignore[return-value] - no bitmap font with a size
