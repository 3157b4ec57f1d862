"""Asking for memory before it is needed changes nothing."""

import numpy as np
import pytest

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env._internal.prefetching import AHEAD, LINE, prefetch


@kernel
def total(rows, records, far):
    found = 0.0
    for i in range(rows.shape[0]):
        prefetch(rows, i + AHEAD, 3 * rows.itemsize)
        prefetch(records, i + far, LINE)
        prefetch(rows, -i - far, 0)
        found += rows[i, 3] + records[i].size
    return found


@pytest.mark.parametrize("far", [0, 10**12])
def test_rows_that_are_not_there_do_no_harm(far):
    rows = np.arange(30.0, dtype=np.float32).reshape(6, 5)
    records = np.ones(6, [("name", np.int8), ("size", np.float64)])
    before = rows.copy(), records.copy()
    assert total(rows, records, far) == rows[:, 3].sum() + 6.0
    np.testing.assert_array_equal(rows, before[0])
    np.testing.assert_array_equal(records, before[1])


def test_from_python_it_does_nothing():
    assert prefetch(np.zeros((2, 2)), 7, 0) is None
