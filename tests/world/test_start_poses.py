"""Where robots start: uniform, apart, away from the border; or an error that says why not."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.distance import pdist

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.world.placement import draw_start_poses

DIAMETER_M = 2 * 0.085036758


def draw(config, seed=0):
    return draw_start_poses(config, stream_rng(seed, Stream.START_POSE))


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_robots_start_apart_and_away_from_the_border(name):
    config = scenario(name)
    for seed in range(5):
        position, heading = draw(config, seed)
        assert position.shape == (config.robots.n_robots, 2)
        assert pdist(position).min() > DIAMETER_M
        margin = config.robots.start_margin_m
        assert np.all(position >= margin)
        assert np.all(position <= (config.arena.width_m - margin, config.arena.height_m - margin))
        assert np.all((heading > -np.pi) & (heading <= np.pi))


def test_positions_and_headings_are_uniform():
    config = scenario("warehouse_small", n_robots=20)
    poses = [draw(config, seed) for seed in range(100)]
    position, heading = np.concatenate([pose[0] for pose in poses]), np.concatenate([pose[1] for pose in poses])
    for values, low, high in (
        (position[:, 0], 2.8, 29.2),
        (position[:, 1], 2.8, 13.2),
        (heading, -np.pi, np.pi),
    ):
        assert stats.kstest(values, "uniform", (low, high - low)).pvalue > 1e-3


def test_of_two_overlapping_robots_the_higher_row_is_drawn_again():
    config = scenario("warehouse_small", n_robots=200, start_margin_m=6.0)
    rng = stream_rng(3, Stream.START_POSE)
    first = rng.uniform((6.0, 6.0), (26.0, 10.0), (200, 2))
    overlapping = np.argwhere(np.triu(np.linalg.norm(first[:, None] - first, axis=2) < DIAMETER_M, 1))
    assert len(overlapping) > 5
    position, _ = draw(config, 3)
    moved = np.flatnonzero(np.any(position != first, axis=1))
    assert set(overlapping[:, 1]) <= set(moved.tolist())
    never_higher = set(range(200)) - set(moved.tolist())
    assert min(overlapping[:, 0].tolist()) in never_higher


def test_impossible_density_says_what_to_do(monkeypatch):
    monkeypatch.setattr("swarm_forage_env.world.placement._TRIALS", 3)
    config = scenario("warehouse_small", n_robots=1500, start_margin_m=4.0)
    with pytest.raises(ConfigError, match="1500 robots in 3 trials; use fewer robots"):
        draw(config)
