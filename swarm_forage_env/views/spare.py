"""Rows to spare: what arenas with fewer robots than rows show in the rows that no robot has."""

import numpy as np

from swarm_forage_env.contract.types import BoolArray
from swarm_forage_env.policies.interface import MOTIONS


def with_spare_rows(rows: np.ndarray, n_rows: int) -> np.ndarray:
    """Return a copy of (N, ...) values with rows of zeros after them, (n_rows, ...)."""
    padded = np.zeros((n_rows, *rows.shape[1:]), rows.dtype)
    padded[: len(rows)] = rows
    return padded


def spare_masks(masks: BoolArray, n_rows: int) -> BoolArray:
    """Return a copy of masks of actions (N, number of actions) with rows after them that can only stand.

    A row must have an action, because algorithms with masks draw one for each.
    """
    padded = with_spare_rows(masks, n_rows)
    padded[len(masks) :, MOTIONS.index("stand")] = True
    return padded
