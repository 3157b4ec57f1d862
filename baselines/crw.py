"""CRW: the correlated random walk controller. It has no memory; robots carry objects that they meet to the light.

States and exits (`robots.Activity`):

    ACQUIRE         random walk; ground sensors see an object, after 10 s    -> WAIT_PICKUP
    WAIT_PICKUP     stand, ask; cargo -> HOMING; refused or vanished         -> ACQUIRE
    HOMING          towards the nest light; sees the nest                    -> HOMING_IN_NEST
    HOMING_IN_NEST  light and wander; nearer to the centre than a random depth -> WAIT_DROP
    WAIT_DROP       stand, ask to deliver; delivered -> ACQUIRE; refused     -> HOMING

Under the quirk `nest_left_at_random` a delivery leads to LEAVE_NEST: a random walk, until the nest is no longer seen.

Source: CRW of the paper, section "Candidate Algorithms"; numbers in `parameters`.
"""

from typing import ClassVar

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, ObsArray

from .machines import (
    DELIVER,
    after_delivery,
    command,
    deliver_and_leave,
    explore_for_object,
    explore_freely,
    follow_cargo,
    hold,
)
from .parameters import ControllerParameters, kernel_constants
from .robots import ACQUIRE, DRAWS, HOMING, WAIT_PICKUP, fetch_ahead, new_robots, sense
from .scripted import ScriptedPolicy


@kernel
def step_crw(
    obs: ObsArray,
    active: BoolArray,
    draws: FloatArray,
    state: tuple[np.ndarray, np.ndarray, ActionArray],
    _now: int,
) -> None:
    """One tick of CRW for all robots. `state` = constants (1,), robots (N,) edited, actions (N, 3) written.

    `draws` is (N, DRAWS) uniform in [0, 1). Inactive robots keep their state, and hold.
    """
    constants, robots, actions = state
    c = constants[0]
    for i in range(active.shape[0]):
        fetch_ahead(obs, robots, i, c)
        action = actions[i]
        if not active[i]:
            hold(obs[i], c, action)
            continue
        robot = robots[i]
        row = obs[i]
        senses = sense(row, c)
        follow_cargo(robot, senses, row, c, HOMING, after_delivery(c))
        if robot.activity == ACQUIRE:
            if explore_freely(robot, senses, row, c, draws[i], action):
                continue
            found, x, y = explore_for_object(robot, senses, row, c, draws[i])
            if found:
                robot.activity = WAIT_PICKUP
        else:
            x, y = deliver_and_leave(robot, senses, row, c, draws[i])
        command(robot, x, y, c, DELIVER, action)


class CRWPolicy(ScriptedPolicy):
    """Search by a correlated random walk."""

    caches: ClassVar[str] = "none"
    reads: ClassVar[tuple[str, ...]] = ("proximity", "light if carrying", "ground", "position", "carrying", "event")
    default_parameters: ClassVar[ControllerParameters] = ControllerParameters()
    _kernel = staticmethod(step_crw)

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: every robot explores."""
        constants = kernel_constants(self.parameters, spec)
        self._start_script(spec, rng, DRAWS, constants, new_robots(spec.n_robots))
