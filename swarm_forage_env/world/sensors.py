"""What is seen of the world: by the sensors of a swarm, and by a central critic, which sees all of it.

What sensors are made of stands here. Their models are functions in `kernels`, for all robots at once.

Sensor models are those of the foot-bot as configured for the paper's study. Noise is not added here: the
`SensorNoise` wrapper perturbs the finished observation.
"""

from collections.abc import Collection

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_name
from swarm_forage_env._internal.prefetching import LARGE
from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.layout import (
    LIGHT_IF_CARRYING,
    MESSAGES,
    NEIGHBOURS,
    ObservationLayout,
)
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.scenarios.config import ArenaConfig, ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WHEEL_SCALE_MPS
from swarm_forage_env.world.bodies import obstacle_rows
from swarm_forage_env.world.state import Columns, ObjectState, Sensors, SwarmState

PROXIMITY_RANGE_M = 0.1
"""Reach of a proximity beam beyond the body."""
_SWITCHES = {
    NEIGHBOURS: ("neighbours", "neighbours_seen"),
    MESSAGES: ("messages", "message_size"),
}
"""Slices that only some scenarios have: what such a scenario has, and the field that gives it."""


def read_slices(reads: Collection[str] | None, layout: ObservationLayout) -> tuple[str, ...]:
    """Return the names of the slices that are read: `reads` without conditions, None = all.

    Raises:
        ConfigError: an unknown name, or a slice that this scenario does not have.
    """
    if reads is None:
        return layout.names
    for name in reads:
        if name in _SWITCHES and name not in layout.names:
            what, field = _SWITCHES[name]
            raise ConfigError(
                f"Expected a scenario with {what}, because the policy reads the slice {name!r}, got one without; give "
                f"it {field}."
            )
        known_name("entry of reads", name, (*layout.names, LIGHT_IF_CARRYING))
    return tuple("light" if name == LIGHT_IF_CARRYING else name for name in reads)


def light_of_carriers_only(reads: Collection[str] | None) -> bool:
    """Return whether the light of robots that carry nothing may stay zero; `reads` as given."""
    return reads is not None and "light" not in reads


def new_sensors(config: ScenarioConfig, layout: ObservationLayout, reads: Collection[str] | None) -> Sensors:
    """Allocate the sensors of one swarm; slices not named in `reads` may stay zero."""
    n_robots = config.robots.n_robots
    # So many that most bins beside a robot are empty, but not more than a processor's cache holds or robots fill.
    n_bins = 1 << max(4, (max(4 * n_robots, min(16 * n_robots, 2**16)) - 1).bit_length())
    starts = {part.name: part.start for part in layout}
    read = read_slices(reads, layout)
    return Sensors(
        obs=np.zeros((n_robots, layout.size), np.float32),
        near=np.zeros(n_robots, np.bool_),
        lit=np.zeros(n_robots, np.bool_),
        kept=np.zeros(1, np.bool_),
        bins=(
            2 * config.robots.radius_m + PROXIMITY_RANGE_M,
            np.full(n_bins, -1, np.int32),
            np.full(n_robots, -1, np.int32),
        ),
        occupied=np.zeros(1 << (2 * n_robots - 1).bit_length() if n_robots >= LARGE else 1, np.uint32),
        columns=Columns(**{name: starts[name] for name in Columns._fields}),
        interior=np.array(config.arena.interior_m),
        lights=np.array(config.arena.lights_m),
        intensity=config.arena.light_intensity,
        radius_m=float(config.robots.radius_m),
        reach_m=PROXIMITY_RANGE_M,
        scales=np.array([WHEEL_SCALE_MPS, config.arena.width_m, config.arena.height_m]),
        sizes=(*config.arena.n_cells, config.objects.n_objects),
        shares=(np.arange(config.objects.n_objects + 1) / config.objects.n_objects).astype(np.float32),
        obstacles=obstacle_rows(config),
        cache_half_side=config.cache_half_side_cells,
        reads_light="light" in read,
        light_is_due=np.ones(1, np.bool_),
        light_of_carriers_only=light_of_carriers_only(reads),
        light_seen=np.zeros((2, n_robots)),
        reads_ground="ground" in read,
        reads_line_of_sight=not {"los_cell", "los_object", "los_cache"}.isdisjoint(read),
        behind_counts=config.quirks.obstacle_behind_counts,
    )


def global_state(arena: ArenaConfig, swarm: SwarmState, objects: ObjectState) -> ObsArray:
    """Return the whole world as one array of fixed size, (6 N + 3 M,) float32 in [-1, 1].

    Per robot: x, y as in the observation, cos and sin of the heading, carrying, active (zeros when not present).
    Then per object: x, y of its square (of its carrier while carried, zeros while waiting), status / 3.
    """
    size = np.array([arena.width_m, arena.height_m])
    robots = np.column_stack(
        [
            2.0 * swarm.position / size - 1.0,
            np.cos(swarm.heading),
            np.sin(swarm.heading),
            swarm.carried_object >= 0,
            swarm.active,
        ]
    )
    robots[~swarm.present] = 0.0
    places = 2.0 * (objects.cell + 0.5) * CELL_M / size - 1.0
    places[objects.status == ObjectStatus.WAITING] = 0.0
    carriers = np.flatnonzero(swarm.carried_object >= 0)
    places[swarm.carried_object[carriers]] = robots[carriers, :2]
    things = np.column_stack([places, objects.status / 3.0])
    flat = np.concatenate([robots.ravel(), things.ravel()])
    return np.clip(flat, -1.0, 1.0).astype(np.float32)
