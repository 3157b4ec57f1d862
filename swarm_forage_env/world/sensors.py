"""From the true state to observations: one function per sensor, all robots at once.

Sensor models are those of the foot-bot as configured for the paper's study. Noise is not added here: the
`SensorNoise` wrapper perturbs the finished observation.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.units import WHEEL_SCALE_MPS
from swarm_forage_env.world.kernels import beams, floor, neighbours, proprioception
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState

PROXIMITY_RANGE_M = 0.1
"""Reach of a proximity beam beyond the body."""


@dataclass(slots=True)
class SensorSuite:
    """Buffers and constants of all sensors for one swarm; `obs` is rewritten in place every tick."""

    obs: ObsArray
    near: BoolArray
    """(N,) whether any proximity beam may have hit something in the last sweep."""
    columns: dict[str, int]
    """First column of every slice."""
    reads: frozenset[str]
    interior: FloatArray
    lights: FloatArray
    intensity: float
    radius_m: float
    scales: FloatArray
    sizes: tuple[int, int, int]
    cache_half_side: int
    bins: tuple[float, IntArray, IntArray]
    """Present robots by place as of the last proximity sweep: cell size in m, first_in_bin, next_in_bin."""

    @classmethod
    def build(cls, config: ScenarioConfig, layout: ObservationLayout, reads: Collection[str]) -> "SensorSuite":
        """Allocate sensors for `config`; slices not named in `reads` may stay zero."""
        n_robots = config.robots.n_robots
        n_bins = 1 << max(4, (4 * n_robots - 1).bit_length())
        return cls(
            obs=np.zeros((n_robots, layout.size), np.float32),
            near=np.zeros(n_robots, np.bool_),
            columns={part.name: part.start for part in layout},
            reads=frozenset(reads),
            interior=np.array(config.arena.interior_m),
            lights=np.array(config.arena.lights_m),
            intensity=config.arena.light_intensity,
            radius_m=config.robots.radius_m,
            scales=np.array([WHEEL_SCALE_MPS, config.arena.width_m, config.arena.height_m]),
            sizes=(*config.arena.n_cells, config.objects.n_objects),
            cache_half_side=config.cache_half_side_cells,
            bins=(
                2 * config.robots.radius_m + PROXIMITY_RANGE_M,
                np.full(n_bins, -1, np.int32),
                np.full(n_robots, -1, np.int32),
            ),
        )


def sense_proximity(swarm: SwarmState, suite: SensorSuite) -> None:
    """A ring of beams, 0.1 m beyond the body: 1 at contact, 0 when nothing is hit."""
    neighbours.bin_robots(swarm.position, swarm.present, *suite.bins)
    beams.proximity(
        swarm.position,
        swarm.facing,
        swarm.present,
        suite.bins,
        suite.interior,
        suite.radius_m,
        PROXIMITY_RANGE_M,
        suite.obs,
        suite.columns["proximity"],
        suite.near,
    )


def sense(
    swarm: SwarmState, objects: ObjectState, caches: CacheState, events: StepEvents, suite: SensorSuite
) -> ObsArray:
    """Complete the observation after `sense_proximity`; returns the (N, D) buffer."""
    columns, obs = suite.columns, suite.obs
    if "light" in suite.reads:
        floor.light(swarm.position, swarm.facing, swarm.present, suite.lights, suite.intensity, obs, columns["light"])
    if "ground" in suite.reads:
        floor.ground(swarm.position, swarm.facing, swarm.present, objects.floor, obs, columns["ground"])
    proprioception.own_motion(
        swarm.position,
        swarm.facing,
        swarm.wheel_speed,
        swarm.present,
        suite.scales,
        obs,
        columns["wheel_speed"],
    )
    proprioception.own_status(
        swarm.carried_object,
        swarm.pending_kind,
        swarm.active,
        (events.code, events.event_object, events.event_cache),
        suite.sizes,
        swarm.present,
        obs,
        columns["carrying"],
    )
    if not suite.reads.isdisjoint(("los_cell", "los_object", "los_cache")):
        floor.line_of_sight(
            swarm.position,
            swarm.present,
            objects.floor,
            suite.sizes[2],
            (caches.alive, caches.cell, caches.serial, caches.count),
            suite.cache_half_side,
            obs,
            (columns["los_cell"], columns["los_object"], columns["los_cache"]),
        )
    return obs
