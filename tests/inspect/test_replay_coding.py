"""Arrays of replays as text of a page: they come back as they were, and damaged ones are refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.inspect.replay.coding import pack, unpack


@given(
    st.sampled_from(["u1", "u2", "i4", "f4"]).flatmap(
        lambda dtype: arrays.arrays(dtype, arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5))
    )
)
def test_arrays_come_back(array):
    again = unpack(pack(array), f"{array.dtype.kind}{array.dtype.itemsize}", array.shape)
    assert again.dtype == array.dtype
    assert np.array_equal(again, array, equal_nan=array.dtype.kind == "f")


@pytest.mark.parametrize(("dtype", "shape"), [("u1", (4,)), ("u2", (3,)), ("u1", (2,))])
def test_arrays_of_another_size_are_refused(dtype, shape):
    with pytest.raises(ConfigError, match=r"numbers of an array of shape .*, got 3 bytes"):
        unpack(pack(np.zeros(3, np.uint8)), dtype, shape)


def test_damaged_bytes_are_refused():
    packed = pack(np.arange(50, dtype=np.uint8))
    for bad in (packed[:-1], packed[:8], packed[:-4] + b"xxxx"):
        with pytest.raises(ConfigError, match="got damaged ones"):
            unpack(bad, "u1", (50,))
