"""Compiled code finds the arrays of one value of nested tuples by the types of another, in the order of the fields."""

from typing import NamedTuple

import numpy as np
import pytest

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.world.kernels.many import alike
from swarm_forage_env.world.rack import addresses


class Inner(NamedTuple):
    factor: float
    rows: IntArray
    pair: tuple[int, FloatArray]


class Outer(NamedTuple):
    table: FloatArray
    inner: Inner
    is_there: bool
    both: tuple[IntArray, IntArray]


def value(start: int) -> Outer:
    """Arrays of different shapes and types that hold the numbers from `start`."""
    whole = [np.arange(start + 10 * k, start + 10 * k + 3, dtype=np.int32) for k in range(3)]
    real = np.arange(start + 30, start + 36, dtype=np.float64)
    return Outer(real.reshape(2, 3), Inner(start / 8, whole[0], (start, real + 10)), start > 0, (whole[1], whole[2]))


@kernel
def tell(like: Outer, at: np.ndarray, told: FloatArray) -> None:
    found = alike(like, at)
    told[0], told[1] = found.table[0, 1], found.table[1, 2]
    told[2], told[3], told[4] = found.inner.factor, found.inner.rows[2], found.inner.pair[0]
    told[5], told[6] = found.inner.pair[1][5], found.is_there
    told[7], told[8] = found.both[0][0], found.both[1][1]


@kernel
def overwrite(like: Outer, at: np.ndarray) -> None:
    found = alike(like, at)
    found.inner.rows[:] = 7
    found.table[1, :] = 0.5


@pytest.mark.compiled
def test_arrays_are_those_at_the_addresses_and_constants_those_of_the_value():
    one, other, told = value(100), value(1000), np.zeros(9)
    tell(one, np.array(addresses(other)), told)
    assert told.tolist() == [1031, 1035, 12.5, 1002, 100, 1045, 1, 1010, 1021]


@pytest.mark.compiled
def test_what_is_written_is_written_there():
    one, other = value(100), value(1000)
    overwrite(one, np.array(addresses(other)))
    assert other.inner.rows.tolist() == [7, 7, 7]
    assert other.table.tolist() == [[1030, 1031, 1032], [0.5, 0.5, 0.5]]
    assert one.inner.rows.tolist() == [100, 101, 102]


def test_every_array_has_an_address_in_order():
    one = value(1)
    arrays = [one.table, one.inner.rows, one.inner.pair[1], *one.both]
    assert addresses(one) == [array.ctypes.data for array in arrays]
