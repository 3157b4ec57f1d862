"""Held tuples: kernels take them as the tuples themselves, whatever is in them."""

import gc
from typing import NamedTuple

import numpy as np
import pytest

from swarm_forage_env._internal.compiling import direct, is_compiled, kernel
from swarm_forage_env._internal.held import addresses, at, hold, keep

compiled_only = pytest.mark.skipif(not is_compiled(keep), reason="needs the compiler")


class Inner(NamedTuple):
    rows: np.ndarray
    is_on: bool
    pair: tuple[np.ndarray, np.ndarray]


class Outer(NamedTuple):
    number: int
    inner: Inner
    share: float
    flags: np.ndarray


def outer(number: int) -> Outer:
    rows = np.arange(6.0).reshape(2, 3) + number
    return Outer(number, Inner(rows, number % 2 == 0, (np.full(2, 7, np.int32), rows[0])), 0.5, np.ones(3, np.bool_))


@kernel
def total(value: Outer, factor: float) -> float:
    """A sum over everything; the first row is set to zero."""
    inner = value.inner
    found = value.number + factor * value.share + inner.is_on + inner.pair[0].sum() + inner.pair[1][2]
    for i in range(inner.rows.shape[0]):
        for k in range(inner.rows.shape[1]):
            found += inner.rows[i, k]
    for flag in value.flags:
        found += flag
    inner.rows[0, :] = 0.0
    return found


@kernel
def total_of_part(value: Outer, factor: float) -> float:
    """The same by another kernel, which is handed the tuple."""
    return total(value, factor)


@kernel
def total_of_each(value: Outer, places: np.ndarray, factor: float) -> float:
    """The same of several."""
    found = 0.0
    for place in places:
        found += total(at(value, place), factor)
    return found


@pytest.mark.parametrize("function", [total, total_of_part])
def test_a_kernel_takes_a_held_tuple_as_the_tuple(function):
    plain, held = outer(4), outer(4)
    there = hold(held)
    assert direct(function, there, 2.0)(there, 2.0) == total(plain, 2.0)
    np.testing.assert_array_equal(held.inner.rows, plain.inner.rows)
    held.inner.rows[:] = 1.0  # what is there now counts
    assert direct(function, there, 2.0)(there, 2.0) == 4 + 1 + 1 + 14 + 1 + 6 + 3


@compiled_only
def test_others_of_its_type_are_found_by_their_addresses():
    several = [hold(outer(number)) for number in range(3)]
    places = addresses(several)
    assert direct(total_of_each, several[0], places, 2.0)(several[0], places, 2.0) == sum(
        total(outer(number), 2.0) for number in range(3)
    )


def test_arrays_live_as_long_as_what_holds_them():
    there = hold(outer(2))
    gc.collect()
    np.zeros((1_000, 1_000))
    assert direct(total, there, 0.0)(there, 0.0) == total(outer(2), 0.0)
