"""The swarm as one Gymnasium environment: joint observations, joint actions, one reward."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium import spaces

from swarm_forage_env.config import ScenarioConfig
from swarm_forage_env.env import ForageEnv, parallel_env
from swarm_forage_env.types import ActionArray, ObsArray

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig


class JointForageEnv(gymnasium.Env[ObsArray, ActionArray]):
    """One agent that sees and steers every robot: the view of single-agent algorithms and of central control.

    Observations are (N, D) float32 and actions (N, 3) float32, both in [-1, 1], row i = robot i; the columns are
    those of the parallel environment (`world.layout`). The reward is the sum over robots. An episode terminates when
    every robot is dead and is truncated at the horizon. `info["active"]` is (N,) bool, the tasked swarm.
    """

    metadata = ForageEnv.metadata

    def __init__(
        self,
        scenario: str | ScenarioConfig = "warehouse_small",
        *,
        wrappers: "Iterable[WrapperConfig]" = (),
        max_cycles: int | None = None,
        render_mode: str | None = None,
        **overrides: Any,
    ) -> None:
        """Create the environment.

        Args:
            scenario: Name of a preset, or a complete configuration.
            wrappers: What stands between agent and world (throttle, noise, ...), in any order.
            max_cycles: Steps until truncation; default the scenario's horizon.
            render_mode: None or "rgb_array".
            overrides: Scenario fields by name (`n_robots=20`).

        Raises:
            ConfigError: unknown preset or field, or values that describe no world.
        """
        self.world = parallel_env(scenario, max_cycles=max_cycles, render_mode=render_mode, **overrides)
        self.render_mode = render_mode
        self._env: ForageEnv | SwarmWrapper = self.world
        for config in sorted(wrappers, key=lambda config: config.stack_position, reverse=True):
            self._env = config.wrap(self._env)
        n_robots = self.world.scenario.robots.n_robots
        self.observation_space = spaces.Box(-1.0, 1.0, (n_robots, self.world.layout.size), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (n_robots, 3), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObsArray, dict[str, Any]]:
        """Start an episode; returns observations (N, D) and info. `options` is accepted and ignored."""
        super().reset(seed=seed)
        return self._env.reset_batch(seed).copy(), self._info()

    def step(self, action: ActionArray) -> tuple[ObsArray, float, bool, bool, dict[str, Any]]:
        """Advance one tick.

        Args:
            action: (N, 3), rows of robots that are away included (and ignored).

        Raises:
            ActionError: wrong shape or an active robot's action that is not finite.
        """
        obs, reward, terminated, truncated = self._env.step_batch(np.asarray(action, np.float32))
        # float64 before the sum: the total of a large swarm should not depend on the order of rows.
        return obs.copy(), float(reward.sum(dtype=np.float64)), bool(terminated.all()), truncated, self._info()

    def render(self) -> np.ndarray | None:
        """Return a picture (height, width, 3) uint8 when created with render_mode="rgb_array", else None."""
        return self.world.render()

    def close(self) -> None:
        """Close the wrapped stack."""
        self._env.close()

    def _info(self) -> dict[str, Any]:
        return {"active": self.world.active.copy()}
