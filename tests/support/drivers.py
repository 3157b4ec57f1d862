"""Policies that Python is asked in every tick, and one with a fault in its kernel."""

import numpy as np

from baselines.crw import CRWPolicy
from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.policy import Policy


def tick_by_tick(policy: Policy) -> Policy:
    """The policy with an `act` of somebody else, so that Python is asked in every tick."""
    act = policy.act
    policy.act = lambda obs, active: act(obs, active)
    return policy


LAST_TICK = 5
"""Of the faulty policy."""


@kernel
def drive_until_nan(_obs, active, _draws, state, now):
    """Drive straight on; in the last tick one robot wants no number."""
    actions = state[-1]
    for i in range(active.size):
        actions[i, 0], actions[i, 1], actions[i, 2] = 0.5, 0.4, -1.0
    if now == LAST_TICK:
        actions[2, 1] = np.nan


class UntilNaN(CRWPolicy):
    """A compiled policy with a fault."""

    _kernel = staticmethod(drive_until_nan)
