"""One scenario out of another: with fields changed by name, wherever they live, or in an arena at a density of robots.

Such an arena has the proportions of the scenario and is as large as a swarm needs. The small warehouse, 32 x 16 m, for
200 robots at 5 %: 200 / 0.05 = 4,000 m^2, so 89.6 x 44.8 m = 4,014 m^2.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cache
from types import MappingProxyType
from typing import Any, get_type_hints

from swarm_forage_env._internal.fields import ConfigError, instance, known_keys, known_name, number
from swarm_forage_env.scenarios.config import SECTIONS, ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, CELLS_PER_M
from swarm_forage_env.scenarios.obstacles import stretched
from swarm_forage_env.scenarios.quirks import RULES

ARENA_FIELDS = ("width_m", "height_m", "nest_centre_m", "nest_size_m", "further_nests", "obstacles")
"""What a density decides, and what therefore cannot be given beside it."""


@cache  # each world asks
def field_sections() -> Mapping[str, str]:
    """Map every overridable field name to the section that holds it ("" = the scenario itself)."""
    table = {item.name: "" for item in fields(ScenarioConfig) if item.name not in SECTIONS}
    return MappingProxyType(table | {item.name: name for name, kind in SECTIONS.items() for item in fields(kind)})


def field_types() -> dict[str, Any]:
    """Return the type, without its bounds, of every scenario field that can be set by name."""
    hints = {section: get_type_hints(kind) for section, kind in {"": ScenarioConfig, **SECTIONS}.items()}
    return {name: hints[section][name] for name, section in field_sections().items()}


def with_overrides(config: ScenarioConfig, **overrides: Any) -> ScenarioConfig:
    """Return `config` with single fields replaced by name, wherever they live.

    Example: `with_overrides(config, n_robots=20, width_m=48.0)`. A section may be replaced whole
    (`quirks=AUTHORS_PROGRAM`), the quirks also by the name of rules (`quirks="AUTHORS_PROGRAM"`).

    Raises:
        ConfigError: unknown name (with the nearest known one), or values that do not fit together.
    """
    instance("config", config, ScenarioConfig, hint="; scenario(name) makes one")
    table = field_sections()
    known_keys(overrides, (*table, *SECTIONS), "scenario field")
    if isinstance(rules := overrides.get("quirks"), str):
        known_name("rules", rules, RULES)
        overrides["quirks"] = RULES[rules]
    config = replace(config, **{name: value for name, value in overrides.items() if name in SECTIONS})
    changed: dict[str, dict[str, Any]] = {}
    for name, value in overrides.items():
        if name in table:
            changed.setdefault(table[name], {})[name] = value
    top = changed.pop("", {})
    return replace(config, **top, **{name: replace(getattr(config, name), **own) for name, own in changed.items()})


def scenario_of_same_size(scenario: ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    """Return the scenario with fields overridden by name; what decides the shapes of spaces must stay the same.

    Raises:
        ConfigError: unknown fields, values that do not fit together, or another size or scale.
    """
    changed = with_overrides(scenario, **overrides)
    fixed = ["n_robots", "neighbours_seen", "message_size"]
    if changed.robots.neighbours_seen:
        fixed.append("neighbour_range_m")  # seen distances are shares of the range
    for name in fixed:
        before, now = getattr(scenario.robots, name), getattr(changed.robots, name)
        if now != before:
            birth = ", or let robots be born during the run (the population wrapper with initial_robots)"
            raise ConfigError(
                f"Expected {name} to stay {before:g}, as spaces promise, got {now:g}; make another environment"
                f"{birth if name == 'n_robots' else ''}."
            )
    return changed


def robots_at_density(area_m2: float, density: float) -> int:
    """Return how many robots an area holds at a density (robots per m^2): whole ones, at least 1 (study)."""
    # Rounding to millionths first keeps 2304 m^2 * 0.05 from being 114.99999999999999.
    return max(1, int(round(area_m2 * density, 6)))


def checked_density(density: Any) -> float:
    """Return a density; raises ConfigError unless it is a share above 0 and at most 1."""
    return number("density (robots per m^2; 0.05 is 5 %)", density, above=0.0, at_most=1.0)


def with_object_density(config: ScenarioConfig, per_m2: float) -> ScenarioConfig:
    """Return `config` with so many objects per m^2 of its arena, rounded to whole objects, at least 1.

        with_object_density(scenario("search_and_rescue", side_m=16), 0.085)  # 22 objects

    Raises:
        ConfigError: a density that cannot be, or more objects than the arena has room for.
    """
    number("object_density (objects per m^2)", per_m2, above=0.0, at_most=1.0 / CELL_M**2)
    n_objects = max(1, round(per_m2 * config.arena.width_m * config.arena.height_m))
    return with_overrides(config, n_objects=n_objects)


def arena_at_density(config: ScenarioConfig, density: float, n_robots: int) -> dict[str, Any]:
    """Return the fields of the smallest arena in the proportions of `config` that holds a swarm at a density.

    The sides are whole cells in exactly the same ratio, so that strips and caches keep their shapes. Each edge of the
    nest lies on the line between cells nearest to its place in proportion. Obstacles keep their places and shares.

    Args:
        config: Gives the ratio of the sides and the place of the nest.
        density: Robots per m^2.
        n_robots: Size of the swarm.

    Raises:
        ConfigError: a density that cannot be.
    """
    density = checked_density(density)
    nx, ny = config.arena.n_cells
    common = math.gcd(nx, ny)
    unit_x, unit_y = nx // common, ny // common
    unit_m2 = unit_x * unit_y * CELL_M**2
    factor = max(1, math.ceil(math.sqrt(n_robots / (density * unit_m2)) - 1e-9))
    x_low, y_low, x_high, y_high = (round(edge * factor / common) for edge in config.arena.nest_cells)
    x_high, y_high = max(x_low + 1, x_high), max(y_low + 1, y_high)
    width_m, height_m = unit_x * factor / CELLS_PER_M, unit_y * factor / CELLS_PER_M
    factors, extents_m = (factor / common, factor / common), (width_m, height_m)
    return {
        "width_m": width_m,
        "height_m": height_m,
        "nest_centre_m": ((x_low + x_high) / 2 / CELLS_PER_M, (y_low + y_high) / 2 / CELLS_PER_M),
        "nest_size_m": ((x_high - x_low) / CELLS_PER_M, (y_high - y_low) / CELLS_PER_M),
        "further_nests": stretched(config.arena.further_nests, factors, extents_m),
        "obstacles": stretched(config.arena.obstacles, factors, extents_m),
    }
