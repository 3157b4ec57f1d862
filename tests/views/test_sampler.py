"""Worlds drawn from a distribution: what a sampler says, what it refuses, and what is drawn."""

from collections import Counter

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.views.sampler import ScenarioSampler, _at
from tests.support.sampled import TWO_WORLDS, sampler


def drawn(worlds: ScenarioSampler, n_seeds: int = 200):
    return [worlds.world_of(seed) for seed in range(n_seeds)]


def test_a_seed_gives_the_same_world_and_others_give_others():
    again = ScenarioSampler(TWO_WORLDS)
    assert [again.world_of(seed) for seed in range(20)] == drawn(sampler(), 20)
    assert len({world.n_robots for world in drawn(sampler(), 20)}) > 2


def test_worlds_come_as_often_as_their_weights_say_and_wrappers_as_their_probability():
    found = drawn(sampler())
    names = Counter(world.scenario.name for world in found)
    assert names["search_and_rescue"] / len(found) == pytest.approx(0.25, abs=0.1)
    with_noise = sum("sensor_noise" in [wrapper.name for wrapper in world.wrappers] for world in found)
    assert with_noise / len(found) == pytest.approx(0.5, abs=0.12)


def test_values_lie_within_their_ranges_and_are_whole_where_the_field_is():
    for world in drawn(sampler()):
        config = world.scenario
        assert isinstance(config.robots.n_robots, int)
        assert 2 <= config.robots.n_robots <= 6
        assert config.reward.delivery == (0.0 if config.name == "search_and_rescue" else 1.0)
        for wrapper in world.wrappers:
            if wrapper.name == "throttle":
                assert 0.1 <= wrapper.waveform.amplitude <= 0.4


def test_a_density_chooses_the_arena_of_each_swarm():
    config = {"preset": "warehouse_small", "n_robots": {"log_uniform": [8, 64]}, "density": {"uniform": [0.02, 0.1]}}
    worlds = ScenarioSampler({"worlds": [{"scenario": config}]})
    for made in (world.scenario for world in drawn(worlds, 30)):
        assert 0.015 < made.robots.n_robots / (made.arena.width_m * made.arena.height_m) <= 0.1
    assert worlds.n_robots == worlds.largest.robots.n_robots == 64
    assert worlds.n_objects == max(made.objects.n_objects for made in worlds.ends)


@pytest.mark.parametrize(
    ("kind", "values", "grain", "at_zero", "at_half", "at_one"),
    [
        ("uniform", (2, 4), None, 2.0, 3.0, 4.0),
        ("uniform", (2, 4), 1, 2, 3, 4),
        ("uniform", (1.0, 2.0), 0.2, 1.0, 1.6, 2.0),
        ("log_uniform", (1, 100), None, 1.0, 10.0, 100.0),
        ("log_uniform", (1, 99), 1, 1, 10, 99),
        ("choice", ("a", "b", "c"), None, "a", "b", "c"),
    ],
)
def test_shares_of_the_draws_by_hand(kind, values, grain, at_zero, at_half, at_one):
    found = [_at("field", {kind: list(values)}, share, grain) for share in (0.0, 0.5, 1.0)]
    assert found == (pytest.approx([at_zero, at_half, at_one]) if kind != "choice" else [at_zero, at_half, at_one])


def test_log_uniform_whole_numbers_are_as_frequent_as_their_ranges_are_wide():
    shares = np.random.default_rng(0).random(20_000)
    counts = Counter(_at("field", {"log_uniform": [1, 3]}, share, 1.0) for share in shares)
    for number in (1, 2, 3):
        expected = np.log((number + 1) / number) / np.log(4)
        assert counts[number] / len(shares) == pytest.approx(expected, abs=0.015)


def changed(**fields):
    return {"worlds": [{"scenario": {"preset": "warehouse_small", "n_robots": 3, **fields}}]}


@pytest.mark.parametrize(
    ("mapping", "reason"),
    [
        ({}, "list of tables"),
        ({"worlds": [{"scenario": "warehouse_smal"}]}, "Did you mean 'warehouse_small'"),
        ({"worlds": [{"scenario": "warehouse_small", "weight": 0}]}, "weight"),
        ({"world": []}, "'sampler.world'"),
        (changed(n_objects={"unifrom": [1, 2]}), "n_objects"),
        (changed(n_objects={"uniform": [3, 2]}), r"n_objects as uniform = \[low, high\]"),
        (changed(n_objects={"log_uniform": [0, 2]}), "both ends of n_objects"),
        (changed(n_objects={"uniform": [1.5, 3]}), "multiples of 1"),
        (changed(n_objects={"uniform": [10, 100_000]}), "World 1 .* cannot be with .*n_objects = 100000"),
        ({**changed(), "wrappers": {"population": {"initial_robots": {"uniform": [1, 4]}}}}, "initial_robots"),
    ],
)
def test_what_is_refused(mapping, reason):
    with pytest.raises(ConfigError, match=reason):
        ScenarioSampler(mapping)


@pytest.mark.parametrize("other", [{}, {"neighbours_seen": 2, "neighbour_range_m": 4.0}])
def test_worlds_with_other_columns_are_refused(other):
    worlds = [{"preset": "warehouse_small", **fields} for fields in ({"neighbours_seen": 2}, other)]
    with pytest.raises(ConfigError, match="same columns"):
        ScenarioSampler({"worlds": [{"scenario": world} for world in worlds]})
