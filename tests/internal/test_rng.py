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


@pytest.mark.parametrize("n_numbers", [1, 7, 3000, 5000])
def test_draws_by_tick_are_those_of_one_call_per_tick(n_numbers):
    draws, rng = TickDraws(np.random.default_rng(5), n_numbers), np.random.default_rng(5)
    for tick in range(1, 12):
        expected = rng.random(n_numbers)
        np.testing.assert_array_equal(draws.row(tick), expected)
        np.testing.assert_array_equal(draws.row(tick), expected)
