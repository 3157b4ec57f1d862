"""A picture of the arena of a study: where robots, objects and caches are when its runs begin."""

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env.rendering.frame import render_frame
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.studies.study import Place, StudySpec

SIZE_PX = 700
"""Longer side of the arena in pixels."""


def snapshot_place(spec: StudySpec) -> Place:
    """Return the condition that a picture is of: first rules, last policy, the middle value of each axis."""
    middle = tuple(axis.values[(len(axis.values) - 1) // 2] for axis in spec.axes)
    wanted = (spec.rules[0], spec.policies[-1].label, middle)
    return next(place for place in spec.places if (place.rules, place.policy, place.values) == wanted)


def snapshot(spec: StudySpec) -> NDArray[np.uint8]:
    """Draw the first run of that condition before its first tick.

    Returns:
        (H, W, 3) picture, first row at the top.

    Raises:
        ImportError: Pillow is not installed.
    """
    place = snapshot_place(spec)
    run = spec.specs_of(place)[0]
    env = build_env(run.scenario)
    env.reset_batch(run.seed)
    world = run.scenario
    values = spec.place_words()[place][2:]
    places = [f"{axis.name.replace('_', ' ')} {word}" for axis, word in zip(spec.axes, values, strict=True)]
    title = ", ".join([f"{spec.name}: {world.arena.width_m:g} x {world.arena.height_m:g} m", *places])
    return render_frame(
        world, env.swarm, env.objects, env.caches, env.events, tick=0, size_px=SIZE_PX, title=title, theme="light"
    )
