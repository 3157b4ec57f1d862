"""What every `reset` and `step` refuses, or ends, before it looks at the world.

An action at array level must have its shape and its type, and hold finite numbers for robots at work.
"""

from collections.abc import Collection, Mapping
from math import isfinite
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import COMMANDS, ActionError, refused_action
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray

OPTION_OF_TESTS = "options"
"""A reset option without a meaning: PettingZoo's own `parallel_api_test` gives it to every environment."""


def no_options(options: Mapping[str, Any] | None) -> None:
    """Refuse reset options, for environments that take none.

    Raises:
        ConfigError: there is one; the message names it.
    """
    for name in options or ():
        if name != OPTION_OF_TESTS:
            raise ConfigError(
                f"Expected no reset options, got {name!r}. An environment with an interface changes its scenario at a "
                "reset: parallel_env(..., interface={}), then reset(options={'scenario': {'n_objects': 50}})."
            )


def is_over(agents_left: Collection[str], actions: Any, *, is_reset: bool) -> bool:
    """Return whether a step has nothing to do, because no agent is left and no action was given.

    Libraries that step many environments side by side ask for it until all of them are done.

    Args:
        agents_left: Agents of the environment.
        actions: What its `step` was given.
        is_reset: Whether it was reset.

    Raises:
        RuntimeError: no agent is left, but there are actions, or it was never reset.
    """
    if agents_left:
        return False
    if not is_reset:
        raise RuntimeError("Call reset before step.")
    if actions:
        raise RuntimeError("All agents are done; call reset first.")
    return True


def as_actions(actions: ActionArray, n_robots: int, message_size: int = 0) -> ActionArray:
    """Return `actions` as a contiguous (N, A) float32 array, the same array if it is one; values are not checked.

    Args:
        actions: (N, A); where robots can say something, also (N, 3), which says zeros.
        n_robots: N.
        message_size: Numbers that a robot may say, A - 3.

    Raises:
        ActionError: values that are not numbers, or another shape.
    """
    expected = (n_robots, COMMANDS + message_size)
    try:
        checked = real_numbers(actions)
    except (TypeError, ValueError) as error:
        raise ActionError(f"Expected actions with {_shape_in_words(expected)}: {error}.") from error
    if message_size and checked.shape == (n_robots, COMMANDS):
        silent = np.zeros(expected, np.float32)
        silent[:, :COMMANDS] = checked
        return silent
    if checked.shape != expected:
        raise ActionError(
            f"Expected actions with {_shape_in_words(expected)}, got {checked.shape}; "
            "pass one row per robot, inactive ones included."
        )
    return checked


def real_numbers(values: Any) -> np.ndarray:
    """Return real numbers as a contiguous float32 array, the same array if it is one.

    Kernels are compiled for such arrays only; another type would have all compiled anew.

    Raises:
        TypeError: text, dates or complex numbers, which numpy would convert, too.
        ValueError: no array.
    """
    given = np.asarray(values)
    if given.dtype.kind not in "biufO":  # objects say themselves whether they are numbers
        raise TypeError(f"real numbers are needed, not {given.dtype}")
    return np.ascontiguousarray(given, np.float32)


def _shape_in_words(expected: tuple[int, int]) -> str:
    columns = f"{COMMANDS} + message_size" if expected[1] > COMMANDS else f"{COMMANDS}"
    return f"shape (n_robots, {columns}) = {expected}"


def checked_gain(wheel_gain: FloatArray | None, n_robots: int) -> FloatArray | None:
    """Return factors on the wheel speeds, (N, 2) or None.

    Raises:
        ActionError: another shape.
    """
    expected = (n_robots, 2)
    if wheel_gain is not None and np.shape(wheel_gain) != expected:
        raise ActionError(f"Expected wheel_gain with shape (n_robots, 2) = {expected}, got {np.shape(wheel_gain)}.")
    return wheel_gain


def refuse_not_finite(active: BoolArray, actions: ActionArray, wheel_gain: FloatArray | None) -> None:
    """Refuse what the arena would refuse, before it is stepped.

    Args:
        active: (N,) whose actions count.
        actions: (N, A) as `as_actions` returns them.
        wheel_gain: (N, 2) as `checked_gain` returns them, or None for 1.

    Raises:
        ActionError: an action or gain of an active robot that is not finite.
    """
    # A sum of squares is finite only if all its numbers are; where it is not, which is rare, one looks at each.
    if isfinite(np.vdot(actions, actions)) and (wheel_gain is None or isfinite(np.vdot(wheel_gain, wheel_gain))):
        return
    gain = np.ones((len(actions), 2)) if wheel_gain is None else wheel_gain
    bad = active & ~(np.isfinite(actions).all(axis=1) & np.isfinite(gain).all(axis=1))
    if bad.any():
        row = int(np.argmax(bad))
        raise refused_action(row, actions[row], gain[row])
