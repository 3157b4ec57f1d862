"""A picture of the arena of a study: where robots, objects and caches are when its runs begin."""

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env.rendering.frame import render_frame
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.studies.study import Cell, StudySpec

SIZE_PX = 700
"""Longer side of the arena in pixels."""


def snapshot_cell(spec: StudySpec) -> Cell:
    """Return the cell that a picture is of: first reading, last policy, the middle value of each axis."""
    middle = tuple(axis.values[(len(axis.values) - 1) // 2] for axis in spec.axes)
    wanted = (spec.readings[0], spec.policies[-1].label, middle)
    return next(cell for cell in spec.cells if (cell.reading, cell.policy, cell.values) == wanted)


def snapshot(spec: StudySpec) -> NDArray[np.uint8]:
    """Draw the first run of that cell before its first tick.

    Returns:
        (H, W, 3) picture, first row at the top.

    Raises:
        ImportError: Pillow is not installed.
    """
    cell = snapshot_cell(spec)
    run = spec.specs_of(cell)[0]
    env = build_env(run.scenario)
    env.reset_batch(run.seed)
    world = run.scenario
    values = spec.place_words()[cell][2:]
    places = [f"{axis.name.replace('_', ' ')} {word}" for axis, word in zip(spec.axes, values, strict=True)]
    title = ", ".join([f"{spec.name}: {world.arena.width_m:g} x {world.arena.height_m:g} m", *places])
    return render_frame(
        world, env.swarm, env.objects, env.caches, env.events, tick=0, size_px=SIZE_PX, title=title, theme="light"
    )
