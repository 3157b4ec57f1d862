"""Scenarios, stacks of wrappers and samplers drawn at random; what configurations refuse is drawn again by who asks."""

from random import Random
from typing import Any

from swarm_forage_env.scenarios.config import CACHE_KINDS, PHYSICS_ENGINES, RewardConfig, ScenarioConfig
from swarm_forage_env.scenarios.floor import CELLS_PER_M, PLACEMENTS, POSITIONS
from swarm_forage_env.scenarios.obstacles import MIN_SIDE_M
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, QUIRK_NAMES, Quirks
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.handling import HandlingCostConfig
from swarm_forage_env.wrappers.noise import (
    NOISE_GROUPS,
    ActuatorNoiseConfig,
    SensorNoiseConfig,
)
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform

MOST_BOXES = 6
"""Obstacles of a world; more leave hardly any room in 6 m."""


def random_scenario(random: Random, caches: str | None, most_ticks: int) -> ScenarioConfig:
    """Draw a scenario of at most `most_ticks` ticks; `caches` None = any.

    Raises:
        ConfigError: what was drawn does not fit together; draw again.
    """
    name = random.choice(SCENARIO_NAMES)
    given: dict[str, Any] = {
        "n_robots": random.choice((1, 2, *random.choices(range(3, 30), k=3), random.randint(30, 80), 150)),
        "n_objects": round(10 ** random.uniform(0.0, 2.7)),
        "caches": caches or random.choice(CACHE_KINDS),
        "physics": random.choice(PHYSICS_ENGINES),
        "side_share": random.choice((0.03, 0.05, 0.2, random.uniform(0.01, 0.5))),
    }
    dt_s = random.choice((0.2, 0.2, 0.2, 0.05, 0.5))
    n_ticks = random.choice((random.randint(20, most_ticks), most_ticks))
    n_intervals = random.randint(1, 4)
    interval_ticks = max(1, n_ticks // n_intervals)
    given |= {"dt_s": dt_s, "interval_s": interval_ticks * dt_s, "horizon_s": n_intervals * interval_ticks * dt_s}
    if random.random() < 0.8:
        given |= _arena(random)
    for field_name, value in (_others(random) | _company(random)).items():
        if random.random() < 0.3:
            given[field_name] = value
    config = scenario(name, **given)
    if random.random() < 0.2:
        config = with_overrides(config, further_nests=_nests(random, config))
    if random.random() < 0.3:
        config = with_overrides(config, obstacles=_obstacles(random, config))
    return with_overrides(config, **_places(random, config)) if random.random() < 0.15 else config


def _arena(random: Random) -> dict[str, Any]:
    """A floor of 6 to 24 m, now and then a long and narrow one, with a nest anywhere in it."""
    cells = [random.randint(30, 120), random.choice((random.randint(30, 120), 30))]
    random.shuffle(cells)
    size = [random.randint(1, max(1, n // 2)) for n in cells]
    low = [random.randint(0, n - extent) for n, extent in zip(cells, size, strict=True)]
    return {
        "width_m": cells[0] / 5,
        "height_m": cells[1] / 5,
        "nest_size_m": (size[0] / 5, size[1] / 5),
        "nest_centre_m": ((2 * low[0] + size[0]) / 10, (2 * low[1] + size[1]) / 10),
    }


def _others(random: Random) -> dict[str, Any]:
    """Fields that are changed now and then."""
    chosen = {name: random.random() < 0.5 for name in QUIRK_NAMES}
    n_substeps = random.randint(4, 10)
    return {
        "placement": random.choice(PLACEMENTS),
        "quirks": random.choice((AUTHORS_PROGRAM, Quirks(**chosen))),
        "physics_substeps": (1.0 / n_substeps,) * n_substeps,
        "pickup_ticks": random.randint(1, 30),
        "drop_ticks": random.randint(1, 30),
        "walk_probability": random.choice((0.001, 0.05, 1.0)),
        "start_margin_m": random.uniform(0.4, 2.8),
        "distance_share": random.uniform(0.01, 0.6),
        "static_size": random.randint(2, 6),
        "respawn_scale": random.choice((0.0, 0.05, 10.0)),
        "radius_m": random.uniform(0.06, 0.15),
        "wheel_base_m": random.uniform(0.05, 0.3),
        "max_speed_mps": random.uniform(0.01, 0.4),
        "max_wheel_difference_mps": random.uniform(0.01, 0.8),
        "performance": random.choice(("first_picked", "n_carrying", "1/interference_fraction", "cache_load")),
        "reward": RewardConfig(
            delivery=random.uniform(-1.0, 1.0),
            nest_progress=random.choice((0.0, 1.0)),
            interference=random.choice((0.0, -0.1)),
            tick=random.choice((0.0, -0.01)),
            team=random.random() < 0.5,
        ),
    }


def _company(random: Random) -> dict[str, Any]:
    """Fields of what robots have to do with each other, which are changed now and then."""
    return {
        "neighbours_seen": random.choice((1, 3, random.randint(1, 64))),
        "neighbour_range_m": random.choice((0.05, 2.0, random.uniform(0.1, 40.0))),
        "message_size": random.choice((1, 2, random.randint(1, 64))),
        "message_range_m": random.choice((0.05, 2.0, random.uniform(0.1, 40.0))),
    }


def _nests(random: Random, config: ScenarioConfig) -> tuple[tuple[float, ...], ...]:
    """A nest or two anywhere, on lines between cells and off them, clear of the first and of each other."""
    given = _obstacles(random, config)
    if len(given) < 2:
        return given
    (ax, ay, bx, by), (cx, cy, dx, dy) = given[:2]
    return given[:2] if dx <= ax or cx >= bx or dy <= ay or cy >= by else given[:1]


def _obstacles(random: Random, config: ScenarioConfig) -> tuple[tuple[float, ...], ...]:
    """Boxes anywhere but in nests: thin walls, squares, on lines between cells and off them, into the walls, too."""
    extents = config.arena.width_m, config.arena.height_m
    nests = config.arena.nest_boxes_m
    found: list[tuple[float, ...]] = []
    for _ in range(random.randint(1, MOST_BOXES)):
        sides = [random.choice((MIN_SIDE_M, random.uniform(MIN_SIDE_M, 0.6 * extent))) for extent in extents]
        low = [random.uniform(0.0, extent - side) for extent, side in zip(extents, sides, strict=True)]
        if random.random() < 0.5:
            low = [round(edge * CELLS_PER_M) / CELLS_PER_M for edge in low]
            sides = [max(1, round(side * CELLS_PER_M)) / CELLS_PER_M for side in sides]
        high = [min(edge + side, extent) for edge, side, extent in zip(low, sides, extents, strict=True)]
        is_clear = all(
            low[0] >= nest[2] or high[0] <= nest[0] or low[1] >= nest[3] or high[1] <= nest[1] for nest in nests
        )
        if is_clear and min(high[0] - low[0], high[1] - low[1]) >= MIN_SIDE_M:
            found.append((*low, *high))
    return tuple(found)


def _places(random: Random, config: ScenarioConfig) -> dict[str, Any]:
    """Places of one's own, now and then fewer objects than places, clear of nest and obstacles."""
    x_low, y_low, x_end, y_end = config.arena.distributable_cells
    taken = (*config.arena.all_nest_cells, *config.obstacle_cells)
    free = [
        (x, y)
        for x in range(x_low, x_end)
        for y in range(y_low, y_end)
        if not any(box[0] <= x < box[2] and box[1] <= y < box[3] for box in taken)
    ]
    cells = random.sample(free, min(len(free), random.randint(1, 60)))
    # Anywhere in its cell, but for the ends, where rounding may choose the next one.
    places = tuple(((x + random.uniform(0.01, 0.99)) / CELLS_PER_M, (y + 0.5) / CELLS_PER_M) for x, y in cells)
    n_objects = random.choice((len(places), random.randint(1, max(1, len(places)))))
    return {"placement": POSITIONS, "object_positions_m": places, "n_objects": n_objects}


def random_wrappers(random: Random, config: ScenarioConfig) -> tuple[WrapperConfig, ...]:
    """Draw a stack, in any order."""
    n_robots = config.robots.n_robots
    are_born = n_robots > 1 and random.random() < 0.5
    rate = 10 ** random.uniform(-3.0, -0.5)
    made: list[WrapperConfig] = [
        SensorNoiseConfig(
            sigma=_sigma(random),
            groups=tuple(random.sample(NOISE_GROUPS, random.randint(1, len(NOISE_GROUPS)))),
        ),
        PopulationConfig(
            death_per_tick=random.choice((0.0, rate)),
            birth_per_tick=rate if are_born else 0.0,
            malfunction_per_tick=random.choice((0.0, rate, 3 * rate)),
            repair_per_tick=random.choice((0.0, rate)),
            initial_robots=random.randint(1, n_robots - 1) if are_born else None,
            max_robots=random.choice((None, random.randint(1, n_robots))),
            deaths=random.choice(("terminate", "absorbing")),
        ),
        ThrottleConfig(waveform=_waveform(random, 1.0), carriers=random.random() < 0.5),
        ActuatorNoiseConfig(sigma=_sigma(random)),
        HandlingCostConfig(waveform=_waveform(random, 40.0)),
    ]
    return tuple(random.sample(made, random.choice((0, 0, 1, 2, 3, len(made)))))


def _waveform(random: Random, peak: float) -> Waveform:
    """A waveform of at most `peak`, of any kind."""
    half, period_s = random.uniform(0.0, 0.5 * peak), random.uniform(0.1, 60.0)
    periodic = random.choice(("sine", "square", "sawtooth"))
    return random.choice(
        (
            Waveform(kind="constant", amplitude=2 * half),
            Waveform(kind=periodic, amplitude=half, offset=half, period_s=period_s),
            Waveform(kind="step", amplitude=half, offset=half, start_s=period_s),
            Waveform(kind="table", times_s=(0.0, period_s), values=(half, 2 * half)),
        )
    )


def _sigma(random: Random) -> float | Waveform:
    return random.choice((0.0, 10 ** random.uniform(-3.0, 2.0), _waveform(random, 0.2)))
