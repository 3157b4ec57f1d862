"""Pick-ups and drops of one tick: the arrays and constants behind `kernels.interact`, where each rule is a function.

An interaction takes one tick or more: a request that can be met starts it, and it takes effect if the robot asks for
the same, and the condition holds, in every tick until then. A RELEASE onto open floor acts at once.
"""

import numpy as np

from swarm_forage_env.contract.types import ActionArray, FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.kernels import interact as kernel
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState


class Interactions:
    """Serves the gripper requests of a swarm; holds views of the state arrays and no state of its own."""

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
        self._happened = events.happened
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

    def serve(self, actions: ActionArray, tick: int, chance: FloatArray) -> bool:
        """Serve all requests of this tick and write the events; returns whether there was any request.

        Args:
            actions: (N, 3); the third column is the gripper.
            tick: Current tick, for the order of robots that want the same.
            chance: (N,) uniform in [0, 1), decides which object leaves a cache.
        """
        state = self.state
        busy = kernel.clear_events(
            actions, state.carried_object, state.pending_kind, state.active, state.code, state.first_picked
        )
        self._happened[0] = busy
        if busy:
            kernel.interact(state, self.rules, actions, tick, chance)
        return busy

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
