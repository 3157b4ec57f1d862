"""One scenario out of another: with fields changed by name, wherever they live, or in an arena at a density of robots.

Such an arena has the proportions of the scenario and is as large as a swarm needs. The small warehouse, 32 x 16 m, for
200 robots at 5 %: 200 / 0.05 = 4,000 m^2, so 89.6 x 44.8 m = 4,014 m^2.
"""

import dataclasses
import math
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, get_args, get_origin, get_type_hints

from swarm_forage_env._internal import fields
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.config import SECTIONS, ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, CELLS_PER_M
from swarm_forage_env.scenarios.obstacles import stretched
from swarm_forage_env.scenarios.quirks import RULES

ARENA_FIELDS = ("width_m", "height_m", "nest_centre_m", "nest_size_m", "further_nests", "obstacles")
"""What a density decides, and what therefore cannot be given beside it."""


@cache  # each world asks
def field_sections() -> Mapping[str, str]:
    """Map every overridable field name to the section that holds it ("" = the scenario itself)."""
    table = {item.name: "" for item in dataclasses.fields(ScenarioConfig) if item.name not in SECTIONS}
    for section, section_class in SECTIONS.items():
        table.update({item.name: section for item in dataclasses.fields(section_class)})
    return MappingProxyType(table)


def field_types() -> dict[str, Any]:
    """Return the type of every scenario field that can be set by name."""
    hints = {section: get_type_hints(section_class) for section, section_class in SECTIONS.items()}
    hints[""] = get_type_hints(ScenarioConfig)
    return {name: hints[section][name] for name, section in field_sections().items()}


def parse_tuple(text: str, kind: Any) -> tuple[Any, ...]:
    """Return the tuple that a text stands for, by its type; an empty text is an empty tuple where there can be one.

    Example: "1.6,8" for a pair of numbers; "10,4,11,12+20,4,21,12" for any number of boxes.

    Args:
        text: Entries between commas. Of a tuple of tuples: tuples between plus signs.
        kind: Type of a scenario field, such as `tuple[float, float]`.

    Raises:
        ValueError: another number of entries, or an entry of another type.
    """
    kinds = get_args(kind)
    is_nested = get_origin(kinds[0]) is tuple
    words = [word.strip() for word in text.split("+" if is_nested else ",")]
    if kinds[-1] is Ellipsis:
        words = [word for word in words if word]
        kinds = kinds[:1] * len(words)
    pieces = zip(words, kinds, strict=True)
    return tuple(parse_tuple(word, part) if is_nested else part(word) for word, part in pieces)


def with_overrides(config: ScenarioConfig, **overrides: Any) -> ScenarioConfig:
    """Return `config` with single fields replaced by name, wherever they live.

    Example: `with_overrides(config, n_robots=20, width_m=48.0)`. A section may be replaced whole
    (`quirks=AUTHORS_PROGRAM`), the quirks also by the name of rules (`quirks="AUTHORS_PROGRAM"`).

    Raises:
        ConfigError: unknown name (with the nearest known one), or values that do not fit together.
    """
    table = field_sections()
    fields.known_keys(overrides, (*table, *SECTIONS), "scenario field")
    per_section: dict[str, dict[str, Any]] = {}
    top: dict[str, Any] = {}
    for name, value in overrides.items():
        if name == "quirks" and isinstance(value, str):
            fields.known_name("rules", value, RULES)
            top[name] = RULES[value]
        elif name in SECTIONS:
            own = ", ".join(item.name for item in dataclasses.fields(SECTIONS[name]))
            fields.instance(name, value, SECTIONS[name], hint=f"; single fields of it are given by their names: {own}")
            top[name] = value
        elif table[name]:
            per_section.setdefault(table[name], {})[name] = value
        else:
            top[name] = value
    for section, values in per_section.items():
        top[section] = dataclasses.replace(top.get(section, getattr(config, section)), **values)
    return dataclasses.replace(config, **top)


def scenario_of_same_size(scenario: ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    """Return the scenario with fields overridden by name; the number of robots must stay the same.

    Raises:
        ConfigError: unknown fields, values that do not fit together, or another number of robots.
    """
    changed = with_overrides(scenario, **overrides)
    n_robots = scenario.robots.n_robots
    for name in ("neighbours_seen", "message_size"):
        before, now = getattr(scenario.robots, name), getattr(changed.robots, name)
        if now != before:
            raise ConfigError(
                f"Expected {name} to stay {before}, as spaces promise, got {now}; make another environment."
            )
    before, now = scenario.robots.neighbour_range_m, changed.robots.neighbour_range_m
    if changed.robots.neighbours_seen and now != before:  # seen distances are shares of the range
        raise ConfigError(
            f"Expected neighbour_range_m to stay {before:g}, the scale of columns that spaces promise, got {now:g}; "
            "make another environment."
        )
    if changed.robots.n_robots != n_robots:
        raise ConfigError(
            f"Expected n_robots to stay {n_robots}, the number of rows that spaces promise, got "
            f"{changed.robots.n_robots}; make another environment, or let robots be born during the run (the "
            "population wrapper with initial_robots)."
        )
    return changed


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
    factors, extents_m = (factor / common, factor / common), (width_m, height_m)
    return {
        "width_m": width_m,
        "height_m": height_m,
        "nest_centre_m": ((x_low + x_high) / 2 / CELLS_PER_M, (y_low + y_high) / 2 / CELLS_PER_M),
        "nest_size_m": ((x_high - x_low) / CELLS_PER_M, (y_high - y_low) / CELLS_PER_M),
        "further_nests": stretched(config.arena.further_nests, factors, extents_m),
        "obstacles": stretched(config.arena.obstacles, factors, extents_m),
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
