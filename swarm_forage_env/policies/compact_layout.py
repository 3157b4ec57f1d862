"""Columns of what learners see in place of single readings: the compact view, and remembered sites."""

from collections.abc import Iterable

import numpy as np

from swarm_forage_env._internal.fields import known_name
from swarm_forage_env.contract.layout import LayoutRow, ObservationLayout, layout_of
from swarm_forage_env.contract.types import IntArray
from swarm_forage_env.policies.kernels.learner import COMPACT_COLUMNS, SITE_COLUMNS

_SHARED = ("wheel_speed", "position", "heading", "carrying", "interacting", "active")
"""Slices that the compact view takes as they are, in order."""
SITE_ROWS: tuple[LayoutRow, ...] = tuple(
    (name, (1.0,) * SITE_COLUMNS, "", f"{what}: m forward, m left, at most 1 m long; 1 if it is known; distance / 20 m")
    for name, what in (
        ("pickup_site", "where the robot picked an object up last"),
        ("sighting_site", "where it last saw an object while carrying"),
    )
)
COMPACT_READS = ("proximity", "light", "ground", *_SHARED, "los_cell", "los_object", "los_cache")
"""Slices of the environment's observations that the compact view is made from."""


def columns_of(layout: ObservationLayout, names: Iterable[str]) -> IntArray:
    """Return the columns of some slices, (K,); raises ConfigError for a name that the layout does not have."""
    for name in names:
        known_name("slice", name, layout.names)
    columns = [column for name in names for column in range(layout[name].start, layout[name].stop)]
    return np.array(columns, np.int32)


def compact_layout(source: ObservationLayout) -> ObservationLayout:
    """Build the layout of the compact view (our choice of what a driver needs); directions are forward and left.

    Args:
        source: Layout of the environment's observations, from which some slices are taken as they are.
    """
    reach = (1.0, 1.0, 1.0)
    table: list[LayoutRow] = [
        ("proximity", (1.0, 1.0), "proximity", "sum of the 24 readings as vectors, cut to length 1"),
        ("obstacle", (1.0,), "proximity", "1 when that sum means an obstacle"),
        ("light", (1.0, 1.0), "light", "direction of the nest lights, length 1; zeros in the dark"),
        ("on_object", (1.0,), "", "1 when a free object lies in the robot's cell"),
        ("on_nest", (1.0,), "ground", "1 when the ground sensors see the nest"),
        ("on_cache", (1.0,), "ground", "1 when the ground sensors see a cache"),
        *(source.part(name).row for name in _SHARED),
        ("object", reach, "", "nearest object in view: m forward, m left, at most 1 m long; 1 if there is one"),
        ("cache", reach, "", "nearest cache in view: m forward, m left, cut to 1 m; 1 if there is one"),
    ]
    layout = layout_of(table)
    assert layout.size == COMPACT_COLUMNS
    return layout
