"""Named random streams."""

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, TickDraws, stream_rng


def test_stream_numbers_are_stored_history():
    assert {stream.name: int(stream) for stream in Stream} == {
        "PLACEMENT": 0,
        "START_POSE": 1,
        "OBJECT_MOTION": 2,
        "INTERACTION": 3,
        "CACHE": 4,
        "POLICY": 5,
        "SENSOR_NOISE": 6,
        "ACTUATOR_NOISE": 7,
        "POPULATION": 8,
        "SCENARIO": 12,
    }


@pytest.mark.parametrize("stream", Stream)
def test_same_seed_same_numbers(stream):
    np.testing.assert_array_equal(stream_rng(7, stream).random(100), stream_rng(7, stream).random(100))


def test_streams_and_seeds_differ():
    firsts = {stream_rng(seed, stream).random() for seed in range(50) for stream in Stream}
    assert len(firsts) == 50 * len(Stream)


def test_streams_of_one_seed_are_uncorrelated():
    numbers = np.array([stream_rng(3, stream).random(20_000) for stream in Stream])
    correlation = np.corrcoef(numbers) - np.eye(len(Stream))
    assert np.abs(correlation).max() < 5 / np.sqrt(20_000)


def test_negative_seed_is_refused():
    with pytest.raises(ValueError, match="non-negative"):
        stream_rng(-1, Stream.POLICY)


@pytest.mark.parametrize("shape", [(1,), (7,), (9000,), (0,), (3, 4), (700, 4)])
def test_draws_by_tick_are_those_of_one_call_per_tick(shape):
    draws, rng = TickDraws(np.random.default_rng(5), *shape), np.random.default_rng(5)
    for tick in range(1, 12 if shape != (1,) else 10_000):
        expected = rng.random(shape)
        np.testing.assert_array_equal(draws.row(tick), expected, strict=True)
        np.testing.assert_array_equal(draws.row(tick), expected, strict=True)


@pytest.mark.parametrize("shape", [(2000,), (500, 4)])
def test_rows_are_of_the_ticks_that_are_drawn_already(shape):
    draws, again = TickDraws(np.random.default_rng(5), *shape), np.random.default_rng(5).random((12, *shape))
    tick = 1
    while tick <= 8:
        rows = draws.rows(tick)
        np.testing.assert_array_equal(rows, again[tick - 1 : tick - 1 + len(rows)], strict=True)
        np.testing.assert_array_equal(draws.rows(tick + len(rows) - 1), rows[-1:], strict=True)
        tick += len(rows)


def test_a_tick_may_be_left_out():
    """Also so many that numbers of a whole block are asked for by nobody."""
    draws, again = TickDraws(np.random.default_rng(5), 4000), np.random.default_rng(5).random((9, 4000))
    for tick in (1, 4, 9):
        np.testing.assert_array_equal(draws.row(tick), again[tick - 1])
