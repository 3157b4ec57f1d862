"""Noise on messages and on neighbours."""

from typing import Any

import numpy as np
import pytest

from swarm_forage_env import ConfigError, ForageEnv, scenario
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.wrappers.noise import (
    NOISE_GROUPS,
    MessageNoise,
    MessageNoiseConfig,
    SensorNoise,
    SensorNoiseConfig,
)
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.waveform import Waveform
from tests.reference.adversity import garbled, noise_bits, normal_of, normal_of_bits, shifted_neighbours

N_ROBOTS = 8
SEED = 3
ACTIONS = np.random.default_rng(0).uniform(-1, 1, (6, N_ROBOTS, 5)).astype(np.float32)


def made(**fields: Any) -> ForageEnv:
    shown = {"neighbours_seen": 3, "neighbour_range_m": 6.0, "message_size": 2, "message_range_m": 6.0}
    return ForageEnv(scenario("warehouse_small", **{"n_robots": N_ROBOTS, "physics": "compiled"} | shown | fields))


def test_messages_are_garbled_as_by_the_twin():
    plain, env = made(), made()
    noisy = MessageNoise(env, MessageNoiseConfig(sigma=0.4, loss=0.3))
    rng, columns = stream_rng(SEED, Stream.MESSAGE_NOISE), plain.layout["messages"]
    n_lost = n_clear = 0
    true, seen = plain.reset_batch(SEED), noisy.reset_batch(SEED)
    for actions in (None, *ACTIONS):
        if actions is not None:
            true, seen = plain.step_batch(actions)[0], noisy.step_batch(actions)[0]
        draws = normal_of(rng.random((N_ROBOTS, 2), dtype=np.float32))
        lost = rng.random(N_ROBOTS)
        for robot in range(N_ROBOTS):
            row = true[robot, columns].tolist()
            expected = garbled(row, draws[robot].tolist(), lost[robot], 0.4, 0.3)
            np.testing.assert_allclose(seen[robot, columns], expected, atol=1e-6)
            n_lost += row[-1] > expected[-1]
            n_clear += expected[-1] > 0.0
        np.testing.assert_array_equal(np.delete(seen, columns, axis=1), np.delete(true, columns, axis=1))
    assert n_lost > 0
    assert n_clear > 0


def test_where_everything_is_lost_nothing_is_heard():
    noisy = parse_wrapper("message_noise:loss=1").wrap(made(message_range_m=40.0))
    noisy.reset_batch(SEED)
    obs = noisy.step_batch(ACTIONS[0])[0]
    assert not obs[:, noisy.unwrapped.layout["messages"]].any()


def test_noise_may_follow_a_waveform():
    noisy = parse_wrapper("message_noise:sigma=step,amplitude=0.5,start_s=0.6").wrap(made(message_range_m=40.0))
    assert isinstance(noisy.made_from, MessageNoiseConfig)
    assert isinstance(noisy.made_from.sigma, Waveform)
    columns = noisy.unwrapped.layout["messages"]
    noisy.reset_batch(SEED)
    silent = np.zeros((N_ROBOTS, 5), np.float32)
    heard = [np.abs(noisy.step_batch(silent)[0][:, columns][:, :2]).sum() for _ in range(5)]
    assert heard[0] == heard[1] == 0.0
    assert heard[-1] > 0.0


def test_messages_that_nobody_reads_gather_no_noise():
    env = ForageEnv(made().scenario, reads=("proximity",))
    noisy = MessageNoise(env, MessageNoiseConfig(sigma=1.0))
    noisy.reset_batch(SEED)
    obs = noisy.step_batch(ACTIONS[0])[0]
    assert not obs[:, env.layout["messages"]].any()


@pytest.mark.parametrize(
    ("word", "fields", "expected"),
    [
        ("message_noise:loss=1.5", {}, "message_noise.loss"),
        ("message_noise:sigma=-1", {}, "message_noise.sigma"),
        ("message_noise:loss=0.5", {"message_size": 0}, "give it message_size"),
        ("sensor_noise:groups=neighbours,sigma=0.1", {"neighbours_seen": 0}, "give it neighbours_seen"),
    ],
)
def test_what_makes_no_sense_is_refused(word, fields, expected):
    with pytest.raises(ConfigError, match=expected):
        parse_wrapper(word).wrap(made(**fields))


@pytest.mark.parametrize("distribution", ["gaussian", "uniform"])
def test_neighbours_are_shifted_as_by_the_twin(distribution):
    plain, env = made(), made()
    noisy = SensorNoise(env, SensorNoiseConfig(sigma=1.5, groups=("neighbours",), distribution=distribution))
    bits, columns = noise_bits(SEED, Stream.SENSOR_NOISE, N_ROBOTS, 6), plain.layout["neighbours"]
    true, seen = plain.reset_batch(SEED), noisy.reset_batch(SEED)
    for actions in (None, *ACTIONS):
        if actions is not None:
            true, seen = plain.step_batch(actions)[0], noisy.step_batch(actions)[0]
        draws = next(bits)
        if distribution == "gaussian":
            draws = normal_of_bits(draws)
        else:
            draws = ((draws >> 8) * 2.0**-24 - 0.5) * 12.0**0.5
        for robot in range(N_ROBOTS):
            expected = shifted_neighbours(true[robot, columns].tolist(), draws[robot].tolist(), 1.5, 6.0)
            np.testing.assert_allclose(seen[robot, columns], expected, atol=1e-5)
        np.testing.assert_array_equal(np.delete(seen, columns, axis=1), np.delete(true, columns, axis=1))
    assert (seen[:, columns] != true[:, columns]).any()


def test_neighbours_are_exact_unless_they_are_named():
    assert SensorNoiseConfig(sigma=0.1).groups == NOISE_GROUPS
    plain, noisy = made(), SensorNoise(made(), SensorNoiseConfig(sigma=0.1))
    columns = plain.layout["neighbours"]
    np.testing.assert_array_equal(plain.reset_batch(SEED)[:, columns], noisy.reset_batch(SEED)[:, columns])
