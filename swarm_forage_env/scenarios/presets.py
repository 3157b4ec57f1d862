"""The paper's three scenarios, two warehouses with more sources and a classroom; each value names its source.

Section numbers refer to the paper, "Improved Swarm Engineering: Aligning Intuition and Analysis" (Harwell, Gini);
"study" means the experiment configuration published with it. Every field can be overridden:
`scenario("warehouse_small", n_robots=20, n_objects=100)`.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, known_name, whole
from swarm_forage_env.scenarios import SCENARIO_NAMES
from swarm_forage_env.scenarios.config import ArenaConfig, ObjectConfig, RewardConfig, RobotConfig, ScenarioConfig
from swarm_forage_env.scenarios.obstacles import stretched
from swarm_forage_env.scenarios.overrides import (
    ARENA_FIELDS,
    arena_at_density,
    checked_density,
    robots_at_density,
    with_overrides,
)

SEARCH_AND_RESCUE_OBJECTS = {16: 80, 32: 272, 48: 368, 64: 448, 80: 544, 96: 1248, 112: 1408, 128: 1568}
"""Side in metres -> objects: what the clusters of the authors' program always hold, so that both readings have the same
number (our choice: the study asked for 4,000 everywhere and placed what fitted)."""
DENSITY = 0.05
"""Robots per square metre in search and rescue: 5 % (scenario 2 of the paper)."""


def warehouse_small(**overrides: Any) -> ScenarioConfig:
    """Warehouse with one source.

    Small warehouse of scenario 1: 32 x 16 m, 50 robots, 200 objects.
    """
    base = ScenarioConfig(
        name="warehouse_small",
        arena=ArenaConfig(
            width_m=32.0,  # scenario 1, small warehouse
            height_m=16.0,
            nest_centre_m=(3.2, 8.0),  # study: centre at 0.1 X, Y/2
            nest_size_m=(3.2, 12.8),  # study: 0.1 X by 0.8 Y
        ),
        robots=RobotConfig(n_robots=50),  # scenario 1: 50 robots in all sweeps but size
        objects=ObjectConfig(n_objects=200, placement="single_source"),  # study: 200 (512 in the size sweep)
    )
    return with_overrides(base, **overrides)


def warehouse_medium(**overrides: Any) -> ScenarioConfig:
    """Warehouse, objects everywhere.

    Medium warehouse of scenario 1: 48 x 48 m, 200 robots, 800 objects at random places.
    """
    base = ScenarioConfig(
        name="warehouse_medium",
        arena=ArenaConfig(
            width_m=48.0,  # scenario 1, medium warehouse (the paper prints 2,048 m^2; 48 x 48 is 2,304)
            height_m=48.0,
            nest_centre_m=(24.0, 24.0),  # study: centre of the arena
            nest_size_m=(9.6, 9.6),  # study: 0.2 X square
        ),
        robots=RobotConfig(n_robots=200),  # scenario 1: 200 robots in all sweeps but size
        objects=ObjectConfig(n_objects=800, placement="random"),  # study: 800 (2,048 in the size sweep)
    )
    return with_overrides(base, **overrides)


def warehouse_dual(**overrides: Any) -> ScenarioConfig:
    """Warehouse with two sources.

    32 x 16 m, nest in the middle, 50 robots, 200 objects.
    """
    base = with_overrides(
        warehouse_small(),  # our choice: so that only nest and sources differ (study: twice as wide as high)
        name="warehouse_dual",
        nest_centre_m=(16.0, 8.0),  # study: centre of the arena; 0.1 X by 0.8 Y as in the small warehouse
        placement="dual_source",
    )
    return with_overrides(base, **overrides)


def warehouse_quad(**overrides: Any) -> ScenarioConfig:
    """Warehouse with four sources.

    48 x 48 m, nest in the middle, 200 robots, 800 objects.
    """
    # Our choice: as the medium warehouse, so that only the sources differ (study: as wide as high, nest in the centre).
    return with_overrides(
        with_overrides(warehouse_medium(), name="warehouse_quad", placement="quad_source"), **overrides
    )


def classroom(**overrides: Any) -> ScenarioConfig:
    """Small room for first tries.

    8 x 6 m, one nest and one source, 10 robots, 40 objects; the first deliveries come at once.
    """
    base = ScenarioConfig(
        name="classroom",
        arena=ArenaConfig(
            width_m=8.0,  # our choice: a room; in the window a robot is a disc of 10 pixels or more
            height_m=6.0,
            nest_centre_m=(1.0, 3.0),  # our choice: at the left wall but clear of it; half way up
            nest_size_m=(1.6, 4.8),  # our choice: 0.2 X by 0.8 Y; 0.1 X has no room for two robots side by side
        ),
        robots=RobotConfig(
            n_robots=10,  # our choice: few enough to follow each; they still meet at the source
            start_margin_m=0.8,  # our choice: with the 2.8 m of the study 20 robots have no room
        ),
        objects=ObjectConfig(n_objects=40, placement="single_source"),  # our choice: 4 per robot, as in the warehouses
        horizon_s=2_000.0,  # our choice: ten intervals, a second of computing
    )
    return with_overrides(base, **overrides)


def search_and_rescue(*, side_m: float | None = None, n_robots: int | None = None, **overrides: Any) -> ScenarioConfig:
    """Clusters of moving objects.

    Outdoor search and rescue of scenario 2: objects lie in power-law clusters and move slowly.

    Args:
        side_m: Side of the square arena; default the smallest of 16, 32, ..., 128 m that holds `n_robots` at
            5 % density, or 48 m when neither is given.
        n_robots: Swarm size; default the size for 5 % density at `side_m`.
        overrides: Any other scenario field.
    """
    if side_m is None:
        side_m = 48.0 if n_robots is None else side_for(n_robots)
    if "n_objects" not in overrides and side_m not in SEARCH_AND_RESCUE_OBJECTS:
        sides = ", ".join(map(str, SEARCH_AND_RESCUE_OBJECTS))
        raise ConfigError(f"Expected side_m to be one of {sides}, got {side_m}; for another side give n_objects too.")
    base = ScenarioConfig(
        name="search_and_rescue",
        arena=ArenaConfig(
            width_m=side_m,
            height_m=side_m,
            nest_centre_m=(side_m / 2, side_m / 2),  # study: centre of the arena
            nest_size_m=(0.2 * side_m, 0.2 * side_m),  # study: 0.2 X square
        ),
        robots=RobotConfig(n_robots=robots_at_density(side_m * side_m, DENSITY) if n_robots is None else n_robots),
        objects=ObjectConfig(
            n_objects=overrides.pop("n_objects", SEARCH_AND_RESCUE_OBJECTS.get(int(side_m))),
            placement="power_law",
            walk_probability=0.001,  # study: in the flexibility and robustness sets
        ),
        reward=RewardConfig(delivery=0.0, first_pickup=1.0),  # our choice: reward what scenario 2 measures
        performance="first_picked",  # scenario 2: objects picked up for the first time
    )
    return with_overrides(base, **overrides)


def side_for(n_robots: int, density: float = DENSITY) -> float:
    """Return the smallest side of the search and rescue series that holds a swarm at a density (robots per m^2).

    Raises:
        ConfigError: not even the largest holds so many.
    """
    whole("robots.n_robots", n_robots, at_least=1)
    for side in SEARCH_AND_RESCUE_OBJECTS:
        if robots_at_density(side * side, density) >= n_robots:
            return float(side)
    most = robots_at_density(max(SEARCH_AND_RESCUE_OBJECTS) ** 2, density)
    raise ConfigError(
        f"Expected at most {most} robots in search_and_rescue (128 m at {100 * density:g} % density), got {n_robots}; "
        "for more give side_m and n_objects."
    )


def at_density(
    config: ScenarioConfig, density: float, *, n_robots: int | None = None, n_objects: int | None = None
) -> ScenarioConfig:
    """Return a scenario in the smallest arena of its proportions that holds its robots at a density.

    Example: `at_density(scenario("warehouse_small"), 0.05, n_robots=200)` has 89.6 x 44.8 m. With power-law clusters
    the arena is one of search and rescue, with its objects: for those sides the clusters are known to hold them.

    Args:
        config: The scenario.
        density: Robots per m^2, points without size (study); 0.05 is the paper's 5 %.
        n_robots: Size of the swarm; default that of `config`.
        n_objects: Number of objects; default as many per m^2 as in `config`, with clusters those of the series.

    Raises:
        ConfigError: a density that is no share, or an arena that is too small or too large for the scenario.
    """
    n_robots = whole("robots.n_robots", config.robots.n_robots if n_robots is None else n_robots, at_least=1)
    width_m, height_m = config.arena.width_m, config.arena.height_m
    if config.objects.placement != "power_law":
        arena = arena_at_density(config, density, n_robots)
        # Our choice: what a robot meets on a way of a given length depends on neither the arena nor the swarm.
        share = arena["width_m"] * arena["height_m"] / (width_m * height_m)
        usual = max(1, round(config.objects.n_objects * share))
    else:
        side_m = side_for(n_robots, checked_density(density))
        arena = {name: getattr(search_and_rescue(side_m=side_m).arena, name) for name in ARENA_FIELDS}
        for name in ("further_nests", "obstacles"):
            factors = side_m / width_m, side_m / height_m
            arena[name] = stretched(getattr(config.arena, name), factors, (side_m, side_m))
        usual = SEARCH_AND_RESCUE_OBJECTS[int(side_m)]
    n_objects = usual if n_objects is None else n_objects
    return with_overrides(config, **arena, n_robots=n_robots, n_objects=n_objects)


PRESETS: dict[str, Callable[..., ScenarioConfig]] = {name: globals()[name] for name in SCENARIO_NAMES}
"""Name -> what builds the scenario."""


def scenario(name: str, /, *, density: float | None = None, **overrides: Any) -> ScenarioConfig:
    """Return a preset by name with fields overridden.

    Args:
        name: One of `SCENARIO_NAMES`.
        density: Robots per m^2, for example 0.05; the arena is as large as the swarm needs, see `at_density`. Default:
            the arena of the preset.
        overrides: Field names of ScenarioConfig or of its sections, see `with_overrides`.

    Raises:
        ConfigError: unknown name or field (with the nearest known one), or values that do not fit together.
    """
    if str(name).endswith(".toml"):
        raise ConfigError(f"Expected the name of a scenario, got the file {name}; read_world({name!r}) reads it.")
    known_name("scenario", name, SCENARIO_NAMES)
    if "side_m" in overrides and name != "search_and_rescue":
        raise ConfigError(
            f"Expected side_m with search_and_rescue only, got it with {name}; "
            "other arenas change by width_m and height_m."
        )
    return _changed(PRESETS[name], density, overrides)


def chosen_scenario(given: str | ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    """Return a preset by name, or a complete configuration, with fields overridden by name; `density` as in `scenario`.

    Raises:
        ConfigError: unknown preset or field, or values that do not fit together.
    """
    if not isinstance(given, ScenarioConfig):
        return scenario(given, **overrides)
    others = dict(overrides)
    return _changed(partial(with_overrides, given), others.pop("density", None), others)


def _changed(make: Callable[..., ScenarioConfig], density: float | None, overrides: dict[str, Any]) -> ScenarioConfig:
    """Return what `make` makes of overrides, in an arena at a density if there is one."""
    if density is None:
        return make(**overrides)
    given = [name for name in ("side_m", *ARENA_FIELDS) if name in overrides]
    if given:
        raise ConfigError(f"Expected either density, which chooses the arena, or {', '.join(given)}; got both.")
    sizes = {name: overrides.pop(name, None) for name in ("n_robots", "n_objects")}  # overridden in the new arena
    return at_density(make(**overrides), density, **sizes)
