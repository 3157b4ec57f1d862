"""The paper's three scenarios, and two warehouses with more sources, as configurations; each value names its source.

Section numbers refer to the paper, "Improved Swarm Engineering: Aligning Intuition and Analysis" (Harwell, Gini);
"study" means the experiment configuration published with it. Every field can be overridden:
`scenario("warehouse_small", n_robots=20, n_objects=100)`.
"""

from collections.abc import Mapping
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, known_name
from swarm_forage_env.scenarios.config import (
    ArenaConfig,
    ObjectConfig,
    RewardConfig,
    RobotConfig,
    ScenarioConfig,
    with_overrides,
)

SCENARIO_NAMES = ("warehouse_small", "warehouse_medium", "warehouse_dual", "warehouse_quad", "search_and_rescue")

SEARCH_AND_RESCUE_OBJECTS = {16: 80, 32: 272, 48: 368, 64: 448, 80: 544, 96: 1248, 112: 1408, 128: 1568}
"""Side in metres -> objects: a number that the power-law clusters of that side always hold (our choice: the study asked
for 4,000 everywhere and placed what fitted)."""
DENSITY = 0.05
"""Robots per square metre in search and rescue: 5 % (scenario 2 of the paper)."""


def robots_at_density(side_m: float, density: float = DENSITY) -> int:
    """Swarm size of a square arena at constant density, truncated, at least 1: 12, 51, 115, ... 819."""
    return max(1, int(round(side_m * side_m * density, 6)))


def warehouse_small(**overrides: Any) -> ScenarioConfig:
    """Indoor warehouse, 32 x 16 m, single source (scenario 1, small). 50 robots, 200 objects."""
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
        performance="collected",  # scenario 1: objects delivered per interval
    )
    return with_overrides(base, **overrides)


def warehouse_medium(**overrides: Any) -> ScenarioConfig:
    """Indoor warehouse, 48 x 48 m, random placement (scenario 1, medium). 200 robots, 800 objects."""
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
        performance="collected",
    )
    return with_overrides(base, **overrides)


def warehouse_dual(**overrides: Any) -> ScenarioConfig:
    """Indoor warehouse, 32 x 16 m, nest in the middle between two sources. 50 robots, 200 objects."""
    base = ScenarioConfig(
        name="warehouse_dual",
        arena=ArenaConfig(
            width_m=32.0,  # our choice: as the small warehouse (study: twice as wide as high)
            height_m=16.0,
            nest_centre_m=(16.0, 8.0),  # study: centre of the arena
            nest_size_m=(3.2, 12.8),  # study: 0.1 X by 0.8 Y
        ),
        robots=RobotConfig(n_robots=50),  # our choice: as the small warehouse, so that only the sources differ
        objects=ObjectConfig(n_objects=200, placement="dual_source"),
        performance="collected",
    )
    return with_overrides(base, **overrides)


def warehouse_quad(**overrides: Any) -> ScenarioConfig:
    """Indoor warehouse, 48 x 48 m, nest in the middle of four sources. 200 robots, 800 objects."""
    base = ScenarioConfig(
        name="warehouse_quad",
        arena=ArenaConfig(
            width_m=48.0,  # our choice: as the medium warehouse (study: as wide as high)
            height_m=48.0,
            nest_centre_m=(24.0, 24.0),  # study: centre of the arena
            nest_size_m=(9.6, 9.6),  # study: 0.2 X square
        ),
        robots=RobotConfig(n_robots=200),  # our choice: as the medium warehouse, so that only the sources differ
        objects=ObjectConfig(n_objects=800, placement="quad_source"),
        performance="collected",
    )
    return with_overrides(base, **overrides)


def search_and_rescue(*, side_m: float | None = None, n_robots: int | None = None, **overrides: Any) -> ScenarioConfig:
    """Outdoor search and rescue: power-law clusters of slowly moving objects (scenario 2).

    Args:
        side_m: Side of the square arena; default the smallest of 16, 32, ..., 128 m that holds `n_robots` at
            5 % density, or 48 m when neither is given.
        n_robots: Swarm size; default the size for 5 % density at `side_m`.
        overrides: Any other scenario field.
    """
    robots = None if n_robots is None else RobotConfig(n_robots=n_robots)  # checks the number before a side is chosen
    if side_m is None:
        side_m = 48.0 if n_robots is None else _side_for(n_robots)
    n_objects = overrides.pop("n_objects", None)
    if n_objects is None:
        if side_m not in SEARCH_AND_RESCUE_OBJECTS:
            sides = ", ".join(str(side) for side in SEARCH_AND_RESCUE_OBJECTS)
            raise ConfigError(
                f"Expected side_m to be one of {sides}, got {side_m}; for another side give n_objects too."
            )
        n_objects = SEARCH_AND_RESCUE_OBJECTS[int(side_m)]
    arena = ArenaConfig(
        width_m=float(side_m),
        height_m=float(side_m),
        nest_centre_m=(side_m / 2, side_m / 2),  # study: centre of the arena
        nest_size_m=(0.2 * side_m, 0.2 * side_m),  # study: 0.2 X square
    )
    base = ScenarioConfig(
        name="search_and_rescue",
        arena=arena,
        robots=robots or RobotConfig(n_robots=robots_at_density(side_m)),
        objects=ObjectConfig(
            n_objects=n_objects,
            placement="power_law",
            walk_probability=0.001,  # study: in the flexibility and robustness sets
        ),
        reward=RewardConfig(delivery=0.0, first_pickup=1.0),  # our choice: reward what scenario 2 measures
        performance="first_picked",  # scenario 2: objects picked up for the first time
    )
    return with_overrides(base, **overrides)


def _side_for(n_robots: int) -> float:
    for side in SEARCH_AND_RESCUE_OBJECTS:
        if robots_at_density(side) >= n_robots:
            return float(side)
    most = robots_at_density(max(SEARCH_AND_RESCUE_OBJECTS))
    raise ConfigError(
        f"Expected at most {most} robots in search_and_rescue (128 m at 5 % density), got {n_robots}; "
        "for more give side_m and n_objects."
    )


def scenario(name: str, /, **overrides: Any) -> ScenarioConfig:
    """Return a preset by name with fields overridden.

    Args:
        name: One of `SCENARIO_NAMES`.
        overrides: Field names of ScenarioConfig or of its sections, see `with_overrides`.

    Raises:
        ConfigError: unknown name or field (with the nearest known one), or values that do not fit together.
    """
    builders = {
        "warehouse_small": warehouse_small,
        "warehouse_medium": warehouse_medium,
        "warehouse_dual": warehouse_dual,
        "warehouse_quad": warehouse_quad,
        "search_and_rescue": search_and_rescue,
    }
    known_name("scenario", name, builders)
    if "side_m" in overrides and name != "search_and_rescue":
        raise ConfigError(
            f"Expected side_m with search_and_rescue only, got it with {name}; "
            "other arenas change by width_m and height_m."
        )
    return builders[name](**overrides)


def chosen_scenario(given: str | ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    """Return a preset by name, or a complete configuration, with fields overridden by name.

    Raises:
        ConfigError: unknown preset or field, or values that do not fit together.
    """
    if isinstance(given, ScenarioConfig):
        return with_overrides(given, **overrides)
    return scenario(given, **overrides)
