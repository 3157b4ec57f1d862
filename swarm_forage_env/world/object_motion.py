"""Random walk of free objects: they drift while no robot carries them (p_rw of the paper's scenario 2)."""

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.regions import Box
from swarm_forage_env.world.kernels.walk import walk
from swarm_forage_env.world.state import ObjectState


def walk_objects(
    objects: ObjectState,
    distributable_box: Box,
    probability: float,
    rng: np.random.Generator,
    quirk_self_conflict: bool,
    scratch: FloatArray,
) -> int:
    """Let every free object take one step with `probability`; returns how many moved.

    A step goes to one of the free cells among the eight neighbours, drawn uniformly; if none is free the object stays.
    The study redraws a step of -1, 0 or 1 cells per axis until it fits, up to 32 times. That is a uniform choice, too;
    only the rule of giving up after 32 draws is left out here. One number is drawn per object and tick, whatever its
    status, so that runs which share a seed stay paired.

    Args:
        objects: Edited in place: `floor` and `cell`.
        distributable_box: Cells on which objects may lie, half-open.
        probability: p_rw, per object and tick, in [0, 1]; at 0 nothing is drawn.
        rng: Generator of the object-motion stream.
        quirk_self_conflict: Quirk `motion_self_conflict`: an object conflicts with its own old place and can cross
            only borders that leave a rounding gap (`kernels.walk.OPEN_BORDERS`).
        scratch: (M,) float64, overwritten.
    """
    if probability == 0.0:
        return 0
    rng.random(out=scratch)
    return walk(
        objects.floor, objects.status, objects.cell, scratch, probability, distributable_box, quirk_self_conflict
    )
