"""The arrays and constants of a run before anything is in it; their shapes are told in `world.state`."""

import numpy as np

from swarm_forage_env.contract.codes import CELL_NEST, CELL_OBSTACLE
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.caches import n_cache_slots
from swarm_forage_env.world.motion import new_motion
from swarm_forage_env.world.state import (
    ArenaArrays,
    CacheState,
    ObjectState,
    PlacementDraws,
    Requests,
    Rules,
    Sensors,
    Source,
    StepEvents,
    SwarmState,
    Wandering,
    WorldState,
)


def new_state(config: ScenarioConfig) -> WorldState:
    """Return a world in which all objects wait and no cache is."""
    n_robots = config.robots.n_robots
    return WorldState(
        swarm=SwarmState.empty(n_robots),
        objects=new_objects(config),
        caches=CacheState.empty(n_cache_slots(config)),
        events=StepEvents.empty(n_robots),
        requests=Requests.empty(n_robots, config.objects.pickup_ticks, config.objects.drop_ticks),
    )


def new_objects(config: ScenarioConfig) -> ObjectState:
    """Return all objects, waiting, and a floor painted with obstacles and nests only."""
    return ObjectState.empty(_painted_floor(config), config.objects.n_objects)


def _painted_floor(config: ScenarioConfig) -> IntArray:
    nx, ny = config.arena.n_cells
    floor = np.zeros((ny, nx), np.int32)  # CELL_EMPTY
    # Nests come last: an obstacle beside one may keep squares free that reach into it.
    nests = ((box, CELL_NEST) for box in config.arena.all_nest_cells)
    painted = [*((box, CELL_OBSTACLE) for box in config.obstacle_cells), *nests]
    for (x_low, y_low, x_high, y_high), code in painted:
        floor[y_low:y_high, x_low:x_high] = code
    return floor


def new_arrays(
    config: ScenarioConfig,
    state: WorldState,
    sensors: Sensors,
    twist: FloatArray,
    source: Source,
    placement_draws: PlacementDraws,
    n_static_caches: int,
) -> ArenaArrays:
    """Return everything that a tick needs, around the state of a run, its sensors and the velocities of its bodies.

    Whole numbers of a configuration become floats: equal configurations have arrays and constants of equal types.
    """
    return ArenaArrays(
        state=state,
        rules=Rules(
            np.array(config.arena.nest_boxes_m),
            *config.arena.distributable_cells,
            cache_half_side=config.cache_half_side_cells,
            cache_proximity_m=config.cache_proximity_m,
            dynamic_caches=config.caches == "dynamic",
            serialized=config.quirks.serialized_interactions,
            only_delivering_counts=config.quirks.only_delivering_counts,
        ),
        motion=new_motion(config, twist),
        sensors=sensors,
        wandering=Wandering(
            probability=float(config.objects.walk_probability),
            area=config.arena.distributable_cells,
            self_conflict=config.quirks.motion_self_conflict,
        ),
        source=source,
        placement_draws=placement_draws,
        n_static_caches=n_static_caches,
        has_caches=config.caches != "none",
    )
