"""The observation layout: named slices that partition the columns, in the published order."""

import numpy as np
import pytest

from swarm_forage_env.contract.layout import SERIAL_SCALE, observation_layout

SIZES = {
    "proximity": 24,
    "light": 24,
    "ground": 4,
    "wheel_speed": 2,
    "position": 2,
    "heading": 2,
    "carrying": 1,
    "interacting": 1,
    "active": 1,
    "cargo": 1,
    "event_object": 1,
    "event": 1,
    "event_cache": 4,
    "los_cell": 2,
    "los_object": 25,
    "los_cache": 16,
}


@pytest.fixture(scope="module")
def layout():
    return observation_layout(32.0, 16.0, 200)


def test_slices_are_the_documented_ones_in_order(layout):
    assert {part.name: part.size for part in layout} == SIZES
    assert layout.names == tuple(SIZES)
    columns = np.concatenate([np.arange(layout.size)[layout[part.name]] for part in layout])
    np.testing.assert_array_equal(columns, np.arange(sum(SIZES.values())))


def test_scales_are_natural_units(layout):
    for part in layout:
        assert len(part.scale) == part.size
    assert layout.part("position").scale == (16.0, 8.0)
    assert layout.part("wheel_speed").scale == (0.20, 0.20)
    assert layout.part("cargo").scale == (200.0,)
    assert layout.part("event").scale == (16.0,)
    assert layout.part("event_cache").scale == (SERIAL_SCALE, 16.0, 8.0, 200.0)


def test_unknown_slice_lists_the_known_ones(layout):
    with pytest.raises(KeyError, match=r"'lidar'.*proximity, light"):
        layout["lidar"]


def test_serial_numbers_survive_float32():
    serials = np.array([1, 2, 12_345_678, 2**24 - 1])
    np.testing.assert_array_equal(np.float32(serials / SERIAL_SCALE).astype(np.float64) * SERIAL_SCALE, serials)
