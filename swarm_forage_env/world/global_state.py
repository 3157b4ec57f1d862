"""The whole world as one array of fixed size, for learners with a central critic."""

import numpy as np

from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.scenarios.config import ArenaConfig
from swarm_forage_env.scenarios.units import CELL_M
from swarm_forage_env.world.state import ObjectState, SwarmState


def global_state(arena: ArenaConfig, swarm: SwarmState, objects: ObjectState) -> ObsArray:
    """Return a global view, (6 N + 3 M,) float32 in [-1, 1].

    Per robot: x, y as in the observation, cos and sin of the heading, carrying, active (zeros when not present).
    Then per object: x, y of its cell (of its carrier while carried, zeros while waiting), status / 3.
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
