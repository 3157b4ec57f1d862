"""Reward terms, one small function each; weights in `scenarios.config.RewardConfig`. Only learners use them."""

import numpy as np

from swarm_forage_env.contract.codes import Event
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import RewardConfig
from swarm_forage_env.world.state import StepEvents, SwarmState

_DELIVERED = int(Event.DELIVERED)


def delivered(events: StepEvents) -> FloatArray:
    """1 for a robot that delivered an object to the nest in this tick, (N,)."""
    return (events.code == _DELIVERED).astype(np.float64)


def first_picked(events: StepEvents) -> FloatArray:
    """1 for a robot that picked up an object nobody had carried since it was placed, (N,)."""
    return events.first_picked.astype(np.float64)


def nest_progress(swarm: SwarmState, previous_position: FloatArray, nest_centre_m: FloatArray) -> FloatArray:
    """Metres that each carrying robot came closer to the nest centre in this tick, (N,)."""
    before = np.linalg.norm(previous_position - nest_centre_m, axis=1)
    after = np.linalg.norm(swarm.position - nest_centre_m, axis=1)
    return np.where(swarm.carried_object >= 0, before - after, 0.0)


def interference(events: StepEvents) -> FloatArray:
    """1 for a robot in interference, (N,)."""
    return events.interfering.astype(np.float64)


class RewardModel:
    """Weighted sum of the terms for one swarm; terms of weight zero are not computed."""

    def __init__(self, config: RewardConfig, nest_centre_m: tuple[float, float], n_robots: int) -> None:
        """Allocate the reward buffer."""
        self._config = config
        self._dense = bool(config.nest_progress or config.interference or config.tick)
        self._nest_centre_m = np.array(nest_centre_m)
        self._reward = np.zeros(n_robots, np.float32)
        self._previous_position = np.zeros((n_robots, 2))

    def remember(self, swarm: SwarmState) -> None:
        """Keep the positions before a step, if a term needs them."""
        if self._config.nest_progress:
            np.copyto(self._previous_position, swarm.position)

    def reward(self, swarm: SwarmState, events: StepEvents) -> np.ndarray:
        """Rewards of this tick, (N,) float32; the buffer is reused. Inactive robots receive none.

        With `team`, every active robot receives the mean over active robots.
        """
        config = self._config
        if not (events.happened[0] or self._dense):
            self._reward[:] = 0.0
            return self._reward
        total = config.delivery * delivered(events) + config.first_pickup * first_picked(events)
        if config.nest_progress:
            total += config.nest_progress * nest_progress(swarm, self._previous_position, self._nest_centre_m)
        if config.interference:
            total += config.interference * interference(events)
        if config.tick:
            total += config.tick
        total *= swarm.active
        if config.team:
            total[:] = total.sum() / max(1, np.count_nonzero(swarm.active)) * swarm.active
        np.copyto(self._reward, total, casting="same_kind")
        return self._reward
