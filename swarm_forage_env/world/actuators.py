"""From actions to body motion: limits of the drive, wheel gains of wrappers, wheels that stand still."""

import numpy as np

from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.contract.types import ActionArray, FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.units import WHEEL_SCALE_MPS
from swarm_forage_env.world.kernels.drive import drive
from swarm_forage_env.world.state import SwarmState


def drive_limits(config: ScenarioConfig) -> FloatArray:
    """Return the array `limits` of the drive kernels: wheel scale, centre-speed limit, difference limit, wheel base."""
    robots = config.robots
    return np.array([WHEEL_SCALE_MPS, robots.max_speed_mps, robots.max_wheel_difference_mps, robots.wheel_base_m])


class Drive:
    """Differential drive of a swarm: wheel speed = limit(limit(command) x gain)."""

    def __init__(self, config: ScenarioConfig) -> None:
        """Take the limits from `config`."""
        self._dt_s = config.dt_s
        self._limits = drive_limits(config)
        self._unit_gain = np.ones((config.robots.n_robots, 2))

    def apply(self, actions: ActionArray, wheel_gain: FloatArray | None, swarm: SwarmState, twist: FloatArray) -> None:
        """Write `swarm.wheel_speed` and body twists.

        Commands beyond [-1, 1] are clipped. Centre speed and wheel difference are limited each by clipping, before the
        gains and again after them: noise makes no motor faster than it is, and no robot drives through a wall. Wheels
        of inactive robots and of robots in an interaction stand still.

        Args:
            actions: (N, 3) float32; rows of inactive robots are ignored.
            wheel_gain: (N, 2) factor per wheel, or None for 1.
            swarm: Read: active, pending_kind, facing. Written: wheel_speed.
            twist: (N + 1, 3) written: world velocity x, y in m/s and turn rate in rad/s.

        Raises:
            ActionError: an active robot's action or gain is NaN or infinite.
        """
        gain = self._unit_gain if wheel_gain is None else wheel_gain
        bad = drive(
            actions,
            gain,
            swarm.active,
            swarm.pending_kind,
            swarm.facing,
            self._limits,
            self._dt_s,
            swarm.wheel_speed,
            twist,
        )
        if bad >= 0:
            raise ActionError(
                f"Expected finite actions and wheel gains, got {actions[bad].tolist()} and {gain[bad].tolist()} for "
                f"robot_{bad}; the world was not stepped."
            )
