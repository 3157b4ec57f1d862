"""Rewards and observations of users: functions of the world's arrays.

    def nest_distance(arena):
        return np.linalg.norm(arena.swarm.position - arena.config.arena.nest_centre_m, axis=1, keepdims=True) / 50.0

    env = parallel_env("warehouse_small", extra_observation=nest_distance)

A function takes the world (`world.arena.ForagingArena`: `swarm`, `objects`, `caches`, `events`, `config`, `tick`). It
only reads. Rows of robots that are away are not used.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.faults import in_words
from swarm_forage_env.contract.types import BoolArray, FloatArray

ExtraFunction: TypeAlias = Callable[[Any], np.ndarray]
"""Takes the world. As `extra_reward` it returns (N,), what is added to the reward of each robot; as `extra_observation`
(N, K), further columns of what each robot sees. All numbers are in [-1, 1]."""


class ExtraFunctionError(ValueError):
    """A function of the user that failed, or returned what no observation or reward can be."""


def extra_columns(function: ExtraFunction, arena: Any, n_columns: int | None = None) -> FloatArray:
    """Return the further columns (N, K) that robots see; zeros for robots that are not in the world.

    Args:
        function: The user's `extra_observation`.
        arena: The world.
        n_columns: K; None = what the function returns, at least 1.

    Raises:
        ExtraFunctionError: the function failed, or returned another shape or numbers outside of [-1, 1].
    """
    present = arena.swarm.present
    return _called("extra_observation", function, arena, (len(present), n_columns), present[:, None])


def extra_rewards(function: ExtraFunction, arena: Any) -> FloatArray:
    """Return what the user's `extra_reward` adds, (N,); zero for robots that are not at work.

    Raises:
        ExtraFunctionError: as `extra_columns`.
    """
    active = arena.swarm.active
    return _called("extra_reward", function, arena, active.shape, active)


def _called(
    role: str, function: ExtraFunction, arena: Any, shape: tuple[int | None, ...], counts: BoolArray
) -> FloatArray:
    """Return what the function says of the rows that count, and zeros in the others; None in `shape` = 1 or more."""
    name = f"{role} {getattr(function, '__name__', repr(function))}"
    try:
        values = np.asarray(function(arena))
    except Exception as error:  # code of the user, which may raise anything
        raise ExtraFunctionError(f"{name} failed with {in_words(error)}") from error
    if values.dtype.kind not in "biuf":
        raise ExtraFunctionError(f"Expected {name} to return real numbers, got {values.dtype}.")
    pairs = zip(values.shape, shape, strict=False)
    if values.ndim != len(shape) or not all(n == wanted or (n and wanted is None) for n, wanted in pairs):
        told = str(shape).replace("None", "K")
        raise ExtraFunctionError(f"Expected {name} to return shape {told}, one row per robot, got {values.shape}.")
    values = np.where(counts, values, 0.0)
    fits = np.abs(values) <= 1.0
    if not fits.all():
        raise ExtraFunctionError(
            f"Expected {name} to return numbers in [-1, 1], got {values[~fits][0]}; divide by the largest value that "
            "can occur, or clip."
        )
    return values
