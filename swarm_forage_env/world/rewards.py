"""Rewards of a swarm for learners: the terms of `kernels.reward`, weighted by `scenarios.config.RewardConfig`.

A function of the user may add to them (`contract.own.register_reward`).
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import direct
from swarm_forage_env.contract.own import OwnFunctionError, OwnReward, called, own_reward
from swarm_forage_env.scenarios.config import RewardConfig
from swarm_forage_env.world.kernels.reward import Happenings, Payment, Weights, rewards
from swarm_forage_env.world.state import StepEvents, SwarmState


class RewardModel:
    """Rewards of one run, tick by tick; made anew at reset."""

    def __init__(
        self,
        config: RewardConfig,
        nest_centre_m: tuple[float, float],
        swarm: SwarmState,
        events: StepEvents,
        world: object,
    ) -> None:
        """Bind the state; its arrays must not be replaced afterwards, only edited.

        Args:
            config: The weights.
            nest_centre_m: x, y.
            swarm: Robots.
            events: Happenings of a tick.
            world: What a function of the user is called with.

        Raises:
            ConfigError: `config` names a function that is not known here.
        """
        self._world = world
        self._own_name = config.own_reward
        if self._own_name:
            assert self._own is not None, "an unknown name is told now, not in the first step"
        self._weights = Weights(*(float(getattr(config, name)) for name in Weights._fields))
        self._is_dense = bool(config.nest_progress or config.interference or config.tick or config.own_reward)
        self._is_progress_paid = bool(config.nest_progress)
        self._is_team = config.team
        self._events, self._swarm = events, swarm
        self._reward = np.zeros(len(swarm.active), np.float32)
        self._total = np.zeros(len(swarm.active))
        self._happenings = Happenings(
            code=events.code,
            first_picked=events.first_picked,
            interfering=events.interfering,
            carried_object=swarm.carried_object,
            active=swarm.active,
            position=swarm.position,
            previous_position=np.zeros_like(swarm.position),
            nest_centre_m=np.array(nest_centre_m, np.float64),
        )

    @cached_property
    def _rewards(self) -> Callable[[Happenings, Weights, np.ndarray, np.ndarray], None]:
        return direct(rewards, self._happenings, self._weights, self._total, self._reward)

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and snapshots are made of: everything but functions, which cannot all be stored."""
        return {name: value for name, value in vars(self).items() if name not in {"_rewards", "_own"}}

    @property
    def payment(self) -> Payment | None:
        """What `kernels.reward.pay` does the work of `reward` with; None where it cannot: a user's function, `team`."""
        if self._own_name or self._is_team:
            return None
        return Payment(
            happenings=self._happenings,
            happened=self._events.happened,
            total=self._total,
            reward=self._reward,
            weights=self._weights,
            is_dense=self._is_dense,
        )

    def remember(self) -> None:
        """Keep the positions before a step, if a term needs them."""
        if self._is_progress_paid:
            np.copyto(self._happenings.previous_position, self._swarm.position)

    def reward(self) -> np.ndarray:
        """Rewards of this tick, (N,) float32; the buffer is reused. Inactive robots receive none.

        With `team`, every active robot receives the mean over active robots.
        """
        if not (self._events.happened[0] or self._is_dense):
            self._reward[:] = 0.0
            return self._reward
        self._rewards(self._happenings, self._weights, self._total, self._reward)
        if self._own is not None:
            self._total += self._own_terms(self._own)
            self._reward[:] = self._total
        if self._is_team:
            active = self._swarm.active
            self._reward[:] = self._total.sum() / max(1, np.count_nonzero(active)) * active
        return self._reward

    @cached_property
    def _own(self) -> OwnReward | None:
        return own_reward(self._own_name) if self._own_name else None

    def _own_terms(self, function: OwnReward) -> np.ndarray:
        """Return what the user's function adds, (N,), zero for robots that are not at work.

        Raises:
            OwnFunctionError: it failed, or returned another shape or numbers that are not finite.
        """
        active = self._swarm.active
        values = called(function, self._world, f"reward {self._own_name!r}")
        if values.shape != active.shape:
            raise OwnFunctionError(
                f"Expected reward {self._own_name!r} to return shape (n_robots,) = {active.shape}, got {values.shape}."
            )
        values = np.where(active, values, 0.0)
        if not np.isfinite(values).all():
            raise OwnFunctionError(
                f"Expected reward {self._own_name!r} to return finite numbers, got {values[~np.isfinite(values)][0]}."
            )
        return values
