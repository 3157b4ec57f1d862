"""Named random streams."""

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, TickDraws, stream_rng


def test_stream_numbers_are_stored_history():
    names = (
        "PLACEMENT START_POSE OBJECT_MOTION INTERACTION CACHE POLICY SENSOR_NOISE ACTUATOR_NOISE POPULATION SCENARIO"
    )
    assert {stream.name: int(stream) for stream in Stream} == dict(zip(names.split(), [*range(9), 12], strict=True))


def test_streams_and_seeds_differ_and_come_again():
    firsts = {stream_rng(seed, stream).random() for seed in range(50) for stream in Stream}
    assert len(firsts) == 50 * len(Stream)
    assert firsts == {stream_rng(seed, stream).random() for seed in range(50) for stream in Stream}


def test_streams_of_one_seed_are_uncorrelated():
    numbers = np.array([stream_rng(3, stream).random(20_000) for stream in Stream])
    correlation = np.corrcoef(numbers) - np.eye(len(Stream))
    assert np.abs(correlation).max() < 5 / np.sqrt(20_000)


@pytest.mark.parametrize("shape", [(1,), (7,), (9000,), (0,), (3, 4), (700, 4)])
def test_draws_by_tick_are_those_of_one_call_per_tick(shape):
    draws, rng = TickDraws(np.random.default_rng(5), *shape), np.random.default_rng(5)
    for tick in range(1, 12 if shape != (1,) else 10_000):
        expected = rng.random(shape)
        np.testing.assert_array_equal(draws.row(tick), expected, strict=True)
        np.testing.assert_array_equal(draws.row(tick), expected, strict=True)


@pytest.mark.parametrize("shape", [(2000,), (500, 4)])
def test_rows_are_of_the_ticks_that_are_drawn_already_and_ticks_may_be_left_out(shape):
    draws, again = TickDraws(np.random.default_rng(5), *shape), np.random.default_rng(5).random((40, *shape))
    for tick in (1, 3, 4, 17, 33):  # so that a whole block is asked for by nobody
        rows = draws.rows(tick)
        np.testing.assert_array_equal(rows, again[tick - 1 : tick - 1 + len(rows)], strict=True)
        np.testing.assert_array_equal(draws.rows(tick + len(rows) - 1), rows[-1:], strict=True)
