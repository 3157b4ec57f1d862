"""Arenas in the proportions of a scenario, as large as a swarm needs at a density of robots.

The small warehouse, 32 x 16 m, for 200 robots at 5 %: 200 / 0.05 = 4,000 m^2, so 89.6 x 44.8 m = 4,014 m^2.
"""

import math
from typing import Any

from swarm_forage_env._internal import fields
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.obstacles import stretched
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.units import CELL_M, CELLS_PER_M

ARENA_FIELDS = ("width_m", "height_m", "nest_centre_m", "nest_size_m", "obstacles")
"""What a density decides, and what therefore cannot be given beside it."""


def robots_at_density(area_m2: float, density: float) -> int:
    """Return how many robots an area holds at a density (robots per m^2): whole ones, at least 1 (study)."""
    # Rounding to millionths first keeps 2304 m^2 * 0.05 from being 114.99999999999999.
    return max(1, int(round(area_m2 * density, 6)))


def checked_density(density: Any) -> float:
    """Return a density; raises ConfigError unless it is a share above 0 and at most 1."""
    fields.number("density (robots per m^2; 0.05 is 5 %)", density, above=0.0, at_most=1.0)
    return float(density)


def arena_at_density(config: ScenarioConfig, density: float, n_robots: int) -> dict[str, Any]:
    """Return the fields of the smallest arena in the proportions of `config` that holds a swarm at a density.

    The sides are whole cells in exactly the same ratio, so that strips and caches keep their shapes. Each edge of the
    nest lies on the line between cells nearest to its place in proportion. Obstacles keep their places and shares.

    Args:
        config: Gives the ratio of the sides and the place of the nest.
        density: Robots per m^2.
        n_robots: Size of the swarm.

    Raises:
        ConfigError: a density or a number of robots that cannot be.
    """
    density = checked_density(density)
    fields.whole("robots.n_robots", n_robots, at_least=1)
    nx, ny = config.arena.n_cells
    common = math.gcd(nx, ny)
    unit_x, unit_y = nx // common, ny // common
    unit_m2 = unit_x * unit_y * CELL_M**2
    factor = max(1, math.ceil(math.sqrt(n_robots / (density * unit_m2)) - 1e-9))
    x_low, y_low, x_high, y_high = (round(edge * factor / common) for edge in config.arena.nest_cells)
    x_high, y_high = max(x_low + 1, x_high), max(y_low + 1, y_high)
    width_m, height_m = unit_x * factor / CELLS_PER_M, unit_y * factor / CELLS_PER_M
    return {
        "width_m": width_m,
        "height_m": height_m,
        "nest_centre_m": ((x_low + x_high) / 2 / CELLS_PER_M, (y_low + y_high) / 2 / CELLS_PER_M),
        "nest_size_m": ((x_high - x_low) / CELLS_PER_M, (y_high - y_low) / CELLS_PER_M),
        "obstacles": stretched(config.arena.obstacles, (factor / common, factor / common), (width_m, height_m)),
    }


def in_arena(config: ScenarioConfig, arena: dict[str, Any], *, n_robots: int, n_objects: int | None) -> ScenarioConfig:
    """Return a scenario in another arena with another swarm.

    Args:
        config: The scenario.
        arena: Fields as from `arena_at_density`.
        n_robots: Size of the swarm.
        n_objects: Number of objects; None = as many per m^2 as in `config` (our choice: what a robot meets on a way
            of a given length then depends on neither the size of the arena nor that of the swarm).

    Raises:
        ConfigError: an arena that is too small for its robots.
    """
    if n_objects is None:
        share = (arena["width_m"] * arena["height_m"]) / (config.arena.width_m * config.arena.height_m)
        n_objects = max(1, round(config.objects.n_objects * share))
    return with_overrides(config, **arena, n_robots=n_robots, n_objects=n_objects)
