"""Networks with weights by chance."""

from itertools import pairwise
from typing import Any

import numpy as np

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface, any_swarm
from swarm_forage_env.policies.network import Network, NetworkAbout


def network_of(
    interface: InterfaceConfig, *hidden: int, seed: int = 0, swarm: SwarmSpec | None = None, **about: Any
) -> Network:
    """Return a network that fits an interface, with hidden layers of these sizes."""
    columns, n_actions = (any_swarm(interface) if swarm is None else LearnerInterface(interface, swarm)).widths
    sizes, chance = list(pairwise((columns, *hidden, n_actions))), np.random.default_rng(seed)
    return Network(
        tuple(chance.normal(0.0, 0.5, size).astype(np.float32) for size in sizes),
        tuple(chance.normal(0.0, 0.5, size[1]).astype(np.float32) for size in sizes),
        NetworkAbout(interface=interface, **{"activation": "tanh", "samples": False, **about}),
    )
