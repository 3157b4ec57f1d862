"""What an action at array level must be: its shape, its type, and finite numbers for robots at work."""

from math import isfinite

import numpy as np

from swarm_forage_env.contract.policy import COMMANDS, ActionError, refused_action
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray


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
    columns = f"{COMMANDS} + message_size" if message_size else f"{COMMANDS}"
    try:
        # Kernels are compiled for contiguous float32 only; another type would have all compiled anew.
        checked = np.ascontiguousarray(actions, np.float32)
    except (TypeError, ValueError) as error:
        raise ActionError(f"Expected actions with shape (n_robots, {columns}) = {expected}: {error}.") from error
    if message_size and checked.shape == (n_robots, COMMANDS):
        silent = np.zeros(expected, np.float32)
        silent[:, :COMMANDS] = checked
        return silent
    if checked.shape != expected:
        raise ActionError(
            f"Expected actions with shape (n_robots, {columns}) = {expected}, got {checked.shape}; "
            "pass one row per robot, inactive ones included."
        )
    return checked


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
