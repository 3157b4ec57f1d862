"""Rewards of a swarm for learners: the terms of `kernels.reward`, weighted by `scenarios.config.RewardConfig`."""

from collections.abc import Sequence

import numpy as np

from swarm_forage_env._internal.compiling import Calls
from swarm_forage_env._internal.held import hold
from swarm_forage_env.scenarios.config import RewardConfig
from swarm_forage_env.world.kernels.reward import Payment, Weights, rewards
from swarm_forage_env.world.state import StepEvents, SwarmState


class RewardModel:
    """Rewards of one run, tick by tick; made anew at reset."""

    def __init__(
        self,
        config: RewardConfig,
        nest_centres_m: Sequence[tuple[float, float]],
        swarm: SwarmState,
        events: StepEvents,
    ) -> None:
        """Bind the state; its arrays must not be replaced afterwards, only edited.

        Args:
            config: The weights.
            nest_centres_m: x, y of each nest.
            swarm: Robots.
            events: Happenings of a tick.
        """
        self._is_progress_paid = bool(config.nest_progress)
        self._is_team = config.team
        self._call = Calls()
        self._payment = Payment(
            swarm=swarm,
            events=events,
            previous_position=np.zeros_like(swarm.position),
            nest_centres_m=np.array(nest_centres_m, np.float64),
            total=np.zeros(len(swarm.active)),
            reward=np.zeros(len(swarm.active), np.float32),
            weights=Weights(*(float(getattr(config, name)) for name in Weights._fields)),
            is_dense=bool(config.nest_progress or config.interference or config.tick),
        )
        self._held = hold(self._payment)

    @property
    def payment(self) -> Payment | None:
        """What `kernels.reward.pay` does the work of `reward` with; None where it cannot: `team`."""
        return None if self._is_team else self._held

    def remember(self) -> None:
        """Keep the positions before a step, if a term needs them."""
        if self._is_progress_paid:
            np.copyto(self._payment.previous_position, self._payment.swarm.position)

    def reward(self) -> np.ndarray:
        """Rewards of this tick, (N,) float32; the buffer is reused. Inactive robots receive none.

        With `team`, every active robot receives the mean over active robots.
        """
        p = self._payment
        if not (p.events.happened[0] or p.is_dense):
            p.reward[:] = 0.0
            return p.reward
        self._call(rewards, self._held)
        if self._is_team:
            active = p.swarm.active
            p.reward[:] = p.total.sum() / max(1, np.count_nonzero(active)) * active
        return p.reward
