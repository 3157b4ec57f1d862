"""Rewards and observations of users: functions of the world's arrays.

    def nest_distance(arena):
        return np.linalg.norm(arena.swarm.position - arena.config.arena.nest_centre_m, axis=1, keepdims=True) / 50.0

    env = parallel_env("warehouse_small", extra_observation=nest_distance)

A function takes the world (`world.arena.ForagingArena`: `swarm`, `objects`, `caches`, `events`, `config`, `tick`). It
only reads. Rows of robots that are away are not used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.faults import in_words
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.types import BoolArray, FloatArray

ExtraFunction: TypeAlias = Callable[[Any], np.ndarray]
"""Takes the world. As `extra_reward` it returns (N,), what is added to the reward of each robot; as `extra_observation`
(N, K), further columns of what each robot sees. All numbers are in [-1, 1]."""


class ExtraFunctionError(ValueError):
    """A function of the user that failed, or returned what no observation or reward can be."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Extras:
    """What users add to an environment.

    Raises:
        ConfigError: not a function.
    """

    reward: ExtraFunction | None = None
    observation: ExtraFunction | None = None

    def __post_init__(self) -> None:
        for name, given in (("extra_reward", self.reward), ("extra_observation", self.observation)):
            if given is not None and not callable(given):
                raise ConfigError(f"Expected {name} to be a function of the world, got {given!r}.")

    def as_arguments(self) -> dict[str, Any]:
        """Return them as environments take them."""
        return {"extra_reward": self.reward, "extra_observation": self.observation}


def extra_columns(function: ExtraFunction, arena: Any, n_columns: int | None = None) -> FloatArray:
    """Return the further columns (N, K) that robots see; zeros for robots that are not in the world.

    Args:
        function: The user's `extra_observation`.
        arena: The world.
        n_columns: K; None = what the function returns.

    Raises:
        ExtraFunctionError: the function failed, or returned another shape or numbers outside of [-1, 1].
    """
    present = arena.swarm.present
    values = _numbers(function, arena, "extra_observation")
    wanted = (len(present), n_columns or "K")
    if values.ndim != 2 or len(values) != len(present) or (n_columns or values.shape[1]) != values.shape[1]:
        raise _misshapen("extra_observation", function, wanted, values)
    return _in_range("extra_observation", function, values, present[:, None])


def extra_rewards(function: ExtraFunction, arena: Any) -> FloatArray:
    """Return what the user's `extra_reward` adds, (N,); zero for robots that are not at work.

    Raises:
        ExtraFunctionError: as `extra_columns`.
    """
    active = arena.swarm.active
    values = _numbers(function, arena, "extra_reward")
    if values.shape != active.shape:
        raise _misshapen("extra_reward", function, active.shape, values)
    return _in_range("extra_reward", function, values, active)


def _numbers(function: ExtraFunction, arena: Any, role: str) -> np.ndarray:
    try:
        values = np.asarray(function(arena))
    except Exception as error:  # code of the user, which may raise anything
        raise ExtraFunctionError(f"{role} failed with {in_words(error)}") from error
    if values.dtype.kind not in "biuf":
        raise ExtraFunctionError(f"Expected {role} {_name(function)} to return real numbers, got {values.dtype}.")
    return values


def _misshapen(role: str, function: ExtraFunction, wanted: tuple[Any, ...], values: np.ndarray) -> ExtraFunctionError:
    shape = ", ".join(map(str, wanted)) + "," * (len(wanted) == 1)
    return ExtraFunctionError(
        f"Expected {role} {_name(function)} to return shape ({shape}), one row per robot, got {values.shape}."
    )


def _in_range(role: str, function: ExtraFunction, values: np.ndarray, counts: BoolArray) -> FloatArray:
    values = np.where(counts, values, 0.0)
    fits = np.abs(values) <= 1.0
    if not fits.all():
        raise ExtraFunctionError(
            f"Expected {role} {_name(function)} to return numbers in [-1, 1], got {values[~fits][0]}; divide by the "
            "largest value that can occur, or clip."
        )
    return values


def _name(function: ExtraFunction) -> str:
    return getattr(function, "__name__", repr(function))
