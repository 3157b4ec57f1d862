"""What controls a swarm: the Policy protocol, and what a policy knows before a run.

A policy, scripted or trained, sees observations and never the world. `baselines` imports from this folder, `Quirks`,
and the tools `compiling` and `spelling`, and from nothing else of the environment.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.scenarios.quirks import Quirks


class ActionError(ValueError):
    """Actions of the wrong shape, or not finite."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SwarmSpec:
    """What every policy knows before a run: constants of robot and world, no state."""

    n_robots: int
    n_objects: int
    dt_s: float
    horizon_s: float
    layout: ObservationLayout
    max_speed_mps: float
    """Limit of the centre speed."""
    max_wheel_difference_mps: float
    """Limit of right minus left wheel speed."""
    wheel_scale_mps: float
    """Wheel speed that an action of 1.0 commands."""
    wheel_base_m: float
    arena_size_m: tuple[float, float]
    cell_m: float
    nest_centre_m: tuple[float, float]
    nest_size_m: tuple[float, float]
    distributable_box_m: tuple[float, float, float, float]
    """x low, y low, x high, y high of the area where objects may lie."""
    placement: str
    caches: str
    """"none", "static" or "dynamic"."""
    cache_side_m: float
    """Side of a cache as built, an odd number of cells."""
    cache_side_nominal_m: float
    """0.2 max(X, Y); distances are derived from it."""
    min_dist_m: float
    """0.2 min(X, Y)."""
    cache_proximity_m: float
    """SITE and CREATE_CACHE drops are refused within this distance of a cache centre."""
    quirks: Quirks


@runtime_checkable
class Policy(Protocol):
    """Controls every robot at once. An instance drives one run; its memory is created by `reset`.

    Optional attributes: `task`, an (N,) int8 array of `Task` codes; `describe_robot(row) -> str`, what one robot is up
    to, for people (`study.stuck` shows it); the class attributes `caches` ("none", "static", "dynamic": the world the
    policy is made for) and `reads` (names of the slices it looks at; default all).
    """

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Prepare for one run."""
        ...

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions.

        Args:
            obs: (N, D) float32. The array is reused by the environment: copy what must be kept.
            active: (N,) bool, robots of the tasked swarm; rows of others are ignored.

        Returns:
            (N, 3) float32 in [-1, 1]: left wheel, right wheel, gripper.
        """
        ...
