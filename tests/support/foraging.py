"""Scenarios of every kind in which controllers pick up and deliver within minutes: crowded, with the nest near."""

from typing import Any

from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import parse_wrapper

NEAR: dict[str, dict[str, Any]] = {
    "warehouse_small": {"n_objects": 800, "nest_centre_m": (21.0, 8.0), "nest_size_m": (4.0, 12.8)},
    "warehouse_medium": {
        "n_objects": 1500,
        "width_m": 24.0,
        "height_m": 24.0,
        "nest_centre_m": (12.0, 12.0),
        "nest_size_m": (4.8, 4.8),
    },
    "warehouse_dual": {"n_objects": 1500, "nest_size_m": (12.0, 12.8)},
    "warehouse_quad": {
        "n_objects": 1500,
        "width_m": 24.0,
        "height_m": 24.0,
        "nest_centre_m": (12.0, 12.0),
        "nest_size_m": (4.8, 4.8),
    },
    "search_and_rescue": {"side_m": 16.0},
}
"""What makes each scenario quick, by its name. A preset of another kind of placement gets an entry here."""
CROWDED = scenario(
    "warehouse_small",
    n_robots=12,
    width_m=8.0,
    height_m=8.0,
    nest_centre_m=(1.0, 4.0),
    nest_size_m=(1.6, 4.0),
    n_objects=60,
    horizon_s=80.0,
    interval_s=20.0,
)
"""Twelve robots that meet all the time: for pages and films."""


def quick_world(name: str, **overrides: Any) -> ScenarioConfig:
    """A scenario with 60 robots and wandering objects in which something is delivered within 180 s."""
    return scenario(name, **{"n_robots": 60, "walk_probability": 0.01, "horizon_s": 180.0, **NEAR[name], **overrides})


def mild_wrappers() -> tuple[WrapperConfig, ...]:
    """Every wrapper, at a strength that leaves a swarm able to forage."""
    words = (
        "sensor_noise:sigma=0.005",
        "population:malfunction_per_tick=0.05,repair_per_tick=0.05,death_per_tick=0.005",
        "throttle:waveform=sine,amplitude=0.1,offset=0.1,period_s=60",
        "actuator_noise:sigma=0.05",
    )
    return tuple(parse_wrapper(word) for word in words)
