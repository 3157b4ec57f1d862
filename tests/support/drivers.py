"""Policies that Python is asked in every tick, and one with a fault in its kernel."""

import copy
from typing import Any

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.run import run_policy
from swarm_forage_env.runs.spec import RunSpec


def tick_by_tick(policy: Policy) -> Policy:
    """The policy with an `act` of somebody else, so that Python is asked in every tick."""
    act = policy.act
    policy.act = lambda obs, active: act(obs, active)
    return policy


def states_of(spec: RunSpec, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[int, Any], Record]:
    """Tick -> copies of swarm, objects and counters of a run that Python makes tick by tick; and its record."""
    advance, states = ForageEnv.advance, {}

    def note(self: ForageEnv, *arguments: Any, **options: Any) -> Any:
        result = advance(self, *arguments, **options)
        states[self.tick] = copy.deepcopy((self.swarm, self.objects, self.events.counters))
        return result

    with monkeypatch.context() as patch:
        patch.setattr(ForageEnv, "advance", note)
        return states, run_policy(tick_by_tick(load_policy(spec.policy)), spec)


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
