"""Arrays of replays as text of a page: they come back as they were, and damaged ones are refused."""

import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from swarm_forage_env.inspect.replay.coding import pack, unpack
from swarm_forage_env.inspect.replay.frames import ReplayError


@given(
    st.sampled_from(["u1", "u2", "i4"]).flatmap(
        lambda dtype: arrays.arrays(dtype, arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5))
    )
)
def test_whole_numbers_come_back(array):
    kind = f"{array.dtype.kind}{array.dtype.itemsize}"
    again = unpack(pack(array), kind, array.shape)
    assert again.dtype == array.dtype
    assert np.array_equal(again, array)


def test_floats_come_back():
    array = np.array([0.1, -2.5, 3e8], np.float32)
    assert np.array_equal(unpack(pack(array), "f4", (3,)), array)


@pytest.mark.parametrize(
    ("dtype", "shape", "expected"),
    [
        ("f8", (3,), "types u1, u2, i4, f4"),
        ("u1", (4,), "Expected 4 bytes"),
        ("u2", (3,), "Expected 6 bytes"),
        ("u1", (2,), "Expected 2 bytes .* got more"),
    ],
)
def test_arrays_of_another_kind_are_refused(dtype, shape, expected):
    with pytest.raises(ReplayError, match=expected):
        unpack(pack(np.zeros(3, np.uint8)), dtype, shape)


def test_no_more_is_unpacked_than_the_shape_says():
    bomb = zlib.compress(bytes(10_000_000), 9)
    assert len(bomb) < 10_000
    tracemalloc.start()
    with pytest.raises(ReplayError, match=r"Expected 3 bytes .* got more"):
        unpack(bomb, "u1", (3,))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1_000_000


def test_bytes_that_are_cut_short_are_refused():
    packed = pack(np.arange(50, dtype=np.uint8))
    for end in (-1, 8):
        with pytest.raises(ReplayError, match="cut short"):
            unpack(packed[:end], "u1", (50,))
