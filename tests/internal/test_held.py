"""Tuples that compiled code finds by one address."""

import copy
from typing import Any, NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env._internal.held import hold, opened
from tests.support.branches import pickled


class Inner(NamedTuple):
    counts: np.ndarray
    is_odd: bool


class Outer(NamedTuple):
    inner: Inner
    places: tuple[int, float]
    values: np.ndarray


@kernel
def add_up(given: Any) -> None:
    outer = opened(given)
    if outer.inner.is_odd:
        outer.values[0, 0] += outer.inner.counts[1] + outer.places[0] * outer.places[1]


def new_outer() -> Outer:
    return Outer(Inner(np.array([1, 2], np.int32), True), (3, 0.5), np.zeros((2, 2)))


def test_a_held_tuple_is_read_and_written_as_the_tuple_is():
    plain, outer = new_outer(), new_outer()
    held = hold(outer)
    for _ in range(3):
        add_up(plain)
        add_up(held)
        outer.inner.counts[1] += 1
        plain.inner.counts[1] += 1
    assert outer.values[0, 0] == plain.values[0, 0] == 2 + 3 + 4 + 3 * 1.5


def test_copies_have_arrays_of_their_own():
    outer = new_outer()
    pair = outer, hold(outer)
    for theirs, held in (copy.deepcopy(pair), pickled(pair)):
        add_up(held)
        assert theirs.values[0, 0] == 3.5
    assert outer.values[0, 0] == 0.0
