"""Pick-ups and drops of one tick: the arrays and constants behind `kernels.interact`, where each rule is a function.

An interaction takes one tick or more: a request that can be met starts it, and it takes effect if the robot asks for
the same, and the condition holds, in every tick until then. A RELEASE onto open floor acts at once.
"""

import numpy as np

from swarm_forage_env.contract.types import IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.kernels import interact as kernel
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState


class Interactions:
    """What `kernels.interact` works on: views of the state arrays, constants, and lists of what it leaves."""

    def __init__(
        self,
        config: ScenarioConfig,
        swarm: SwarmState,
        objects: ObjectState,
        caches: CacheState,
        events: StepEvents,
    ) -> None:
        """Bind the state arrays; they must not be replaced afterwards, only edited."""
        n_robots = config.robots.n_robots
        self.state = kernel.InteractionState(
            position=swarm.position,
            carried_object=swarm.carried_object,
            cargo_from_cache=swarm.cargo_from_cache,
            pending_kind=swarm.pending_kind,
            pending_band=swarm.pending_band,
            pending_target=swarm.pending_target,
            pending_until=swarm.pending_until,
            active=swarm.active,
            floor=objects.floor,
            status=objects.status,
            object_cell=objects.cell,
            cache_slot=objects.cache_slot,
            carriers=objects.carriers,
            cache_alive=caches.alive,
            cache_cell=caches.cell,
            cache_serial=caches.serial,
            cache_count=caches.count,
            code=events.code,
            event_object=events.event_object,
            event_cache=events.event_cache,
            first_picked=events.first_picked,
            counters=events.counters,
            happened=events.happened,
            displaced=np.zeros(n_robots + 1, np.int32),
            creators=np.zeros(n_robots + 1, np.int32),
            queue=np.zeros(2 * n_robots, np.int32),
            handler_used=np.zeros(kernel.N_HANDLERS, np.bool_),
            handling_ticks=np.array([config.objects.pickup_ticks, config.objects.drop_ticks], np.int32),
        )
        nest = config.arena.nest_box_m
        area = config.arena.distributable_cells
        self.rules = kernel.Rules(
            *nest,
            *area,
            cache_half_side=config.cache_half_side_cells,
            cache_proximity_m=config.cache_proximity_m,
            dynamic_caches=config.caches == "dynamic",
            serialized=config.quirks.serialized_interactions,
        )

    def set_handling_ticks(self, *, pickup: int, drop: int) -> None:
        """Set how many ticks a pick-up and a drop take that start from now on; what is running keeps its end."""
        self.state.handling_ticks[:] = pickup, drop

    def drop_cargo(self, robot: int) -> None:
        """Take the cargo of a dying robot: it goes into the cache or onto the floor there, or is placed again."""
        self.state.displaced[-1] = 0
        kernel.drop_cargo(self.state, self.rules, robot)

    def displaced(self) -> IntArray:
        """Object rows to place again after the last call: delivered, or dropped without a free cell."""
        return self.state.displaced[: self.state.displaced[-1]]

    def creators(self) -> IntArray:
        """Robot rows whose CREATE_CACHE drop left an object lying at their cell in the last call."""
        return self.state.creators[: self.state.creators[-1]]
