"""Who drives the swarms of worlds made at random: ways that no sensible policy would take, and policies.

Where robots can send messages, the first three drivers send what they drive by: (N, 3 + message_size).
"""

from typing import Protocol

import numpy as np

from baselines.crw import CRWPolicy
from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.contract.types import ActionArray, ObsArray
from swarm_forage_env.env import ForageEnv

WAYS = {
    "E": (1, 0),
    "W": (-1, 0),
    "N": (0, 1),
    "S": (0, -1),
    "NE": (1, 1),
    "NW": (-1, 1),
    "SE": (1, -1),
    "SW": (-1, -1),
}
"""Directions of walls and corners."""


def towards(env: ForageEnv, place: str) -> ActionArray:
    """Full speed towards a wall or a corner, one of `WAYS`, turning on the spot to face it; (N, 3)."""
    swarm, arena = env.swarm, env.scenario.arena
    actions = np.zeros((len(swarm.active), 3), np.float32)
    way = np.array(WAYS[place])
    target = np.where(way > 0, (arena.width_m, arena.height_m), 0.0)
    to = np.where(way == 0, 0.0, target - swarm.position)
    turn = np.angle(np.exp(1j * (np.arctan2(to[:, 1], to[:, 0]) - swarm.heading)))
    actions[:, 0] = np.where(np.abs(turn) < 0.3, 1.0, -np.sign(turn))
    actions[:, 1] = np.where(np.abs(turn) < 0.3, 1.0, np.sign(turn))
    return actions


class Driver(Protocol):
    """Chooses the actions of a swarm; it looks at nothing but its arguments and what it drew at its reset."""

    def reset(self, env: ForageEnv, rng: np.random.Generator) -> None:
        """Start a run."""

    def act(self, env: ForageEnv, obs: ObsArray) -> ActionArray:
        """Return (N, 3) or (N, A) actions for observations (N, D)."""
        ...


class Uniform:
    """Anything in [-1, 1], another in every tick."""

    def reset(self, env: ForageEnv, rng: np.random.Generator) -> None:
        """Keep the generator."""
        self._rng = rng

    def act(self, env: ForageEnv, obs: ObsArray) -> ActionArray:
        """Draw."""
        return self._rng.uniform(-1.0, 1.0, env.swarm_spec.action_shapes[-1]).astype(np.float32)


class Corners:
    """Corners of the action space, each for a while: ends of ranges are where faults are."""

    def reset(self, env: ForageEnv, rng: np.random.Generator) -> None:
        """Keep the generator."""
        self._rng = rng
        self._actions = self._draw(env)

    def _draw(self, env: ForageEnv) -> ActionArray:
        shape = env.swarm_spec.action_shapes[-1]
        return self._rng.choice(np.array([-1.0, 0.0, 1.0], np.float32), shape)

    def act(self, env: ForageEnv, obs: ObsArray) -> ActionArray:
        """Change some."""
        changed = self._rng.random(len(obs)) < 0.1
        self._actions[changed] = self._draw(env)[changed]
        return self._actions.copy()


class Beyond:
    """Numbers far outside of [-1, 1], which are clipped, and numbers next to zero."""

    NUMBERS = np.array([-3e38, 3e38, -2.0, 2.0, 1e-45, -1e-45, -0.0, 1.0000001, -0.25, 0.5], np.float32)

    def reset(self, env: ForageEnv, rng: np.random.Generator) -> None:
        """Keep the generator."""
        self._rng = rng

    def act(self, env: ForageEnv, obs: ObsArray) -> ActionArray:
        """Draw."""
        return self._rng.choice(self.NUMBERS, env.swarm_spec.action_shapes[-1])


class Wall:
    """All to one wall or corner, grasping and letting go on the way."""

    def reset(self, env: ForageEnv, rng: np.random.Generator) -> None:
        """Choose where."""
        self._rng = rng
        self._place = str(rng.choice(list(WAYS)))

    def act(self, env: ForageEnv, obs: ObsArray) -> ActionArray:
        """Drive there."""
        actions = towards(env, self._place)
        actions[:, 2] = self._rng.uniform(-1.0, 1.0, len(obs))
        return actions


class Driven:
    """A policy, which sees observations only."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy

    def reset(self, env: ForageEnv, rng: np.random.Generator) -> None:
        """Reset the policy."""
        self._policy.reset(env.swarm_spec, rng)

    def act(self, env: ForageEnv, obs: ObsArray) -> ActionArray:
        """Ask the policy."""
        return self._policy.act(obs, env.active)


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
